//! The three matrix products of a fully connected layer, on a tile of points.
//!
//! Points lie row by row, so that no activation is ever packed: a block of `ROWS` × 2 registers of
//! sums runs over the common index, with one operand broadcast and the other loaded from a panel two
//! registers wide; `ROWS` is 6 where there are 16 registers and 12 where there are 32. ReLU, its derivative and the biases are part of loading and storing a block.

use kerrlight_common::simd::{Float, Lanes, Task};

/// Numbers row by row with a distance between rows.
#[derive(Clone, Copy)]
pub struct Matrix<'a, T> {
    pub numbers: &'a [T],
    pub stride: usize,
}

/// The same to write to.
pub struct MatrixMut<'a, T> {
    pub numbers: &'a mut [T],
    pub stride: usize,
}

/// Sums of a block: Σₖ a(m, k) b(k, n) on top of `start`; n runs over two registers.
///
/// # Safety
/// a + m·rows + k·columns is readable for m < ROWS, k < count, and b + k·step for two registers.
#[inline(always)]
unsafe fn block<T: Float, V: Lanes<T>, const ROWS: usize>(
    start: [V; 2],
    count: usize,
    a: *const T,
    rows: usize,
    columns: usize,
    b: *const T,
    step: usize,
) -> [[V; 2]; ROWS] {
    let mut sums = [start; ROWS];
    let mut at = (a, b);
    for _ in 0..count {
        // SAFETY: within what the caller vouches for; the last step may point one row past it, which
        // `wrapping_add` allows.
        unsafe {
            let (left, right) = (V::read(at.1), V::read(at.1.add(V::LANES)));
            for (m, sum) in sums.iter_mut().enumerate() {
                let x = V::splat(*at.0.add(m * rows));
                sum[0] = x.mul_add(left, sum[0]);
                sum[1] = x.mul_add(right, sum[1]);
            }
        }
        at = (at.0.wrapping_add(columns), at.1.wrapping_add(step));
    }
    sums
}

/// output = max(0, input · kernel + bias), `points` rows of it (and up to the next whole block).
pub struct Forward<'a, T> {
    pub points: usize,
    pub input: Matrix<'a, T>,
    pub inputs: usize,
    /// Panels from [`pack_kernel`]: `inputs` rows and the bias.
    pub panels: &'a [T],
    pub outputs: usize,
    pub output: MatrixMut<'a, T>,
}

impl<T: Float> Task<T> for Forward<'_, T> {
    type Output = ();
    #[inline(always)]
    fn run<V: Lanes<T>>(self) {
        // 6 × 2 sums, two registers of the panel and one input take 15 of 16 registers; 12 rows
        // take 27 of 32.
        if const { V::REGISTERS < 32 } { self.by_rows::<V, 6>() } else { self.by_rows::<V, 12>() }
    }
}

impl<T: Float> Forward<'_, T> {
    #[inline(always)]
    fn by_rows<V: Lanes<T>, const ROWS: usize>(self) {
        let width = 2 * V::LANES;
        // Rows behind the last point are computed from what is there, and nobody reads them.
        let (rows, panels) = (self.points.next_multiple_of(ROWS), self.outputs.div_ceil(width));
        let panel = (self.inputs + 1) * width;
        assert!(
            self.inputs <= self.input.stride
                && rows * self.input.stride <= self.input.numbers.len()
        );
        assert!(panels * width <= self.output.stride);
        assert!(rows * self.output.stride <= self.output.numbers.len());
        assert!(panels * panel <= self.panels.len());
        let zero = V::splat(T::zero());
        for p in 0..panels {
            for row in (0..rows).step_by(ROWS) {
                // SAFETY: all indices were checked above.
                unsafe {
                    let from = self.panels.as_ptr().add(p * panel);
                    let bias = from.add(self.inputs * width);
                    let start = [V::read(bias), V::read(bias.add(V::LANES))];
                    let input = self.input.numbers.as_ptr().add(row * self.input.stride);
                    let sums = block::<T, V, ROWS>(
                        start,
                        self.inputs,
                        input,
                        self.input.stride,
                        1,
                        from,
                        width,
                    );
                    for (m, sum) in sums.into_iter().enumerate() {
                        let at = (row + m) * self.output.stride + p * width;
                        let to = self.output.numbers.as_mut_ptr().add(at);
                        // In this order a NaN stays one.
                        zero.max(sum[0]).write(to);
                        zero.max(sum[1]).write(to.add(V::LANES));
                    }
                }
            }
        }
    }
}

