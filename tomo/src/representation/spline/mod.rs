//! Voxels with B-splines in between: smooth fields with few nodes.

mod basis;
#[cfg(test)]
mod tests;

pub use basis::Degree;
pub(crate) use basis::{STENCIL, TAPS};

use super::{Coordinates, Gradient, Representation, Workspace};
use crate::Error;
use kerrlight_common::simd::Float;
use rayon::prelude::*;

/// A sum of B-splines about the nodes of a grid.
///
/// Parameters are the factors of the B-splines, z fastest, then y, then x, held at zero or above. They are not the values
/// at the nodes, except with [`Degree::Linear`]. The field is dark outside and within [`Degree::margin`] of the edge. A
/// Gaussian of standard deviation σ differs from the best sum with nodes σ apart by 6 % of its peak with linear, 0.6 %
/// with quadratic and 0.2 % with cubic B-splines.
#[derive(Clone, Debug, PartialEq)]
pub struct Spline {
    nodes: [usize; 3],
    degree: Degree,
    /// Begin of the first cell, and cells a unit of length.
    first: [f64; 3],
    per_length: [f64; 3],
}

/// Place of a point.
struct Place<T> {
    /// The first node that it takes from.
    corner: usize,
    /// Place in its cell, 0 to 1 along each axis.
    within: [T; 3],
}

/// Points that one thread takes at a time.
const SHARE: usize = 2048;
/// Pieces that points are cut into, whatever the number of threads: each adds up its own gradient.
const PIECES: usize = 16;

impl Spline {
    /// Nodes from `low` to `high` (M), both included.
    ///
    /// # Errors
    /// If a number is out of its range.
    pub fn new(
        nodes: [usize; 3],
        low: [f64; 3],
        high: [f64; 3],
        degree: Degree,
    ) -> Result<Self, Error> {
        for count in nodes {
            let allowed = match degree {
                Degree::Linear => "2 to 2048 along each axis",
                Degree::Quadratic => "3 to 2048 along each axis",
                Degree::Cubic => "4 to 2048 along each axis",
            };
            let ok = (degree.taps()..=2048).contains(&count);
            Error::check("nodes", count as f64, ok, allowed)?;
        }
        let total: usize = nodes.iter().product();
        Error::check("nodes", total as f64, total <= 1 << 30, "2^30 in all")?;
        super::grid::cells::check_box(low, high)?;
        let spacing = |k: usize| (high[k] - low[k]) / (nodes[k] - 1) as f64;
        let per_length = [0, 1, 2].map(|k| 1.0 / spacing(k));
        let first = [0, 1, 2].map(|k| low[k] + degree.margin() * spacing(k));
        Ok(Self { nodes, degree, first, per_length })
    }

    /// The value at a point, M.
    pub(crate) fn at<T: Float>(&self, parameters: &[T], [x, y, z]: [T; 3]) -> T {
        self.value(parameters, &Coordinates::xyz(&[x], &[y], &[z]), 0)
    }

    fn place<T: Float>(&self, at: &Coordinates<'_, T>, point: usize) -> Option<Place<T>> {
        let (mut corner, mut within) = (0, [T::zero(); 3]);
        for (k, (within, column)) in within.iter_mut().zip(at.columns()).enumerate() {
            let u = (column[point] - T::of(self.first[k])) * T::of(self.per_length[k]);
            let last = self.nodes[k] - self.degree.taps();
            if u < T::zero() || u > T::of((last + 1) as f64) {
                return None;
            }
            // A NaN is in the first cell, and makes the value one.
            let cell = u.to_usize().unwrap_or(0).min(last);
            *within = u - T::of(cell as f64);
            corner = corner * self.nodes[k] + cell;
        }
        Some(Place { corner, within })
    }

    /// Nodes of a cell before which rows of `taps` nodes begin.
    fn rows(&self, corner: usize) -> impl Iterator<Item = usize> {
        let ([_, ny, nz], taps) = (self.nodes, self.degree.taps());
        (0..taps * taps).map(move |k| corner + (k / taps * ny + k % taps) * nz)
    }

    fn value<T: Float>(&self, parameters: &[T], at: &Coordinates<'_, T>, point: usize) -> T {
        let Some(Place { corner, within }) = self.place(at, point) else { return T::zero() };
        let [x, y, z] = within.map(|t| self.degree.weights(t));
        self.sum(parameters, corner, [&x, &y, &z])
    }

