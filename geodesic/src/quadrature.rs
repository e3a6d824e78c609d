//! Nodes and weights for integrals along a path, placed by the caller's intervals and
//! never by the stepper.

/// Nodes and weights of the four-point Gauss–Legendre rule on [−1, 1]: exact to degree 7.
const GAUSS_4: [(f64, f64); 4] = [
    (-0.861_136_311_594_052_6, 0.347_854_845_137_453_85),
    (-0.339_981_043_584_856_26, 0.652_145_154_862_546_1),
    (0.339_981_043_584_856_26, 0.652_145_154_862_546_1),
    (0.861_136_311_594_052_6, 0.347_854_845_137_453_85),
];

/// Nodes and weights of the four-point Gauss–Legendre rule on `[from, to]`.
///
/// ```
/// let cube: f64 = kerrlight_geodesic::quadrature::gauss_4(0.0, 2.0).map(|(x, w)| w * x * x * x).sum();
/// assert!((cube - 4.0).abs() < 1e-14);
/// ```
pub fn gauss_4(from: f64, to: f64) -> impl Iterator<Item = (f64, f64)> {
    let (middle, half) = (0.5 * (from + to), 0.5 * (to - from));
    GAUSS_4.into_iter().map(move |(x, w)| (middle + half * x, half * w))
}

/// `n` ≥ 2 points from `from` to `to`, both ends included.
pub fn equidistant(from: f64, to: f64, n: usize) -> impl ExactSizeIterator<Item = f64> {
    let step = (to - from) / (n.max(2) - 1) as f64;
    (0..n).map(move |k| if k + 1 == n { to } else { from + step * k as f64 })
}
