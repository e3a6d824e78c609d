//! Quantities that are made of visibilities, above all those that station gains cannot touch:
//! closure phases arg(V₁₂ V₂₃ V₃₁) and log closure amplitudes ln|V₁₂ V₃₄/(V₁₃ V₂₄)| (Thompson,
//! Moran & Swenson 2017, §10.3; Blackburn et al. 2020, ApJ 894, 31).

mod closure;
mod count;
mod independent;

pub use closure::{Closure, ClosureKind, ClosureSet, Leg};
pub use count::ClosureCount;

use super::observation::Measured;

/// Amplitude in Jy without the bias of noise: √(|V|² − σ²), 0 where |V| < σ (Rice statistics to first
/// order; Thompson, Moran & Swenson 2017, eq. 9.53 in the limit of high signal to noise).
pub fn debiased_amplitude(measured: &Measured) -> f64 {
    (measured.visibility.norm_sqr() - measured.noise_sigma.powi(2)).max(0.0).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Complex64;

    #[test]
    fn exact_amplitudes_without_bias() {
        let of = |re, im, noise_sigma| {
            debiased_amplitude(&Measured { visibility: Complex64::new(re, im), noise_sigma })
        };
        assert_eq!(of(3.0, 4.0, 3.0), 4.0);
        assert_eq!(of(0.3, 0.4, 0.6), 0.0);
    }
}
