//! Penalties on an emission field: on values at the nodes of a regular grid. Off by default.
//!
//! Every penalty is an integral over the volume (a sum over nodes times the volume of a cell), so that a weight means
//! the same on a finer grid.

use crate::Error;
use kerrlight_common::simd::Float;
use rayon::prelude::*;

/// Nodes of a regular grid, z fastest.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Shape {
    /// Nodes along x, y and z.
    pub nodes: [usize; 3],
    /// Distances between nodes, M.
    pub spacing: [f64; 3],
}

/// A penalty on a field e(x).
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum Regulariser {
    /// ∫ (√(|∇e|² + ε²) − ε) dV with forward differences: total variation (Rudin, Osher & Fatemi 1992), smoothed
    /// where slopes are below ε.
    TotalVariation {
        /// ε, emission per M.
        epsilon: f64,
    },
    /// ∫ |∇e|² dV with forward differences.
    Smoothness,
    /// ∫ |e| dV; its slope at 0 is that of positive e.
    Sparsity,
}

/// A penalty with its weight.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Prior {
    /// Which.
    pub regulariser: Regulariser,
    /// Factor of the penalty.
    pub weight: f64,
}

impl Shape {
    /// Number of nodes.
    pub fn count(&self) -> usize {
        self.nodes.iter().product()
    }

    /// Volume of a cell, M³.
    pub fn cell(&self) -> f64 {
        self.spacing.iter().product()
    }
}

impl Regulariser {
    /// Itself, if its numbers are in their ranges.
    ///
    /// # Errors
    /// Names the number that is not.
    pub fn checked(self) -> Result<Self, Error> {
        match self {
            Self::TotalVariation { epsilon } if !(epsilon > 0.0 && epsilon.is_finite()) => {
                Err(Error::out_of_range("total variation epsilon", epsilon, "above 0"))
            }
            _ => Ok(self),
        }
    }

    /// Returns its name in text.
    pub fn name(&self) -> &'static str {
        match self {
            Self::TotalVariation { .. } => "total variation",
            Self::Smoothness => "smoothness",
            Self::Sparsity => "sparsity",
        }
    }

    /// `weight` times the penalty; adds its gradient. By all threads, in an order that does not depend on
    /// their number.
    ///
    /// # Panics
    /// If the lengths are not that of the shape.
    pub fn value_and_gradient<T: Float>(
        &self,
        values: &[T],
        shape: Shape,
        weight: f64,
        gradient: &mut [T],
    ) -> f64 {
        assert!(values.len() == shape.count() && gradient.len() == values.len());
        let scale = weight * shape.cell();
        let plane = shape.nodes[1] * shape.nodes[2];
        let of_plane = |(i, out): (usize, &mut [T])| match self {
            Self::TotalVariation { epsilon } => {
                // F(s) = √(s + ε²) − ε of the squared slope s, and 2 F′ = 1/√(s + ε²).
                let slope = |square: f64| (square + epsilon * epsilon).sqrt();
                let norm = |square| (slope(square) - epsilon, 1.0 / slope(square));
                Differences { values, shape, norm }.plane(i, scale, out)
            }
            Self::Smoothness => {
                let norm = |square| (square, 2.0);
                Differences { values, shape, norm }.plane(i, scale, out)
            }
            Self::Sparsity => sizes(&values[i * plane..], scale, out),
        };
        let sums: Vec<f64> = gradient.par_chunks_mut(plane).enumerate().map(of_plane).collect();
        scale * sums.iter().sum::<f64>()
    }
}

/// Sum of |e| over a plane; adds its slopes.
fn sizes<T: Float>(values: &[T], scale: f64, out: &mut [T]) -> f64 {
    let mut sum = 0.0;
    for (value, out) in values.iter().zip(out) {
        let e = value.double();
        *out += T::of(if e < 0.0 { -scale } else { scale });
        sum += e.abs();
    }
    sum
}

/// A function of the squared slope at each node: its value and twice its derivative.
struct Differences<'a, T, F> {
    values: &'a [T],
    shape: Shape,
    norm: F,
}

impl<T: Float, F: Fn(f64) -> (f64, f64)> Differences<'_, T, F> {
    /// Forward differences at a node along each axis, 0 beyond the last one.
    #[inline]
    fn slopes(&self, at: [usize; 3], index: usize) -> [f64; 3] {
        let [nx, ny, nz] = self.shape.nodes;
        let here = self.values[index].double();
        let slope = |c: usize, n: usize, stride: usize| {
            if at[c] + 1 < n {
                (self.values[index + stride].double() - here) / self.shape.spacing[c]
            } else {
                0.0
            }
        };
        [slope(0, nx, ny * nz), slope(1, ny, nz), slope(2, nz, 1)]
    }

    /// The value at a node, and the flux F'∇e through each of its forward faces.
    #[inline]
    fn flux(&self, at: [usize; 3], index: usize) -> (f64, [f64; 3]) {
        let slopes = self.slopes(at, index);
        let (value, factor) = (self.norm)(slopes.iter().map(|s| s * s).sum());
        (value, slopes.map(|slope| factor * slope))
    }

    /// Sum over a plane of nodes; the gradient is minus the divergence of the flux. Every node looks at
    /// those behind it, so that planes can be done in any order.
    fn plane(&self, i: usize, scale: f64, out: &mut [T]) -> f64 {
        let [_, ny, nz] = self.shape.nodes;
        let strides = [ny * nz, nz, 1];
        let mut sum = 0.0;
        for (k, out) in out.iter_mut().enumerate() {
            let (at, index) = ([i, k / nz, k % nz], i * ny * nz + k);
            let (value, flux) = self.flux(at, index);
            let mut divergence = 0.0;
            for c in 0..3 {
                let mut through = flux[c];
                if at[c] > 0 {
                    let mut behind = at;
                    behind[c] -= 1;
                    through -= self.flux(behind, index - strides[c]).1[c];
                }
                divergence += through / self.shape.spacing[c];
            }
            *out -= T::of(scale * divergence);
            sum += value;
        }
        sum
    }
}

#[cfg(test)]
mod tests;
