//! Priors of parameters of the geometry.

use crate::Error;
use core::f64::consts::{PI, SQRT_2};
use statrs::function::erf::erfc_inv;

/// A probability density.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Prior {
    /// The same everywhere between two values.
    Uniform {
        /// Least value.
        low: f64,
        /// Largest value.
        high: f64,
    },
    /// A bell curve.
    Normal {
        /// Its middle.
        mean: f64,
        /// Its standard deviation, above 0.
        sigma: f64,
    },
    /// Isotropic axis of an inclination: sin i between two angles in radians.
    Isotropic {
        /// Least inclination.
        low: f64,
        /// Largest inclination.
        high: f64,
    },
}

impl Prior {
    /// Least and largest value that is possible.
    pub fn bounds(&self) -> [f64; 2] {
        match *self {
            Prior::Uniform { low, high } | Prior::Isotropic { low, high } => [low, high],
            Prior::Normal { .. } => [f64::NEG_INFINITY, f64::INFINITY],
        }
    }

    /// −ln p(x) up to a constant, infinite where x is not possible.
    pub fn penalty(&self, x: f64) -> f64 {
        let [low, high] = self.bounds();
        if !(low..=high).contains(&x) {
            return f64::INFINITY;
        }
        match *self {
            Prior::Uniform { .. } => 0.0,
            Prior::Normal { mean, sigma } => 0.5 * ((x - mean) / sigma).powi(2),
            // At the poles, where p = 0, only just not impossible.
            Prior::Isotropic { .. } => -x.sin().max(1e-6).ln(),
        }
    }

    /// Slope and second derivative of its penalty. Next to a pole, where they grow without bound, they are those `width` away
    /// from it.
    pub(super) fn curve(&self, x: f64, width: f64) -> [f64; 2] {
        match *self {
            Prior::Uniform { .. } => [0.0; 2],
            Prior::Normal { mean, sigma } => [(x - mean) / (sigma * sigma), sigma.powi(-2)],
            Prior::Isotropic { low, high } => {
                let x = x.clamp(low, high).clamp(width, PI - width);
                [-1.0 / x.tan(), x.sin().powi(-2)]
            }
        }
    }

    /// Its standard deviation.
    pub fn deviation(&self) -> f64 {
        match *self {
            Prior::Uniform { low, high } => (high - low) / 12f64.sqrt(),
            Prior::Normal { sigma, .. } => sigma,
            Prior::Isotropic { low, high } => {
                // Integrals of sin θ, θ sin θ and θ² sin θ.
                let sums = |x: f64| {
                    let (sin, cos) = x.sin_cos();
                    [-cos, sin - x * cos, 2.0 * x * sin + (2.0 - x * x) * cos]
                };
                let (from, to) = (sums(low), sums(high));
                let [whole, first, second] = [0, 1, 2].map(|k| to[k] - from[k]);
                (second / whole - (first / whole).powi(2)).max(0.0).sqrt()
            }
        }
    }

    /// The value below which a part `share` of the probability lies, for starts, draws and intervals.
    pub fn quantile(&self, share: f64) -> f64 {
        match *self {
            Prior::Uniform { low, high } => low + (high - low) * share,
            Prior::Normal { mean, sigma } => {
                // Within six standard deviations: a share of 0 or 1 has no quantile.
                let share = share.clamp(1e-9, 1.0 - 1e-9);
                mean - sigma * SQRT_2 * erfc_inv(2.0 * share)
            }
            Prior::Isotropic { low, high } => {
                // Directions in space are uniform in cos i.
                (low.cos() + (high.cos() - low.cos()) * share).clamp(-1.0, 1.0).acos()
            }
        }
    }

    /// Part of the probability below a value.
    pub fn below(&self, x: f64) -> f64 {
        match *self {
            Prior::Uniform { low, high } => ((x - low) / (high - low)).clamp(0.0, 1.0),
            Prior::Normal { mean, sigma } => 0.5 * libm::erfc((mean - x) / (sigma * SQRT_2)),
            Prior::Isotropic { low, high } => {
                ((low.cos() - x.cos()) / (low.cos() - high.cos())).clamp(0.0, 1.0)
            }
        }
    }

