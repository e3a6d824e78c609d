//! Nodes and weights for integrals along a path, placed by the caller's intervals and
//! never by the stepper.

use crate::numbers::legendre::with_slope;

/// `n` points from `from` to `to`, both ends included, in the unit of the ends; a single one at `from`.
pub fn equidistant(from: f64, to: f64, n: usize) -> impl ExactSizeIterator<Item = f64> {
    let step = (to - from) / (n.max(2) - 1) as f64;
    (0..n).map(move |k| if k > 0 && k + 1 == n { to } else { from + step * k as f64 })
}

/// Nodes in (0, 1), in order, and weights of the Gauss–Legendre rule with `n` ≥ 1 points:
/// exact to degree 2n − 1.
///
/// ```
/// let rule = kerrlight_geodesic::quadrature::gauss_legendre(5);
/// let ninth: f64 = rule.iter().map(|(x, w)| w * x.powi(9)).sum();
/// assert!((ninth - 0.1).abs() < 1e-15);
/// ```
pub fn gauss_legendre(n: usize) -> Vec<(f64, f64)> {
    let mut rule = vec![(0.5, 1.0); n];
    for k in 0..n.div_ceil(2) {
        // Newton's method on P_n from an asymptotic value of its root.
        let angle = core::f64::consts::PI * (k as f64 + 0.75) / (n as f64 + 0.5);
        let mut x = angle.cos();
        for _ in 0..8 {
            let (value, slope) = with_slope(n, x);
            x -= value / slope;
        }
        if 2 * k + 1 == n {
            x = 0.0;
        }
        let slope = with_slope(n, x).1;
        let weight = 1.0 / ((1.0 - x * x) * slope * slope);
        rule[k] = (0.5 * (1.0 - x), weight);
        rule[n - 1 - k] = (0.5 * (1.0 + x), weight);
    }
    rule
}