/// output = cotangent · kernelᵀ, times the derivative of the ReLU that made `activations`; or
/// output += cotangent · kernelᵀ without them.
pub struct Backward<'a, T> {
    pub points: usize,
    pub cotangent: Matrix<'a, T>,
    pub units: usize,
    /// Panels from [`pack_transposed`]: `units` rows.
    pub panels: &'a [T],
    pub activations: Option<Matrix<'a, T>>,
    pub outputs: usize,
    pub output: MatrixMut<'a, T>,
}

impl<T: Float> Task<T> for Backward<'_, T> {
    type Output = ();
    #[inline(always)]
    fn run<V: Lanes<T>>(self) {
        if const { V::REGISTERS < 32 } { self.by_rows::<V, 6>() } else { self.by_rows::<V, 12>() }
    }
}

impl<T: Float> Backward<'_, T> {
    #[inline(always)]
    fn by_rows<V: Lanes<T>, const ROWS: usize>(self) {
        let width = 2 * V::LANES;
        let (rows, panels) = (self.points.next_multiple_of(ROWS), self.outputs.div_ceil(width));
        let panel = self.units * width;
        assert!(self.units <= self.cotangent.stride);
        assert!(rows * self.cotangent.stride <= self.cotangent.numbers.len());
        assert!(panels * width <= self.output.stride);
        assert!(rows * self.output.stride <= self.output.numbers.len());
        assert!(panels * panel <= self.panels.len());
        if let Some(activations) = self.activations {
            assert!(panels * width <= activations.stride);
            assert!(rows * activations.stride <= activations.numbers.len());
        }
        let zero = V::splat(T::zero());
        for p in 0..panels {
            for row in (0..rows).step_by(ROWS) {
                // SAFETY: all indices were checked above.
                unsafe {
                    let from = self.panels.as_ptr().add(p * panel);
                    let input = self.cotangent.numbers.as_ptr().add(row * self.cotangent.stride);
                    let sums = block::<T, V, ROWS>(
                        [zero; 2],
                        self.units,
                        input,
                        self.cotangent.stride,
                        1,
                        from,
                        width,
                    );
                    for (m, sum) in sums.into_iter().enumerate() {
                        let at = (row + m) * self.output.stride + p * width;
                        let to = self.output.numbers.as_mut_ptr().add(at);
                        let h = self
                            .activations
                            .map(|h| h.numbers.as_ptr().add((row + m) * h.stride + p * width));
                        pass(sum[0], h, to);
                        pass(sum[1], h.map(|h| h.add(V::LANES)), to.add(V::LANES));
                    }
                }
            }
        }
    }
}

/// Puts `sum` where the activations at `h` are positive and zero elsewhere; or adds it to what is there.
///
/// # Safety
/// `h` is readable and `to` readable and writable for a register.
#[inline(always)]
unsafe fn pass<T: Float, V: Lanes<T>>(sum: V, h: Option<*const T>, to: *mut T) {
    let zero = V::splat(T::zero());
    // SAFETY: as the caller vouches.
    unsafe {
        match h {
            Some(h) => V::select(zero.lt(V::read(h)), sum, zero).write(to),
            None => (V::read(to) + sum).write(to),
        }
    }
}

