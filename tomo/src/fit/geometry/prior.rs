//! Priors of parameters of the geometry.

use crate::Error;

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

    /// Slope and second derivative of its penalty by differences of half width `width` inside its bounds.
    pub(super) fn curve(&self, x: f64, width: f64) -> [f64; 2] {
        let [low, high] = self.bounds();
        // Wider differences would let the bounds of the clamp below cross, which panics.
        let width = width.min(0.25 * (high - low));
        if width <= 1e-9 * (1.0 + x.abs()) {
            return [0.0; 2]; // as good as fixed
        }
        // One width from a bound at least: beyond it the penalty is infinite.
        let x = x.clamp(low + width, high - width);
        // Rounding must not lead across a bound.
        let [before, here, after] =
            [x - width, x, x + width].map(|x| self.penalty(x.clamp(low, high)));
        let slope = (after - before) / (2.0 * width);
        // Densities are log-concave: a second derivative below 0 is rounding.
        [slope, ((after - 2.0 * here + before) / (width * width)).max(0.0)]
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
            Prior::Normal { mean, sigma } => mean + sigma * normal(share),
            Prior::Isotropic { low, high } => {
                // Directions in space are uniform in cos i.
                (low.cos() + (high.cos() - low.cos()) * share).clamp(-1.0, 1.0).acos()
            }
        }
    }

    /// Itself, if its numbers make a density.
    ///
    /// # Errors
    /// Names the number that is out of its range.
    pub fn checked(self) -> Result<Self, Error> {
        let wrong = |field, value, allowed| Err(Error::out_of_range(field, value, allowed));
        match self {
            Prior::Uniform { low, high } | Prior::Isotropic { low, high } => {
                if !(low.is_finite() && high.is_finite() && high > low) {
                    return wrong("high", high, "above low");
                }
            }
            Prior::Normal { mean, sigma } => {
                if !mean.is_finite() {
                    return wrong("mean", mean, "a finite number");
                }
                if !(sigma > 0.0 && sigma.is_finite()) {
                    return wrong("sigma", sigma, "above 0");
                }
            }
        }
        Ok(self)
    }
}

/// The quantile of the standard normal distribution.
fn normal(share: f64) -> f64 {
    let share = share.clamp(1e-6, 1.0 - 1e-6);
    // A logistic curve within 0.02 of it, and Newton's steps from there.
    let start = (share / (1.0 - share)).ln() / 1.702;
    (0..6).fold(start, |x, _| {
        let below = 0.5 * libm::erfc(-x * core::f64::consts::FRAC_1_SQRT_2);
        let density = (-0.5 * x * x).exp() / core::f64::consts::TAU.sqrt();
        x - (below - share) / density
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// ln sin θ has the slope cot θ and the second derivative −1/sin²θ, however narrow the bounds are.
    #[test]
    fn exact_curves_of_narrow_priors() {
        for range in [1.0, 0.03, 1e-3] {
            let prior = Prior::Isotropic { low: 0.5, high: 0.5 + range };
            let x = 0.5 + 0.5 * range;
            let [slope, second] = prior.curve(x, 0.02);
            assert!((slope * x.tan() + 1.0).abs() < 1e-3, "{range}: {slope}");
            assert!((second * x.sin().powi(2) - 1.0).abs() < 1e-2, "{range}: {second}");
            assert_eq!(Prior::Uniform { low: 0.5, high: 0.5 + range }.curve(x, 0.03), [0.0; 2]);
        }
        assert_eq!(Prior::Uniform { low: 0.5, high: 0.5 }.curve(0.5, 0.03), [0.0; 2]);
        let normal = Prior::Normal { mean: 0.0, sigma: 2.0 }.curve(1.0, 0.02);
        assert!((normal[0] - 0.25).abs() < 1e-9 && (normal[1] - 0.25).abs() < 1e-9, "{normal:?}");
    }

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
            for share in [0.025, 0.1, 0.5, 0.8, 0.975] {
                let found = below(prior.quantile(share)) / below(15.0);
                assert!((found - share).abs() < tolerance, "{prior:?}: {share} {found}");
            }
        }
    }

    #[test]
    fn exact_quantiles_of_a_direction_share_the_sphere() {
        let whole = Prior::Isotropic { low: 0.0, high: core::f64::consts::PI };
        assert!((whole.quantile(0.25) - 0.5f64.acos()).abs() < 1e-12);
        assert_eq!(Prior::Uniform { low: -1.0, high: 3.0 }.quantile(0.5), 1.0);
        assert!(whole.penalty(-0.1).is_infinite());
    }

    #[test]
    fn exact_priors_curve_like_their_densities() {
        let [slope, bend] = Prior::Normal { mean: 0.3, sigma: 0.2 }.curve(0.5, 1e-3);
        assert!((slope - 5.0).abs() < 1e-9 && (bend - 25.0).abs() < 1e-6, "{slope} {bend}");
        // 0.25 + 0.1 - 0.1 is below 0.25.
        for (low, x) in [(0.0, 1.0), (0.25, 0.25)] {
            assert_eq!(Prior::Uniform { low, high: 1.0 }.curve(x, 0.1), [0.0, 0.0]);
        }
        for degrees in 1..90 {
            let low = f64::from(degrees).to_radians();
            let [slope, bend] = Prior::Isotropic { low, high: 3.0 }.curve(low, 0.02);
            assert!(slope.is_finite() && bend.is_finite(), "{degrees}");
        }
        let isotropic = Prior::Isotropic { low: 0.0, high: core::f64::consts::PI };
        let [slope, bend] = isotropic.curve(1.0, 1e-3);
        assert!((slope + 1.0 / 1f64.tan()).abs() < 1e-5);
        assert!((bend - 1.0 / 1f64.sin().powi(2)).abs() < 1e-4);
    }
}
