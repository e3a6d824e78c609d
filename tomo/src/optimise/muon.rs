//! Muon (Jordan et al. 2024, kellerjordan.github.io/posts/muon): steps of weight matrices along the orthogonal matrix
//! that is nearest to their mean gradient.
//!
//! A mean gradient G = U S Vᵀ has few large singular values. Adam follows these; what the small ones stand for, such as
//! fine structure, is learnt slowly. Muon steps along U Vᵀ, in which all count alike.

use super::adam::{AdamState, update};
use crate::representation::WeightMatrix;
use core::ops::Range;
use kerrlight_common::matrix::{Shape, multiply};
use kerrlight_common::simd::Float;
use rayon::prelude::*;

/// Steps of weight matrices along orthogonal matrices, and of all other parameters by Adam.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Muon {
    /// Decay rate of the mean gradient of matrices, 0 to 1.
    pub beta: f64,
    /// Change of the singular values of a matrix in a step, over the learning rate; that of networks of any width.
    pub scale: f64,
}

impl Default for Muon {
    /// β = 0.95, that of the source. With a scale of 22 a weight of a layer of 128 units changes by twice the rate (root
    /// mean square), which suits networks of coordinates (docs/measurements/fits.md).
    fn default() -> Self {
        Self { beta: 0.95, scale: 22.0 }
    }
}

impl Muon {
    /// Coefficients (a, b, c) of an iteration X ← aX + bXXᵀX + c(XXᵀ)²X (Jordan et al. 2024): five of them bring singular
    /// values of 0.003 to 1 between 0.7 and 1.2.
    pub const QUINTIC: [f64; 3] = [3.4445, -4.7750, 2.0315];
    /// Iterations of a step.
    pub const ITERATIONS: usize = 5;

    /// One step with learning rate `rate` (in units of the parameters). The first moments of `state` are the mean
    /// gradient of all parameters, the second ones stay zero where there are matrices. `matrices` lie behind each other,
    /// in the order of their offsets. Without any this is [`AdamState::step`], to the bit.
    ///
    /// # Panics
    /// If the slices differ in length, or a matrix lies outside of them.
    pub fn step<T: Float>(
        &self,
        rate: f64,
        gradient: &[T],
        matrices: &[WeightMatrix],
        state: &mut AdamState<T>,
        parameters: &mut [T],
    ) {
        let steps = state.begin(gradient, parameters);
        for of in between(matrices, parameters.len()) {
            let moments = [&mut state.first[of.clone()], &mut state.second[of.clone()]];
            update(rate, &gradient[of.clone()], steps, moments, &mut parameters[of]);
        }
        let mean = &mut state.first;
        let directions: Vec<Vec<T>> = matrices
            .iter()
            .map(|matrix| self.look_ahead(&gradient[matrix.range()], &mut mean[matrix.range()]))
            .collect();
        let directions: Vec<Vec<T>> = directions
            .into_par_iter()
            .zip(matrices)
            .map(|(direction, matrix)| orthogonal(direction, matrix.rows, matrix.columns))
            .collect();
        let factor = T::of(-rate * self.scale);
        for (matrix, direction) in matrices.iter().zip(directions) {
            let weights = parameters[matrix.range()].iter_mut();
            weights.zip(direction).for_each(|(x, u)| *x += factor * u);
        }
    }

    /// Renews the mean gradient; where it will be after one more step of the same gradient (Nesterov's momentum).
    fn look_ahead<T: Float>(&self, gradient: &[T], mean: &mut [T]) -> Vec<T> {
        let (keep, rest) = (T::of(self.beta), T::of(1.0 - self.beta));
        let all = mean.iter_mut().zip(gradient);
        all.map(|(mean, g)| {
            *mean = keep * *mean + rest * *g;
            keep * *mean + rest * *g
        })
        .collect()
    }
}

/// Returns the ranges between the matrices.
fn between(matrices: &[WeightMatrix], count: usize) -> impl Iterator<Item = Range<usize>> {
    let starts = core::iter::once(0).chain(matrices.iter().map(|matrix| matrix.range().end));
    let ends = matrices.iter().map(|matrix| matrix.offset).chain(core::iter::once(count));
    starts.zip(ends).map(|(start, end)| start..end).filter(|range| !range.is_empty())
}

/// U Vᵀ of a matrix U S Vᵀ (`rows` × `columns`, row by row), nearly; zero of zero.
fn orthogonal<T: Float>(mut x: Vec<T>, rows: usize, columns: usize) -> Vec<T> {
    let norm = x.iter().map(|x| x.double().powi(2)).sum::<f64>().sqrt();
    if norm == 0.0 {
        return x;
    }
    // No singular value exceeds this norm, and the iteration needs values of at most 1.
    x.iter_mut().for_each(|x| *x = T::of(x.double() / norm));
    let (of, side) = (Shape::by_rows(rows, columns), rows.min(columns));
    let square = Shape::by_rows(side, side);
    let [a, b, c] = Muon::QUINTIC.map(T::of);
    let [mut gram, mut power] = [(); 2].map(|()| vec![T::zero(); side * side]);
    let mut next = x.clone();
    for _ in 0..Muon::ITERATIONS {
        // XᵀX or XXᵀ, whichever is smaller: X(XᵀX) = (XXᵀ)X.
        if rows > columns {
            multiply(&x, of.transposed(), &x, of, &mut gram, false);
        } else {
            multiply(&x, of, &x, of.transposed(), &mut gram, false);
        }
        multiply(&gram, square, &gram, square, &mut power, false);
        power.iter_mut().zip(&gram).for_each(|(power, gram)| *power = b * *gram + c * *power);
        if rows > columns {
            multiply(&x, of, &power, square, &mut next, false);
        } else {
            multiply(&power, square, &x, of, &mut next, false);
        }
        x.iter_mut().zip(&next).for_each(|(x, next)| *x = a * *x + *next);
    }
    x
}

#[cfg(test)]
mod tests;
