//! Legendre polynomials.

use crate::numbers::scalar::Elementary;

/// P₀(x), P₁(x), P₂(x), … without end, by Bonnet's recurrence
/// (k + 1) P_{k+1} = (2k + 1) x P_k − k P_{k−1}.
///
/// ```
/// let values: Vec<f64> = kerrlight_geodesic::legendre::values(0.5).take(3).collect();
/// assert_eq!(values, [1.0, 0.5, -0.125]);
/// ```
pub fn values<T: Elementary>(x: T) -> impl Iterator<Item = T> {
    let (mut last, mut value) = (T::constant(0.0), T::constant(1.0));
    (0u32..).map(move |k| {
        let current = value;
        let [twice, k, next] = [2 * k + 1, k, k + 1].map(|n| T::constant(f64::from(n)));
        value = (twice * x * current - k * last) / next;
        last = current;
        current
    })
}

/// P₀(x) to P_{N−1}(x). With the number known beforehand the recurrence multiplies where [`values`] divides.
///
/// ```
/// assert_eq!(kerrlight_geodesic::legendre::first(0.5), [1.0, 0.5, -0.125]);
/// ```
pub fn first<T: Elementary, const N: usize>(x: T) -> [T; N] {
    let mut p = [T::constant(1.0); N];
    if N > 1 {
        p[1] = x;
    }
    for n in 2..N {
        let [a, b] = [(2 * n - 1) as f64 / n as f64, (n - 1) as f64 / n as f64];
        p[n] = T::constant(a) * x * p[n - 1] - T::constant(b) * p[n - 2];
    }
    p
}

/// P_n(x) and its derivative, both dimensionless, for |x| < 1.
///
/// ```
/// let (value, slope) = kerrlight_geodesic::legendre::with_slope(2, 0.5);
/// assert!((value + 0.125f64).abs() < 1e-15 && (slope - 1.5f64).abs() < 1e-15);
/// ```
pub fn with_slope(n: usize, x: f64) -> (f64, f64) {
    let mut pair = [0.0, 1.0];
    for value in values(x).take(n + 1) {
        pair = [pair[1], value];
    }
    let [last, value] = if n == 0 { [0.0, 1.0] } else { pair };
    (value, n as f64 * (x * value - last) / (x * x - 1.0))
}
