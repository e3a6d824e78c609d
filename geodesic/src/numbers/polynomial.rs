//! Dense output: every step of every method is a polynomial in x = (s − s₀)/h ∈ \[0, 1\].

use crate::numbers::scalar::{Elementary, Scalar};

/// A polynomial, lowest power first.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Polynomial<'a, T>(pub &'a [T]);

impl<T: Scalar> Polynomial<'_, T> {
    #[inline(always)]
    pub fn value(&self, x: T) -> T {
        let (last, rest) = self.0.split_last().expect("a polynomial has coefficients");
        rest.iter().rev().fold(*last, |sum, c| *c + x * sum)
    }

    /// Value and derivative with respect to x ∈ \[0, 1\] (h times that with respect to time).
    #[inline(always)]
    pub fn both(&self, x: T) -> (T, T) {
        let (last, rest) = self.0.split_last().expect("a polynomial has coefficients");
        let (mut value, mut slope) = (*last, T::constant(0.0));
        for c in rest.iter().rev() {
            slope = value + x * slope;
            value = *c + x * value;
        }
        (value, slope)
    }

    #[inline(always)]
    pub fn slope(&self, x: T) -> T {
        self.both(x).1
    }
}

impl<T: Elementary> Polynomial<'_, T> {
    /// The point in \[lo, hi\] where the polynomial takes the value `target`, given that it
    /// passes it between them: Newton's method inside a shrinking bracket, then, for numbers
    /// wider than doubles, in full.
    pub fn solve(&self, target: T, mut lo: f64, mut hi: f64) -> T {
        let at = |x: f64| (self.value(T::constant(x)) - target).value();
        let rising = at(lo) < at(hi);
        let mut x = 0.5 * (lo + hi);
        for _ in 0..80 {
            let miss = at(x);
            if miss == 0.0 {
                break;
            }
            if (miss > 0.0) == rising {
                hi = x
            } else {
                lo = x
            }
            let newton = x - miss / self.slope(T::constant(x)).value();
            let next = if newton > lo && newton < hi { newton } else { 0.5 * (lo + hi) };
            let done = (next - x).abs() <= f64::EPSILON * x.abs();
            x = next;
            if done {
                break;
            }
        }
        let mut root = T::constant(x);
        if !T::IS_PLAIN {
            for _ in 0..2 {
                root = root - (self.value(root) - target) / self.slope(root);
            }
        }
        root
    }

    /// The point in \[0, 1\] where the slope, monotonic there, changes sign.
    pub fn solve_slope(&self) -> T {
        let slope = |x: f64| self.slope(T::constant(x)).value();
        let (mut lo, mut hi) = (0.0, 1.0);
        let sign = slope(0.0).signum();
        while hi - lo > 1e-15 {
            let mid = 0.5 * (lo + hi);
            if slope(mid) * sign > 0.0 { lo = mid } else { hi = mid }
        }
        let mut root = T::constant(0.5 * (lo + hi));
        if !T::IS_PLAIN {
            for _ in 0..2 {
                root = root - self.slope(root) / self.curvature(root);
            }
        }
        root
    }

    fn curvature(&self, x: T) -> T {
        let mut sum = T::constant(0.0);
        for (k, c) in self.0.iter().enumerate().skip(2).rev() {
            sum = *c * T::constant((k * (k - 1)) as f64) + x * sum;
        }
        sum
    }
}

/// Two-point Hermite interpolation: the polynomial of degree 2m − 1 that has the first m
/// Taylor coefficients `start` at x = 0 and `end` at x = 1 (both in units of the step), into
/// `out` of length 2m.
#[inline(always)]
pub(crate) fn hermite<const M: usize>(start: &[f64; M], end: &[f64; M], out: &mut [f64]) {
    out[..M].copy_from_slice(start);
    // p = Σ_{k<m} a_k x^k + x^m Σ_j d_j (x − 1)^j: the d_j are the Taylor coefficients at 1 of
    // (end − Σ a_k x^k) x^{−m}.
    let mut rest = [0.0; M];
    for (j, rest) in rest.iter_mut().enumerate() {
        let shifted: f64 = (j..M).map(|k| start[k] * binomial(k, j)).sum();
        *rest = end[j] - shifted;
    }
    let mut d = [0.0; M];
    for (j, d) in d.iter_mut().enumerate() {
        // The coefficients of x^{−m} about 1 are (−1)^i C(m + i − 1, i).
        *d = (0..=j).map(|i| rest[j - i] * signed(i, binomial(M + i - 1, i))).sum();
    }
    for (k, out) in out[M..2 * M].iter_mut().enumerate() {
        *out = (k..M).map(|j| d[j] * signed(j - k, binomial(j, k))).sum();
    }
}

#[inline(always)]
fn signed(k: usize, x: f64) -> f64 {
    if k.is_multiple_of(2) { x } else { -x }
}

/// Binomial coefficients up to the needs of degree 9.
#[inline(always)]
const fn binomial(n: usize, k: usize) -> f64 {
    let (mut product, mut i) = (1, 0);
    while i < k {
        product = product * (n - i) / (i + 1);
        i += 1;
    }
    product as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    fn check<const M: usize>() {
        let coefficients: Vec<f64> =
            (0..2 * M).map(|k| (1.0 + k as f64).sin() / (1.0 + k as f64)).collect();
        let p = Polynomial(&coefficients);
        let start = core::array::from_fn::<f64, M, _>(|k| coefficients[k]);
        let end = core::array::from_fn::<f64, M, _>(|j| {
            (j..2 * M).map(|k| coefficients[k] * binomial(k, j)).sum()
        });
        let mut out = vec![0.0; 2 * M];
        hermite(&start, &end, &mut out);
        for k in 0..=10 {
            let x = f64::from(k) / 10.0;
            assert!((Polynomial(&out).value(x) - p.value(x)).abs() < 1e-13);
            assert!((Polynomial(&out).slope(x) - p.slope(x)).abs() < 1e-12);
        }
    }

    #[test]
    fn exact_for_polynomials_of_its_degree() {
        check::<3>();
        check::<5>();
    }

    #[test]
    fn exact_roots_of_value_and_slope() {
        let p = Polynomial(&[-0.3, 0.1, 1.0, 0.5]);
        let x = p.solve(0.0, 0.0, 1.0);
        assert!(p.value(x).abs() < 1e-16);
        let hill = Polynomial(&[0.0, 1.0, -0.9]);
        assert!((hill.solve_slope() - 1.0 / 1.8).abs() < 1e-14);
    }
}
