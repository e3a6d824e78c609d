//! Dense output: quintic Hermite interpolation from values, slopes and curvatures at both
//! ends of a step (error of order h⁶, below the error of the fifth-order step itself).

/// A polynomial of degree 5 on [0, 1], lowest power first.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Quintic([f64; 6]);

/// Value, first and second derivative at one end of a step.
pub(crate) type End = [f64; 3];

impl Quintic {
    /// The polynomial that meets both ends of a step of length `h`.
    #[inline(always)]
    pub fn new(h: f64, start: End, end: End) -> Self {
        let [y0, d0, s0] = start;
        let [y1, d1, s1] = end;
        let (c1, c2) = (h * d0, 0.5 * h * h * s0);
        let value = (y1 - y0) - c1 - c2;
        let slope = h * d1 - c1 - 2.0 * c2;
        let curvature = h * h * s1 - 2.0 * c2;
        Quintic([
            y0,
            c1,
            c2,
            10.0 * value - 4.0 * slope + 0.5 * curvature,
            -15.0 * value + 7.0 * slope - curvature,
            6.0 * value - 3.0 * slope + 0.5 * curvature,
        ])
    }

    #[inline(always)]
    pub fn value(&self, x: f64) -> f64 {
        let [c0, c1, c2, c3, c4, c5] = self.0;
        c0 + x * (c1 + x * (c2 + x * (c3 + x * (c4 + x * c5))))
    }

    /// Derivative with respect to x ∈ [0, 1] (h times that with respect to time).
    #[inline(always)]
    pub fn slope(&self, x: f64) -> f64 {
        let [_, c1, c2, c3, c4, c5] = self.0;
        c1 + x * (2.0 * c2 + x * (3.0 * c3 + x * (4.0 * c4 + x * 5.0 * c5)))
    }

    /// The point in [lo, hi] where the polynomial takes the value `target`, given that it
    /// passes it between them: Newton's method inside a shrinking bracket.
    pub fn solve(&self, target: f64, mut lo: f64, mut hi: f64) -> f64 {
        let rising = self.value(lo) < self.value(hi);
        let mut x = 0.5 * (lo + hi);
        for _ in 0..80 {
            let miss = self.value(x) - target;
            if miss == 0.0 {
                break;
            }
            if (miss > 0.0) == rising {
                hi = x
            } else {
                lo = x
            }
            let newton = x - miss / self.slope(x);
            let next = if newton > lo && newton < hi { newton } else { 0.5 * (lo + hi) };
            let done = (next - x).abs() <= f64::EPSILON * x.abs();
            x = next;
            if done {
                break;
            }
        }
        x
    }
}

#[cfg(test)]
mod tests {
    use super::Quintic;

    #[test]
    fn exact_for_a_quintic() {
        let p = |x: f64| 1.0 - 2.0 * x + 3.0 * x.powi(3) - 0.5 * x.powi(5);
        let d = |x: f64| -2.0 + 9.0 * x * x - 2.5 * x.powi(4);
        let s = |x: f64| 18.0 * x - 10.0 * x.powi(3);
        let (t, h) = (0.3, 0.7);
        let q = Quintic::new(h, [p(t), d(t), s(t)], [p(t + h), d(t + h), s(t + h)]);
        for k in 0..=10 {
            let x = f64::from(k) / 10.0;
            assert!((q.value(x) - p(t + h * x)).abs() < 1e-14);
            assert!((q.slope(x) - h * d(t + h * x)).abs() < 1e-14);
        }
        let x = q.solve(p(t + h * 0.37), 0.0, 0.6);
        assert!((q.value(x) - p(t + h * 0.37)).abs() < 1e-15);
    }
}
