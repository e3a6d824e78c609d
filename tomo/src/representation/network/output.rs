//! The output layer: one unit and the activation.

use super::super::{Activation, Link};
use super::dense::{Matrix, MatrixMut};
use kerrlight_common::simd::{Float, Lanes, Task};

/// Cotangents of the values.
#[derive(Clone, Copy)]
pub enum Cotangents<'a, T> {
    /// One number a point.
    Given(&'a [T]),
    /// Made of the values, group by group.
    Linked(&'a Link<'a, T>),
}

/// values = activation(rows · weights + shift), and the activation's slopes.
pub struct Output<'a, T> {
    pub input: Matrix<'a, T>,
    /// Weights, bias, and zeros to a multiple of the lanes.
    pub weights: &'a [T],
    pub activation: Activation,
    pub shift: T,
    pub values: &'a mut [T],
    /// Slopes, as many as `values`, or empty if not wanted.
    pub slopes: &'a mut [T],
}

impl<T: Float> Task<T> for Output<'_, T> {
    type Output = ();
    #[inline(always)]
    fn run<V: Lanes<T>>(self) {
        let rows = self.input.numbers.chunks(self.input.stride);
        for (value, row) in self.values.iter_mut().zip(rows) {
            let mut sum = V::splat(T::zero());
            // The bias is the weight of the one behind the units; weights behind that are zero.
            for (w, x) in self.weights.chunks_exact(V::LANES).zip(row.chunks_exact(V::LANES)) {
                let (w, x) = (V::load_or(w, T::zero()), V::load_or(x, T::zero()));
                sum = w.mul_add(x, sum);
            }
            *value = sum.sum();
        }
        let mut slopes = self.slopes.chunks_mut(V::LANES);
        for values in self.values.chunks_mut(V::LANES) {
            let x = V::load_or(values, T::zero()) + V::splat(self.shift);
            let (value, slope) = self.activation.apply::<T, V>(x);
            value.store(values);
            if let Some(slopes) = slopes.next() {
                slope.store(slopes);
            }
        }
    }
}

/// Cotangents (of the output before its activation) times its weights, times the derivative of the
/// ReLU, and the gradient of the weights.
pub struct OutputBackward<'a, T> {
    /// One number a point.
    pub cotangents: &'a [T],
    pub input: Matrix<'a, T>,
    /// Weights, as in [`Output`].
    pub weights: &'a [T],
    pub output: MatrixMut<'a, T>,
    /// Weights' gradient, as long as `weights`; added to.
    pub gradient: &'a mut [T],
}

impl<T: Float> Task<T> for OutputBackward<'_, T> {
    type Output = ();
    #[inline(always)]
    fn run<V: Lanes<T>>(self) {
        let zero = V::splat(T::zero());
        let blocks =
            self.weights.chunks_exact(V::LANES).zip(self.gradient.chunks_exact_mut(V::LANES));
        for (b, (weights, gradient)) in blocks.enumerate() {
            let columns = b * V::LANES..(b + 1) * V::LANES;
            let w = V::load_or(weights, T::zero());
            let mut sum = V::load_or(gradient, T::zero());
            let rows = self.input.numbers.chunks(self.input.stride);
            let outputs = self.output.numbers.chunks_mut(self.output.stride);
            for ((x, row), output) in self.cotangents.iter().zip(rows).zip(outputs) {
                let x = V::splat(*x);
                let h = V::load_or(&row[columns.clone()], T::zero());
                sum = x.mul_add(h, sum);
                let masked = V::select(zero.lt(h), x * w, zero);
                masked.store(&mut output[columns.clone()]);
            }
            sum.store(gradient);
        }
    }
}
