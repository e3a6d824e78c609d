//! What measured visibilities need besides errors of calibration: the scattering that the light has passed, and errors
//! for what the source varies.

use super::Result;
use super::polarized::is_polarized;
use crate::fit::settings::{Loss, Scattering, StaticPolarization, Variability, Within, refuse};
use core::f64::consts::{FRAC_1_SQRT_2, SQRT_2};
use kerrlight_vlbi::noise::{ScatteringKernel, unscatter};
use kerrlight_vlbi::observation::{Basis, Observation};

/// Undoes scattering, then adds to errors what the source varies. `name` is what the data are called in messages.
///
/// # Errors
/// If the kernel of scattering needs a frequency that is not known, or errors of all products would need the
/// variability of polarised light.
pub(super) fn correct(
    observation: &mut Observation,
    losses: &[Loss],
    (scattering, variability): (Option<Scattering>, Option<Variability>),
    name: &str,
) -> Result<()> {
    if scattering == Some(Scattering::SgrA) {
        unscatter(observation, &ScatteringKernel::sgr_a()).within(name)?;
    }
    let Some(variability) = variability else { return Ok(()) };
    if is_polarized(losses) {
        refuse!(
            "data.visibilities.variability is that of total intensity: it is not for polarized-visibilities or \
             polarimetric-ratios"
        );
    }
    for row in &mut observation.rows {
        let sigma = variability.sigma(row.uv[0].hypot(row.uv[1]));
        row.noise_sigma[0] = row.noise_sigma[0].hypot(sigma);
    }
    Ok(())
}

/// Adds to errors of products what the source varies, and leakage that calibration has left: a part of Stokes I from each
/// station.
pub(super) fn polarized_errors(
    observation: &mut Observation,
    of_light: Option<Variability>,
    polarization: &StaticPolarization,
) {
    let basis = observation.basis;
    // Q and U are each half of the sum or the difference of RL and LR.
    let (crossed, share) = match basis {
        Basis::Circular => (2..4, 1.0),
        Basis::Stokes => (1..3, FRAC_1_SQRT_2),
    };
    for row in &mut observation.rows {
        let length = row.uv[0].hypot(row.uv[1]);
        let light = row.stokes_i(basis).map_or(0.0, |i| i.visibility.norm());
        let varies = |law: Option<Variability>| law.map_or(0.0, |law| law.sigma(length));
        // Half of the sum of two hands has the error that the law says.
        let hands = row.parts_of_i(basis).iter().flatten().count().max(1) as f64;
        let of_light = varies(of_light) * hands.sqrt();
        let leaked = SQRT_2 * polarization.leakage_left * light;
        let of_polarized = share * varies(polarization.variability).hypot(leaked);
        for (k, sigma) in row.noise_sigma.iter_mut().enumerate() {
            *sigma = sigma.hypot(if crossed.contains(&k) { of_polarized } else { of_light });
        }
    }
}
