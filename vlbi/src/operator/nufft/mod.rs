//! The Fourier transform to any (u, v) by way of a fast transform: the image, divided by the
//! transform of a kernel, is transformed on a grid twice as fine, and every visibility is a sum of
//! the cells around it, weighted by the kernel.
//!
//! Images are real, V(−u, −v) is the conjugate of V(u, v): half the columns of the grid suffice.
//!
//! Images and visibilities may be of either precision; between them all is in double precision. A planner of fast
//! transforms compiles every algorithm that it may choose, and one is enough.

mod kernel;

use super::{Float, ImageGrid, Operator, Pulse};
use crate::Error;
use core::f64::consts::TAU;
use core::ops::Range;
use kernel::Kernel;
use kernel::MOST_CELLS;
pub(super) use kernel::{cells, width_of};
use num_complex::Complex;
use rayon::prelude::*;
use rustfft::{Fft, FftPlanner};
use std::sync::Arc;

/// Columns of the grid that a thread works on at a time.
const STRIP: usize = 16;

/// A visibility and the cells that it is a sum of.
struct Site {
    /// First column among those kept, and first row.
    cell: [usize; 2],
    /// Values of the kernel: of columns, of rows.
    weights: [[f64; MOST_CELLS]; 2],
    /// Pixel pulse and the phase of the image's centre.
    factor: Complex<f64>,
    /// True if the visibility is the conjugate of the sum.
    conjugate: bool,
    /// Index among the data.
    datum: usize,
}

/// Fast Fourier transform of the frames of a movie, each to visibilities of its own, with an error
/// of at most `accuracy` × Σ|I| Jy. The adjoint is the transpose of the same map, exactly.
pub struct Nufft {
    grid: ImageGrid,
    kernel: Kernel,
    accuracy: f64,
    /// Rows of the finer grid; columns are kept from −`margin` as far as visibilities reach.
    rows: usize,
    columns: usize,
    margin: usize,
    /// Factors of image columns and rows.
    correction: [Vec<f64>; 2],
    /// Transforms along a row and along a column, there and back.
    along_row: [Arc<dyn Fft<f64>>; 2],
    along_column: [Arc<dyn Fft<f64>>; 2],
    /// Sites in the order of frames and, within, of columns.
    sites: Vec<Site>,
    frames: Vec<Range<usize>>,
}

/// Refuses accuracies that kernels or rounding cannot reach.
pub(super) fn check_accuracy<T: Float>(accuracy: f64) -> Result<(), Error> {
    let single = T::epsilon().double() > 1e-10;
    let least = if single { 1e-6 } else { 1e-13 };
    if (least..=0.1).contains(&accuracy) {
        return Ok(());
    }
    let allowed = "1e-13 to 0.1, in single precision 1e-6 to 0.1";
    Err(Error::out_of_range("accuracy", accuracy, allowed))
}

/// The transforms of `n` numbers: forward and inverse, neither normalised.
fn plans(n: usize) -> [Arc<dyn Fft<f64>>; 2] {
    let mut planner = FftPlanner::new();
    [planner.plan_fft_forward(n), planner.plan_fft_inverse(n)]
}