/// gradient += inputᵀ · cotangent over the points (or = with `overwrite`), of a kernel and its biases.
pub struct Weights<'a, T> {
    pub points: usize,
    /// Inputs, with the one behind the last.
    pub input: Matrix<'a, T>,
    pub inputs: usize,
    pub cotangent: Matrix<'a, T>,
    pub outputs: usize,
    /// Row by row as parameters lie.
    pub gradient: &'a mut [T],
    pub overwrite: bool,
}

impl<T: Float> Task<T> for Weights<'_, T> {
    type Output = ();
    #[inline(always)]
    fn run<V: Lanes<T>>(self) {
        if const { V::REGISTERS < 32 } { self.by_rows::<V, 6>() } else { self.by_rows::<V, 12>() }
    }
}

impl<T: Float> Weights<'_, T> {
    #[inline(always)]
    fn by_rows<V: Lanes<T>, const ROWS: usize>(self) {
        let width = 2 * V::LANES;
        // Biases are the weights of one more input, a one; sums of a block behind it are dropped.
        let (rows, panels) = (self.inputs + 1, self.outputs.div_ceil(width));
        assert!(rows.next_multiple_of(ROWS) <= self.input.stride);
        assert!(self.points * self.input.stride <= self.input.numbers.len());
        assert!(panels * width <= self.cotangent.stride);
        assert!(self.points * self.cotangent.stride <= self.cotangent.numbers.len());
        assert!(rows * self.outputs <= self.gradient.len());
        for p in 0..panels {
            let columns = (self.outputs - p * width).min(width);
            for row in (0..rows).step_by(ROWS) {
                // SAFETY: all indices were checked above.
                let sums = unsafe {
                    block::<T, V, ROWS>(
                        [V::splat(T::zero()); 2],
                        self.points,
                        self.input.numbers.as_ptr().add(row),
                        1,
                        self.input.stride,
                        self.cotangent.numbers.as_ptr().add(p * width),
                        self.cotangent.stride,
                    )
                };
                for (m, sum) in sums.into_iter().enumerate().take(rows - row) {
                    let start = (row + m) * self.outputs + p * width;
                    let to = &mut self.gradient[start..start + columns];
                    put(sum, to, self.overwrite);
                }
            }
        }
    }
}

/// Adds two registers to what is there, or puts them there.
#[inline(always)]
fn put<T: Float, V: Lanes<T>>(sum: [V; 2], to: &mut [T], overwrite: bool) {
    let (left, right) = to.split_at_mut(V::LANES.min(to.len()));
    for (sum, to) in sum.into_iter().zip([left, right]) {
        let sum = if overwrite { sum } else { V::load_or(to, T::zero()) + sum };
        sum.store(to);
    }
}

/// Numbers of the panels of a kernel with its bias.
pub fn packed_kernel(inputs: usize, outputs: usize, width: usize) -> usize {
    outputs.div_ceil(width) * width * (inputs + 1)
}

/// A kernel and its bias (`inputs + 1` rows) as panels of `width` columns, the last one padded with
/// zeros.
pub fn pack_kernel<T: Float>(rows: &[T], outputs: usize, width: usize, panels: &mut [T]) {
    let inputs = rows.len() / outputs;
    for (p, panel) in panels.chunks_mut(inputs * width).enumerate() {
        let columns = (outputs - p * width).min(width);
        for (to, from) in panel.chunks_mut(width).zip(rows.chunks(outputs)) {
            to[..columns].copy_from_slice(&from[p * width..p * width + columns]);
            to[columns..].fill(T::zero());
        }
    }
}

/// Rows `kernel` (one an input) of a kernel, transposed, as panels of `width` columns.
pub fn pack_transposed<T: Float>(kernel: &[T], outputs: usize, width: usize, panels: &mut [T]) {
    panels.fill(T::zero());
    for (p, panel) in panels.chunks_mut(outputs * width).enumerate() {
        let rows = kernel.chunks(outputs).skip(p * width).take(width);
        for (column, row) in rows.enumerate() {
            for (to, x) in panel[column..].iter_mut().step_by(width).zip(row) {
                *to = *x;
            }
        }
    }
}

#[cfg(test)]
mod tests;
