//! Corruptions of visibilities: scattering, leakage, station gains, thermal noise. Each is its own step
//! and nothing is done unless called.
//!
//! Random numbers come from PCG-64 (MCG, O'Neill 2014) seeded with a 64-bit number, and a stream
//! of its own for each step: the same seed makes the same data on every machine.

mod gains;
mod leakage;
mod scattering;
mod thermal;

pub use gains::{GainErrors, apply_gains};
pub use leakage::apply_leakage;
pub use scattering::{SCATTERED, ScatteringKernel, scatter, unscatter};
pub use thermal::add_thermal_noise;

use crate::Error;
use crate::observation::Observation;
use rand::SeedableRng;
use rand_pcg::Pcg64Mcg;

/// What spoils visibilities on their way and in the array.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Corruptions {
    /// True if the scattering towards Sgr A* blurs them.
    pub scattering: bool,
    /// Station gains; none by default.
    pub gains: GainErrors,
    /// True if there is thermal noise.
    pub thermal: bool,
}

impl Corruptions {
    /// Corrupts an observation in the order of light's way.
    ///
    /// # Errors
    /// As [`scatter`].
    pub fn apply(&self, observation: &mut Observation, seed: u64) -> Result<(), Error> {
        if self.scattering {
            scatter(observation, &ScatteringKernel::sgr_a())?;
        }
        if self.gains != GainErrors::default() {
            apply_gains(observation, &self.gains, seed);
        }
        if self.thermal {
            add_thermal_noise(observation, seed);
        }
        Ok(())
    }

    /// Returns lines of the history about what the data are no longer: unscattered, or calibrated in the words of eht-imaging.
    pub fn history(&self) -> Vec<String> {
        let gains = &self.gains;
        let has_amplitudes = gains.constant_amplitude != 0.0
            || gains.scan_amplitude != 0.0
            || !gains.stations.is_empty();
        let lines = [
            (self.scattering, SCATTERED),
            (gains.random_phases, "PHASECAL: 0"),
            (has_amplitudes, "AMPCAL: 0"),
        ];
        lines.into_iter().filter(|(holds, _)| *holds).map(|(_, line)| line.to_owned()).collect()
    }
}

/// A generator for a step, independent of that of other steps.
fn generator(seed: u64, step: u64) -> Pcg64Mcg {
    // Neighbouring seeds are spread by the generator's own seeding.
    Pcg64Mcg::seed_from_u64(seed ^ step.wrapping_mul(0x9E37_79B9_7F4A_7C15))
}