impl Nufft {
    /// The transform to `frames[k]`, the (u, v) in wavelengths that see frame k; data are in the
    /// order of frames and of their (u, v).
    ///
    /// # Errors
    /// If the accuracy is not in [1e-13, 0.1].
    pub fn new(
        grid: ImageGrid,
        pulse: Pulse,
        frames: &[Vec<[f64; 2]>],
        accuracy: f64,
    ) -> Result<Self, Error> {
        check_accuracy::<f64>(accuracy)?;
        let kernel = Kernel::of_accuracy(accuracy);
        let [across, rows] = [grid.width, grid.height].map(|pixels| cells(pixels, kernel.width));
        let margin = kernel.width / 2 + 1;
        let correction = |pixels: usize, cells: usize| {
            kernel.transform(pixels, cells).into_iter().map(f64::recip).collect()
        };
        let mut operator = Nufft {
            grid,
            kernel,
            accuracy,
            rows,
            columns: 0,
            margin,
            correction: [correction(grid.width, across), correction(grid.height, rows)],
            along_row: plans(across),
            along_column: plans(rows),
            sites: Vec::new(),
            frames: Vec::new(),
        };
        let mut first = 0;
        for uv in frames {
            let site = |(k, uv): (usize, &[f64; 2])| operator.site(pulse, *uv, first + k);
            let mut sites: Vec<Site> = uv.par_iter().enumerate().map(site).collect();
            // Strips find their sites by bisection, and add them in one order.
            sites.sort_by_key(|site| (site.cell, site.datum));
            operator.sites.extend(sites);
            operator.frames.push(first..first + uv.len());
            first += uv.len();
        }
        let last = operator.sites.iter().map(|site| site.cell[0]).max();
        operator.columns = last.unwrap_or(0) + operator.kernel.width;
        Ok(operator)
    }

    /// Bound of the error in units of Σ|I|.
    pub fn accuracy(&self) -> f64 {
        self.accuracy
    }

    /// A column with its first cells repeated at its end.
    fn column_length(&self) -> usize {
        self.rows + self.kernel.width
    }

    fn site(&self, pulse: Pulse, uv: [f64; 2], datum: usize) -> Site {
        let ImageGrid { width, height, pixel_rad } = self.grid;
        let turns = uv.map(|x| x * pixel_rad);
        // Pixels lie whole pixels from the origin of the transform: whole turns a pixel change
        // nothing. The pulse and the phase of that origin, in `factor`, see all of (u, v).
        let whole = turns.map(|x| x - x.round());
        let conjugate = whole[0] < 0.0;
        let sign = if conjugate { -1.0 } else { 1.0 };
        let across = self.along_row[0].len() as f64;
        let mut weights = [[0.0; MOST_CELLS]; 2];
        let mut first = [0.0; 2];
        let places = [sign * whole[0] * across, sign * whole[1] * self.rows as f64];
        for axis in 0..2 {
            let (start, values) = self.kernel.values(places[axis]);
            first[axis] = start;
            weights[axis].iter_mut().zip(values).for_each(|(w, value)| *w = value);
        }
        // Pixel (width/2, height/2) is the origin of the fast transform.
        let offset = [self.grid.east(width / 2) * uv[0], self.grid.north(height / 2) * uv[1]];
        // Less whole turns, which would cost digits of the phase.
        let factor = Complex::from_polar(
            pulse.transform(uv, pixel_rad),
            TAU * (offset[0] - offset[0].round() + offset[1] - offset[1].round()),
        );
        Site {
            // From −margin on, and of rows modulo their number.
            cell: [
                (first[0] + self.margin as f64) as usize,
                (first[1] as i64).rem_euclid(self.rows as i64) as usize,
            ],
            weights,
            factor,
            conjugate,
            datum,
        }
    }

    /// The place along a row of the grid of the image's column `k`.
    fn place(k: usize, pixels: usize, cells: usize) -> usize {
        (k + cells - pixels / 2) % cells
    }

    /// Returns the cell of a transformed row that is column `k` of those kept.
    fn kept(&self, k: usize) -> usize {
        let across = self.along_row[0].len();
        (k + across - self.margin) % across
    }

