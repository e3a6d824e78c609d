//! Uniform B-splines: how much of each node's number a point takes.

use kerrlight_common::simd::Float;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Degree of the interpolation between the nodes of a grid: a sum of B-splines, one about each node (de Boor 1978).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Degree {
    /// Degree 1: trilinear interpolation, with kinks where cells meet.
    #[default]
    Linear,
    /// Degree 2: once continuously differentiable.
    Quadratic,
    /// Degree 3: twice continuously differentiable.
    Cubic,
}

/// Nodes along an axis that a point takes from, at most.
pub(crate) const TAPS: usize = 4;
/// The same in three dimensions.
pub(crate) const STENCIL: usize = TAPS * TAPS * TAPS;

impl Degree {
    /// The degree of its polynomials.
    pub fn number(self) -> usize {
        match self {
            Degree::Linear => 1,
            Degree::Quadratic => 2,
            Degree::Cubic => 3,
        }
    }

    /// Nodes along an axis that a point takes from.
    pub fn taps(self) -> usize {
        self.number() + 1
    }

    /// Nodes' distances from the first and the last node within which the field is dark: there not all B-splines are.
    pub fn margin(self) -> f64 {
        0.5 * (self.number() as f64 - 1.0)
    }

    /// Distance of the first node from the middle of a grid of `nodes` along an axis, for a field of half-width 1.
    pub(crate) fn reach(self, nodes: usize) -> f64 {
        // Of all cells, `margin` at each end are dark.
        let all = (nodes - 1) as f64;
        all / (all - 2.0 * self.margin())
    }

    /// Products of the shares along three axes times `factor`, z fastest; the first `taps`³ are written.
    #[inline(always)]
    pub(crate) fn products<T: Float>(self, within: [T; 3], factor: T, out: &mut [T; STENCIL]) {
        match self {
            Degree::Linear => {
                // Three products fewer.
                let ([x, y, z], one) = (within, T::one());
                let right = factor * x;
                let left = factor - right;
                let (b, d) = (left * y, right * y);
                let rows = [left - b, b, right - d, d];
                for (k, row) in rows.into_iter().enumerate() {
                    out[2 * k] = row * (one - z);
                    out[2 * k + 1] = row * z;
                }
            }
            Degree::Quadratic => self.product_of::<T, 3>(within, factor, out),
            Degree::Cubic => self.product_of::<T, 4>(within, factor, out),
        }
    }

    #[inline(always)]
    fn product_of<T: Float, const N: usize>(
        self,
        within: [T; 3],
        factor: T,
        out: &mut [T; STENCIL],
    ) {
        let [x, y, z] = within.map(|t| self.weights(t));
        for i in 0..N {
            for j in 0..N {
                let row = factor * x[i] * y[j];
                for k in 0..N {
                    out[(i * N + j) * N + k] = row * z[k];
                }
            }
        }
    }

    /// Shares of the nodes of a cell at `t` from 0 to 1, and their derivatives with respect to it; the rest is 0.
    #[inline(always)]
    pub(crate) fn weights<T: Float>(self, t: T) -> [T; TAPS] {
        let of = T::of;
        let (zero, one, s) = (T::zero(), T::one(), T::one() - t);
        match self {
            Degree::Linear => [s, t, zero, zero],
            Degree::Quadratic => {
                let half = of(0.5);
                [half * s * s, half + t * s, half * t * t, zero]
            }
            Degree::Cubic => {
                let sixth = of(1.0 / 6.0);
                let middle = |t: T, s: T| {
                    // (3 t³ − 6 t² + 4)/6 with t² (t − 2) = −t² (1 + s).
                    of(2.0 / 3.0) - of(0.5) * t * t * (one + s)
                };
                [sixth * s * s * s, middle(t, s), middle(s, t), sixth * t * t * t]
            }
        }
    }

    /// Derivatives of the shares with respect to `t`.
    #[inline(always)]
    pub(crate) fn slopes<T: Float>(self, t: T) -> [T; TAPS] {
        let (zero, one, s) = (T::zero(), T::one(), T::one() - t);
        match self {
            Degree::Linear => [-one, one, zero, zero],
            Degree::Quadratic => [-s, s - t, t, zero],
            Degree::Cubic => {
                let half = T::of(0.5);
                let inner = |t: T| t * (T::of(1.5) * t - T::of(2.0));
                [-half * s * s, inner(t), -inner(s), half * t * t]
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const ALL: [Degree; 3] = [Degree::Linear, Degree::Quadratic, Degree::Cubic];

    /// B_d(x) by the recurrence of de Boor, about 0.
    fn spline(degree: usize, x: f64) -> f64 {
        fn of(degree: usize, x: f64) -> f64 {
            // On knots 0, 1, 2 …
            if degree == 0 {
                return if (0.0..1.0).contains(&x) { 1.0 } else { 0.0 };
            }
            let d = degree as f64;
            (x * of(degree - 1, x) + (d + 1.0 - x) * of(degree - 1, x - 1.0)) / d
        }
        of(degree, x + 0.5 * (degree as f64 + 1.0))
    }

    #[test]
    fn exact_shares_are_those_of_the_recurrence() {
        for degree in ALL {
            for t in [0.0, 0.2, 0.5, 0.77, 0.999] {
                for (k, share) in degree.weights(t).into_iter().enumerate().take(degree.taps()) {
                    let expected = spline(degree.number(), t + degree.margin() - k as f64);
                    assert!((share - expected).abs() < 1e-14, "{degree:?} {t} {k} {share}");
                }
            }
        }
    }

    #[test]
    fn exact_slopes_are_those_of_the_shares() {
        for degree in ALL {
            for t in [0.1f64, 0.4, 0.8] {
                let (up, down) = (degree.weights(t + 1e-6), degree.weights(t - 1e-6));
                for (k, slope) in degree.slopes(t).into_iter().enumerate() {
                    assert!(((up[k] - down[k]) / 2e-6 - slope).abs() < 1e-9, "{degree:?} {t} {k}");
                }
                let sum: f64 = degree.weights(t).iter().sum();
                assert!((sum - 1.0).abs() < 1e-14);
            }
        }
    }
}
