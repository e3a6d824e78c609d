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
pub use scattering::{ScatteringKernel, scatter, unscatter};
pub use thermal::add_thermal_noise;

use rand::SeedableRng;
use rand_pcg::Pcg64Mcg;

/// A generator for a step, independent of that of other steps.
fn generator(seed: u64, step: u64) -> Pcg64Mcg {
    // Neighbouring seeds are spread by the generator's own seeding.
    Pcg64Mcg::seed_from_u64(seed ^ step.wrapping_mul(0x9E37_79B9_7F4A_7C15))
}