    /// Rows of an image, corrected and transformed: the columns that are kept, row after row.
    fn transform_rows<T: Float>(&self, image: &[T]) -> Vec<Complex<f64>> {
        let zero = Complex::new(0.0, 0.0);
        // Columns run west and rows south: e^{+2πi(ul + vm)} is the forward transform.
        let (width, fft) = (self.grid.width, &self.along_row[0]);
        let mut result = vec![zero; self.columns * self.grid.height];
        result
            .par_chunks_mut(self.columns)
            .zip(image.par_chunks(width))
            .zip(&self.correction[1])
            .for_each_init(
                || (vec![zero; fft.len()], vec![zero; fft.get_inplace_scratch_len()]),
                |(row, scratch), ((result, image), of_row)| {
                    row.fill(zero);
                    for (k, (pixel, of_column)) in image.iter().zip(&self.correction[0]).enumerate()
                    {
                        row[Self::place(k, width, fft.len())].re =
                            pixel.double() * *of_column * *of_row;
                    }
                    fft.process_with_scratch(row, scratch);
                    for (k, cell) in result.iter_mut().enumerate() {
                        *cell = row[self.kept(k)];
                    }
                },
            );
        result
    }

    /// The transpose: adds to the image.
    fn transform_rows_back<T: Float>(&self, rows: &[Complex<f64>], image: &mut [T]) {
        let zero = Complex::new(0.0, 0.0);
        let (width, fft) = (self.grid.width, &self.along_row[1]);
        image
            .par_chunks_mut(width)
            .zip(rows.par_chunks(self.columns))
            .zip(&self.correction[1])
            .for_each_init(
                || (vec![zero; fft.len()], vec![zero; fft.get_inplace_scratch_len()]),
                |(row, scratch), ((image, cells), of_row)| {
                    row.fill(zero);
                    for (k, cell) in cells.iter().enumerate() {
                        row[self.kept(k)] += *cell;
                    }
                    fft.process_with_scratch(row, scratch);
                    for (k, (pixel, of_column)) in
                        image.iter_mut().zip(&self.correction[0]).enumerate()
                    {
                        // Images are real: the transpose of their transform keeps the real part.
                        let light = row[Self::place(k, width, fft.len())].re * *of_column * *of_row;
                        *pixel += T::of(light);
                    }
                },
            );
    }

    /// Columns of the finer grid, one after the other, from the rows' transforms.
    fn transform_columns(&self, rows: &[Complex<f64>]) -> Vec<Complex<f64>> {
        let zero = Complex::new(0.0, 0.0);
        let (height, fft, length) = (self.grid.height, &self.along_column[0], self.column_length());
        let mut result = vec![zero; self.columns * length];
        result.par_chunks_mut(STRIP * length).enumerate().for_each_init(
            || vec![zero; fft.get_inplace_scratch_len()],
            |scratch, (strip, columns)| {
                for row in 0..height {
                    let place = Self::place(row, height, self.rows);
                    let cells = &rows[row * self.columns + strip * STRIP..];
                    for (column, cell) in columns.chunks_exact_mut(length).zip(cells) {
                        column[place] = *cell;
                    }
                }
                for column in columns.chunks_exact_mut(length) {
                    fft.process_with_scratch(&mut column[..self.rows], scratch);
                    // Kernels that reach over the end then read cells that follow each other.
                    column.copy_within(..length - self.rows, self.rows);
                }
            },
        );
        result
    }

    /// The transpose; columns are used up.
    fn transform_columns_back(&self, columns: &mut [Complex<f64>]) -> Vec<Complex<f64>> {
        let zero = Complex::new(0.0, 0.0);
        let (height, fft, length) = (self.grid.height, &self.along_column[1], self.column_length());
        columns.par_chunks_mut(length).for_each_init(
            || vec![zero; fft.get_inplace_scratch_len()],
            |scratch, column| {
                for k in self.rows..length {
                    let end = column[k];
                    column[k - self.rows] += end;
                }
                fft.process_with_scratch(&mut column[..self.rows], scratch);
            },
        );
        let mut rows = vec![zero; self.columns * height];
        rows.par_chunks_mut(self.columns).enumerate().for_each(|(row, cells)| {
            let place = Self::place(row, height, self.rows);
            for (k, cell) in cells.iter_mut().enumerate() {
                *cell = columns[k * length + place];
            }
        });
        rows
    }