    /// Σ parameter · x · y · z over the nodes of a cell.
    fn sum<T: Float>(&self, parameters: &[T], corner: usize, [x, y, z]: [&[T; TAPS]; 3]) -> T {
        let taps = self.degree.taps();
        let mut sum = T::zero();
        for (k, row) in self.rows(corner).enumerate() {
            let along = parameters[row..row + taps].iter().zip(z);
            let along = along.fold(T::zero(), |sum, (p, z)| sum + *p * *z);
            sum += x[k / taps] * y[k % taps] * along;
        }
        sum
    }

    /// Derivatives with respect to the coordinates.
    fn slopes<T: Float>(&self, parameters: &[T], at: &Coordinates<'_, T>, point: usize) -> [T; 3] {
        let Some(Place { corner, within }) = self.place(at, point) else { return [T::zero(); 3] };
        let shares = within.map(|t| self.degree.weights(t));
        core::array::from_fn(|k| {
            let slope = self.degree.slopes(within[k]);
            let along = core::array::from_fn(|j| if j == k { &slope } else { &shares[j] });
            self.sum(parameters, corner, along) * T::of(self.per_length[k])
        })
    }

    /// Adds cotangent · de/dparameter of some points.
    fn add<T: Float>(&self, at: &Coordinates<'_, T>, cotangents: &[T], sums: &mut [T]) {
        let taps = self.degree.taps();
        let mut products = [T::zero(); STENCIL];
        for (point, cotangent) in cotangents.iter().enumerate() {
            let Some(Place { corner, within }) = self.place(at, point) else { continue };
            self.degree.products(within, *cotangent, &mut products);
            for (row, products) in self.rows(corner).zip(products.chunks_exact(taps)) {
                let nodes = &mut sums[row..row + taps];
                nodes.iter_mut().zip(products).for_each(|(sum, product)| *sum += *product);
            }
        }
    }
}

impl<T: Float> Representation<T> for Spline {
    fn dimension(&self) -> usize {
        3
    }

    fn parameters(&self) -> usize {
        self.nodes.iter().product()
    }

    fn initialise(&self, _seed: u64, parameters: &mut [T]) {
        parameters.fill(T::zero());
    }

    fn project(&self, parameters: &mut [T]) {
        // In this order a NaN stays one.
        parameters.iter_mut().for_each(|x| *x = if *x < T::zero() { T::zero() } else { *x });
    }

    fn eval(
        &self,
        parameters: &[T],
        at: Coordinates<'_, T>,
        values: &mut [T],
        _workspace: &mut Workspace,
    ) {
        assert!(parameters.len() == self.nodes.iter().product::<usize>());
        assert!(at.dimension() == 3 && at.len() == values.len());
        values.par_chunks_mut(SHARE).enumerate().for_each(|(share, values)| {
            let at = at.range(share * SHARE..share * SHARE + values.len());
            for (point, value) in values.iter_mut().enumerate() {
                *value = self.value(parameters, &at, point);
            }
        });
    }

    fn vjp(
        &self,
        parameters: &[T],
        at: Coordinates<'_, T>,
        cotangents: &[T],
        gradient: Gradient<'_, T>,
        workspace: &mut Workspace,
    ) {
        let count = parameters.len();
        assert!(gradient.parameters.len() == count && at.len() == cotangents.len());
        let held: &mut Vec<T> = workspace.of();
        // Cleared first: `resize` alone would leave the sums of the last batch.
        held.clear();
        held.resize(PIECES * count, T::zero());
        let piece = at.len().div_ceil(PIECES).max(1);
        held.par_chunks_mut(count).enumerate().for_each(|(k, sums)| {
            let range = (k * piece).min(at.len())..((k + 1) * piece).min(at.len());
            self.add(&at.range(range.clone()), &cotangents[range], sums);
        });
        // Piece after piece at every node: the number of threads changes no bit.
        gradient.parameters.par_iter_mut().enumerate().for_each(|(node, sum)| {
            held.iter().skip(node).step_by(count).for_each(|more| *sum += *more);
        });
        let Some(mut coordinates) = gradient.coordinates else { return };
        for (point, cotangent) in cotangents.iter().enumerate() {
            let slopes = self.slopes(parameters, &at, point);
            for (column, slope) in coordinates.columns().iter_mut().zip(slopes) {
                column[point] += *cotangent * slope;
            }
        }
    }
}