    /// Itself, if its numbers make a density.
    ///
    /// # Errors
    /// Names the number that is out of its range.
    pub fn checked(self) -> Result<Self, Error> {
        let check = Error::check;
        match self {
            Prior::Uniform { low, high } | Prior::Isotropic { low, high } => {
                let ok = low.is_finite() && high.is_finite() && high > low;
                check("last value of the prior", high, ok, "above its first")?;
            }
            Prior::Normal { mean, sigma } => {
                check("mean", mean, mean.is_finite(), "a finite number")?;
                check("sigma", sigma, sigma > 0.0 && sigma.is_finite(), "above 0")?;
            }
        }
        Ok(self)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Shares of the probability by a sum over the density.
    #[test]
    fn exact_quantiles_have_their_share_of_the_density() {
        let priors = [
            (Prior::Normal { mean: 0.3, sigma: 0.2 }, 1e-3),
            (Prior::Isotropic { low: 0.3, high: 3.0 }, 1e-4),
            (Prior::Uniform { low: -0.5, high: 2.0 }, 1e-4),
        ];
        for (prior, tolerance) in priors {
            let density = |k: usize| (-prior.penalty(-5.0 + 1e-4 * k as f64)).exp();
            let below = |x: f64| (0..((x + 5.0) * 1e4) as usize).map(density).sum::<f64>();
            let moment = |power: i32| {
                let at = |k: usize| (-5.0 + 1e-4 * k as f64).powi(power) * density(k);
                (0..200_000).map(at).sum::<f64>() / below(15.0)
            };
            let deviation = (moment(2) - moment(1).powi(2)).sqrt();
            assert!((prior.deviation() / deviation - 1.0).abs() < 1e-3, "{prior:?}: {deviation}");
            for share in [1e-3, 0.025, 0.1, 0.5, 0.8, 0.975, 0.999] {
                let found = below(prior.quantile(share)) / below(15.0);
                assert!((found - share).abs() < tolerance, "{prior:?}: {share} {found}");
            }
        }
    }

    #[test]
    fn exact_quantiles_of_a_direction_share_the_sphere() {
        let whole = Prior::Isotropic { low: 0.0, high: PI };
        assert!((whole.quantile(0.25) - 0.5f64.acos()).abs() < 1e-12);
        assert_eq!(Prior::Uniform { low: -1.0, high: 3.0 }.quantile(0.5), 1.0);
        assert!(whole.penalty(-0.1).is_infinite());
    }

    /// Quantiles of the normal distribution (Abramowitz & Stegun 1972, table 26.5): far out, too.
    #[test]
    fn exact_normal_quantiles() {
        let normal = Prior::Normal { mean: 1.0, sigma: 2.0 };
        for (share, expected) in
            [(1e-4, -3.719_016_485), (1e-3, -3.090_232_306), (0.025, -1.959_963_985)]
        {
            assert!((normal.quantile(share) - (1.0 + 2.0 * expected)).abs() < 1e-8, "{share}");
            assert!(
                (normal.quantile(1.0 - share) - (1.0 - 2.0 * expected)).abs() < 1e-8,
                "{share}"
            );
        }
        assert!(normal.quantile(0.0) < -10.0 && normal.quantile(1.0) > 12.0);
    }

    /// Slopes and second derivatives are those of differences; next to a pole they are those a width away.
    #[test]
    fn exact_priors_curve_like_their_densities() {
        let priors = [
            Prior::Normal { mean: 0.3, sigma: 0.2 },
            Prior::Isotropic { low: 0.0, high: PI },
            Prior::Isotropic { low: 0.499, high: 0.501 },
            Prior::Uniform { low: 0.0, high: 1.0 },
        ];
        for prior in priors {
            let (x, step) = (0.5, 1e-4);
            let [before, here, after] = [x - step, x, x + step].map(|x| prior.penalty(x));
            let [slope, bend] = prior.curve(x, 0.02);
            assert!((slope - (after - before) / (2.0 * step)).abs() < 1e-5, "{prior:?}: {slope}");
            let second = (after - 2.0 * here + before) / (step * step);
            assert!((bend - second).abs() < 1e-4 * (1.0 + bend), "{prior:?}: {bend}");
        }
        let isotropic = Prior::Isotropic { low: 0.0, high: PI };
        assert_eq!(isotropic.curve(1e-3, 0.02), isotropic.curve(0.02, 0.02));
        assert_eq!(isotropic.curve(PI, 0.02), isotropic.curve(PI - 0.02, 0.02));
    }
}