    /// The sum of the cells around a visibility.
    fn gather(&self, site: &Site, columns: &[Complex<f64>]) -> Complex<f64> {
        let (width, length) = (self.kernel.width, self.column_length());
        let mut total = Complex::new(0.0, 0.0);
        for (k, across) in site.weights[0][..width].iter().enumerate() {
            let start = (site.cell[0] + k) * length + site.cell[1];
            let mut sum = Complex::new(0.0, 0.0);
            for (cell, weight) in columns[start..start + width].iter().zip(&site.weights[1]) {
                sum += cell.scale(*weight);
            }
            total += sum.scale(*across);
        }
        site.factor * if site.conjugate { total.conj() } else { total }
    }

    /// The transpose: every strip of columns takes what the visibilities around it give, in order.
    fn spread<T: Float>(&self, sites: &[Site], data: &[Complex<T>]) -> Vec<Complex<f64>> {
        let (width, length) = (self.kernel.width, self.column_length());
        let mut columns = vec![Complex::new(0.0, 0.0); self.columns * length];
        columns.par_chunks_mut(STRIP * length).enumerate().for_each(|(strip, cells)| {
            let start = strip * STRIP;
            // A site reaches width − 1 columns beyond its first one, perhaps from the strip before.
            let near = |column: usize| sites.partition_point(|site| site.cell[0] < column);
            let sites = &sites[near((start + 1).saturating_sub(width))..near(start + STRIP)];
            for site in sites {
                let datum = data[site.datum];
                let value = site.factor.conj() * Complex::new(datum.re.double(), datum.im.double());
                let value = if site.conjugate { value.conj() } else { value };
                for (k, across) in site.weights[0][..width].iter().enumerate() {
                    let Some(column) = (site.cell[0] + k).checked_sub(start) else { continue };
                    let first = column * length + site.cell[1];
                    let Some(cells) = cells.get_mut(first..first + width) else { break };
                    let value = value.scale(*across);
                    for (cell, weight) in cells.iter_mut().zip(&site.weights[1]) {
                        *cell += value.scale(*weight);
                    }
                }
            }
        });
        columns
    }
}

impl<T: Float> Operator<T> for Nufft {
    fn frames(&self) -> usize {
        self.frames.len()
    }

    fn pixels(&self) -> usize {
        self.grid.pixels()
    }

    fn data(&self) -> usize {
        self.sites.len()
    }

    fn forward(&self, movie: &[T], data: &mut [Complex<T>]) {
        assert_eq!(
            (movie.len(), data.len()),
            (self.frames.len() * self.grid.pixels(), self.sites.len())
        );
        // Frame after frame, each on all threads: one grid is all the memory that is needed.
        for (image, sites) in movie.chunks_exact(self.grid.pixels()).zip(&self.frames) {
            if sites.is_empty() {
                continue;
            }
            let sites = &self.sites[sites.clone()];
            let columns = self.transform_columns(&self.transform_rows(image));
            let sums: Vec<Complex<f64>> =
                sites.par_iter().map(|site| self.gather(site, &columns)).collect();
            sites.iter().zip(sums).for_each(|(site, sum)| {
                data[site.datum] = Complex::new(T::of(sum.re), T::of(sum.im));
            });
        }
    }

    fn adjoint(&self, data: &[Complex<T>], movie: &mut [T]) {
        assert_eq!(
            (movie.len(), data.len()),
            (self.frames.len() * self.grid.pixels(), self.sites.len())
        );
        for (image, sites) in movie.chunks_exact_mut(self.grid.pixels()).zip(&self.frames) {
            if sites.is_empty() {
                continue;
            }
            let mut columns = self.spread(&self.sites[sites.clone()], data);
            self.transform_rows_back(&self.transform_columns_back(&mut columns), image);
        }
    }
}

#[cfg(test)]
mod tests;
