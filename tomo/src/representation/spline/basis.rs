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
        // Of all cells, `margin` at each end are dark; so few nodes as leave no other are refused by `Spline::new`.
        let all = nodes as f64 - 1.0;
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
