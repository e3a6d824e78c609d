//! Positional encoding of a tile of points, and its derivative.

use super::super::{Coordinates, CoordinatesMut};
use super::dense::{Matrix, MatrixMut};
use kerrlight_common::simd::{Float, Lanes, MAX_LANES, Task, math};

/// Rows γ(x) = [p x, sin 2ʲx, sin(2ʲx + π/2)] (for each j the coordinates one after the other), then a
/// one.
pub struct Encode<'a, T> {
    pub at: Coordinates<'a, T>,
    /// Factors of coordinates, in their order.
    pub scales: &'a [T],
    /// p, the part of the first that enters without sine and cosine; 1 of all others.
    pub part: T,
    pub degree: usize,
    pub output: MatrixMut<'a, T>,
}

impl<T: Float> Task<T> for Encode<'_, T> {
    type Output = ();
    #[inline(always)]
    fn run<V: Lanes<T>>(self) {
        let (dimension, stride) = (self.at.dimension(), self.output.stride);
        let columns = dimension * (1 + 2 * self.degree);
        let rows = self.output.numbers.chunks_mut(stride * V::LANES);
        for (block, rows) in rows.enumerate().take(self.at.len().div_ceil(V::LANES)) {
            for (d, (column, scale)) in self.at.columns().iter().zip(self.scales).enumerate() {
                let x = V::load_or(&column[block * V::LANES..], T::zero()) * V::splat(*scale);
                put(if d == 0 { x * V::splat(self.part) } else { x }, rows, stride, d);
                let mut x = x;
                for j in 0..self.degree {
                    let (sin, cos) = math::sin_cos::<T, V>(x);
                    put(sin, rows, stride, dimension * (1 + j) + d);
                    // sin(· + π/2) is the cosine.
                    put(cos, rows, stride, dimension * (1 + self.degree + j) + d);
                    // Exact: by double angles, errors of sines would grow with each octave.
                    x = x + x;
                }
            }
            put(V::splat(T::one()), rows, stride, columns);
        }
    }
}

/// Lanes to one column of as many rows.
#[inline(always)]
fn put<T: Float, V: Lanes<T>>(x: V, rows: &mut [T], stride: usize, column: usize) {
    let mut lanes = [T::zero(); MAX_LANES];
    x.store(&mut lanes);
    for (row, x) in rows.chunks_mut(stride).zip(lanes) {
        row[column] = x;
    }
}

/// Adds to the gradient with respect to coordinates what that with respect to the rows amounts to.
pub fn encode_vjp<T: Float>(
    rows: Matrix<'_, T>,
    cotangents: Matrix<'_, T>,
    scales: &[T],
    part: T,
    degree: usize,
    gradient: &mut CoordinatesMut<'_, T>,
) {
    let dimension = gradient.dimension();
    let columns = gradient.columns().iter_mut().zip(scales).enumerate();
    for (d, (gradient, scale)) in columns {
        let points = rows.numbers.chunks(rows.stride);
        let points = points.zip(cotangents.numbers.chunks(cotangents.stride));
        for (out, (row, cotangent)) in gradient.iter_mut().zip(points) {
            let plain = if d == 0 { part * cotangent[d] } else { cotangent[d] };
            let (mut sum, mut factor) = (plain, T::one());
            for j in 0..degree {
                let sin = dimension * (1 + j) + d;
                let cos = sin + dimension * degree;
                sum += factor * (cotangent[sin] * row[cos] - cotangent[cos] * row[sin]);
                factor += factor;
            }
            *out += *scale * sum;
        }
    }
}
