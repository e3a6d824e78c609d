//! The covariance of a geometry of which data may leave a part open.

use super::{Free, Geometry};
use nalgebra::{DMatrix, SymmetricEigen};

/// Part of every prior's deviation up to which the second derivatives alone are the answer.
const NARROW: f64 = 0.3;
/// Distance that is kept from a pole, in units of each parameter's scale.
const WIDTH: f64 = 0.1;

/// Covariance in units of the parameters' scales, from second derivatives of ½χ² − ln p in the same units, whose first
/// part counts 1/`inflation`; none if they are not finite.
///
/// Where the data decide on all parameters it is the inverse of the second derivatives. Where they do not, directions
/// along which χ² does not rise have the spread of the priors, and the others keep theirs: with L the second derivatives
/// of ½χ² in units of the priors' deviations, negative eigenvalues set to 0, it is (L + 1)⁻¹, the covariance of a normal
/// likelihood and a normal prior.
pub(super) fn covariance(
    free: &[Free],
    geometry: &Geometry,
    bends: &DMatrix<f64>,
    inflation: f64,
) -> Option<DMatrix<f64>> {
    let n = free.len();
    let deviation = |k: usize| free[k].prior.deviation() / free[k].parameter.scale();
    if let Some(factors) = bends.clone().cholesky() {
        let covariance = factors.inverse() * inflation;
        // A normal prior would shrink errors of this width by 1 − 1/√(1 + 0.3²) = 4 % only.
        if (0..n).all(|k| covariance[(k, k)].sqrt() < NARROW * deviation(k)) {
            return Some(covariance);
        }
    }
    // As for the bowl, to take off just what was added.
    let of_prior = |k: usize| {
        let scale = free[k].parameter.scale();
        let [_, bend] = free[k].curve(geometry.get(free[k].parameter), WIDTH * scale);
        bend * scale * scale
    };
    let likelihood = DMatrix::from_fn(n, n, |a, b| {
        let prior = if a == b { of_prior(a) } else { 0.0 };
        (bends[(a, b)] - prior) * deviation(a) * deviation(b) / inflation
    });
    if likelihood.iter().any(|x| !x.is_finite()) {
        return None;
    }
    let mut eigen = SymmetricEigen::new(likelihood);
    eigen.eigenvalues.apply(|x| *x = 1.0 / (x.max(0.0) + 1.0));
    let whole = eigen.recompose();
    Some(DMatrix::from_fn(n, n, |a, b| whole[(a, b)] * deviation(a) * deviation(b)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fit::geometry::tests::{ANY_INCLINATION, uniform};
    use crate::fit::geometry::{Parameter, Span};

    fn free() -> [Free; 2] {
        [uniform(Parameter::Spin, -0.9, 0.9), ANY_INCLINATION]
    }

    fn sigma(covariance: &DMatrix<f64>, k: usize) -> f64 {
        covariance[(k, k)].sqrt() * free()[k].parameter.scale()
    }

    #[test]
    fn exact_a_flat_direction_has_the_spread_of_its_prior() {
        let geometry = Geometry::new(0.3, 1.0);
        // The inclination to 0.01 radians; χ² knows nothing of the spin, or has a ridge there.
        for of_spin in [0.0, -0.2] {
            let inclination = (0.2f64 / 0.01).powi(2) + (0.2 / 1f64.sin()).powi(2);
            let bends = DMatrix::from_row_slice(2, 2, &[of_spin, 0.0, 0.0, inclination]);
            let found = covariance(&free(), &geometry, &bends, 1.0).unwrap();
            assert!((sigma(&found, 0) - 1.8 / 12f64.sqrt()).abs() < 1e-12);
            assert!((sigma(&found, 1) - 0.01).abs() < 1e-5, "{}", sigma(&found, 1));
            assert!(free()[0].is_open(sigma(&found, 0)) && !free()[1].is_open(0.01));
            let [low, high] = free()[0].interval(0.3, Some(sigma(&found, 0)), Span::NEARLY_ALL);
            assert!((low + 0.855).abs() < 1e-9 && (high - 0.855).abs() < 1e-9);
            let [low, high] = free()[1].interval(1.0, Some(0.01), Span::NEARLY_ALL);
            assert!((low - 0.9804).abs() < 1e-6 && (high - 1.0196).abs() < 1e-6);
        }
    }

    /// Spin and position angle that only together are known: each has the spread that the sum leaves it.
    #[test]
    fn exact_a_degenerate_pair_is_bounded_by_its_priors() {
        let parameters = [(Parameter::Spin, 0.9), (Parameter::PositionAngle, 0.3)];
        let free = parameters.map(|(parameter, half)| uniform(parameter, -half, half));
        let (a, b) = (0.9 / 3f64.sqrt(), 0.3 / 3f64.sqrt());
        // (x + y)² / (2 · 0.02²), in units of the scales.
        let scale = [0, 1].map(|k| free[k].parameter.scale());
        let bends = DMatrix::from_fn(2, 2, |i, j| scale[i] * scale[j] / 4e-4);
        let found = covariance(&free, &Geometry::new(0.0, 1.0), &bends, 1.0).unwrap();
        let [x, y] = [0, 1].map(|k| found[(k, k)].sqrt() * scale[k]);
        // Both priors and the sum: 1/σ² = 1/a² + 1/(b² + 0.02²).
        let both =
            |own: f64, other: f64| (1.0 / (own.powi(-2) + 1.0 / (other.powi(2) + 4e-4))).sqrt();
        assert!((x - both(a, b)).abs() < 1e-9 && (y - both(b, a)).abs() < 1e-9, "{x} {y}");
    }

    #[test]
    fn exact_second_derivatives_that_are_not_numbers_have_no_covariance() {
        let bends = DMatrix::from_element(2, 2, f64::NAN);
        assert!(covariance(&free(), &Geometry::new(0.0, 1.0), &bends, 1.0).is_none());
    }
}
