//! The direct Fourier transform to any (u, v):
//! V(u, v) = p(u, v) Σ I(l, m) exp(2πi(u l + v m)), p the transform of a pixel.
//!
//! Direct Fourier transforms. On a grid the exponential is a product of one of the column and one
//! of the row, so that a block of n visibilities is a matrix product, A = I·X with X(column, k) = p
//! exp(2πi u_k l), and a sum over rows, V_k = Σ exp(2πi v_k m) A(row, k): as exact as the sum over
//! pixels, and what is kept are 2(w + h) numbers a visibility instead of 2wh.

use super::{Float, ImageGrid, Operator, Pulse};
use core::f64::consts::TAU;
use core::ops::Range;
use kerrlight_common::matrix::{Shape, multiply};
use kerrlight_geodesic::interrupt;
use num_complex::Complex;
use rayon::prelude::*;

/// Most visibilities of a block: bounds what a thread needs to (w + 2h) × this many numbers.
const BLOCK: usize = 256;
/// Rows of an image that the adjoint computes at a time, whatever the number of threads.
const STRIP: usize = 64;

/// Exponentials of a block of n visibilities.
struct Factors<T> {
    /// w × 2n: the real parts of X, then the imaginary ones, of each column.
    east: Vec<T>,
    /// h × n real parts, then h × n imaginary ones.
    north: Vec<T>,
}

/// A block of visibilities of one frame.
struct Block<T> {
    uv: Vec<[f64; 2]>,
    /// Range among the data.
    data: Range<usize>,
    factors: Option<Factors<T>>,
}

/// Direct Fourier transform of the frames of a movie, each to visibilities of its own.
pub struct Dtft<T> {
    grid: ImageGrid,
    pulse: Pulse,
    blocks: Vec<Block<T>>,
    /// The blocks of each frame.
    frames: Vec<Range<usize>>,
    data: usize,
}

impl<T: Float> Dtft<T> {
    /// The transform to `frames[k]`, the (u, v) in wavelengths that see frame k; data are in the
    /// order of frames and of their (u, v). Exponentials are kept if they fit into
    /// `memory_budget` bytes, otherwise computed each time, with the same result.
    pub fn new(
        grid: ImageGrid,
        pulse: Pulse,
        frames: &[Vec<[f64; 2]>],
        memory_budget: usize,
    ) -> Self {
        let mut operator = Dtft { grid, pulse, blocks: Vec::new(), frames: Vec::new(), data: 0 };
        for uv in frames {
            let first = operator.blocks.len();
            for part in uv.chunks(BLOCK) {
                let data = operator.data..operator.data + part.len();
                operator.data = data.end;
                operator.blocks.push(Block { uv: part.to_vec(), data, factors: None });
            }
            operator.frames.push(first..operator.blocks.len());
        }
        if operator.memory_wanted() <= memory_budget {
            let factors: Vec<Factors<T>> =
                operator.blocks.par_iter().map(|block| operator.factors(&block.uv)).collect();
            for (block, factors) in operator.blocks.iter_mut().zip(factors) {
                block.factors = Some(factors);
            }
        }
        operator
    }

    /// Returns the grid of pixels, their shape, and the (u, v) of all data.
    pub fn baselines(&self) -> (ImageGrid, Pulse, Vec<[f64; 2]>) {
        let uv = self.blocks.iter().flat_map(|block| block.uv.iter().copied()).collect();
        (self.grid, self.pulse, uv)
    }

    /// Bytes that all exponentials take.
    pub fn memory_wanted(&self) -> usize {
        2 * (self.grid.width + self.grid.height) * self.data * size_of::<T>()
    }

    /// Bytes that are kept.
    pub fn memory_kept(&self) -> usize {
        let kept = |block: &Block<T>| {
            block.factors.as_ref().map_or(0, |f| (f.east.len() + f.north.len()) * size_of::<T>())
        };
        self.blocks.iter().map(kept).sum()
    }

    fn factors(&self, uv: &[[f64; 2]]) -> Factors<T> {
        let ImageGrid { width, height, pixel_rad } = self.grid;
        let n = uv.len();
        let mut east = vec![T::zero(); 2 * n * width];
        let mut north = vec![T::zero(); 2 * n * height];
        for (k, &[u, v]) in uv.iter().enumerate() {
            let pulse = self.pulse.transform([u, v], pixel_rad);
            for column in 0..width {
                // Double precision for every T: in single, phases of many turns lose digits.
                let (sin, cos) = (TAU * u * self.grid.east(column)).sin_cos();
                east[column * 2 * n + k] = T::of(pulse * cos);
                east[column * 2 * n + n + k] = T::of(pulse * sin);
            }
            for row in 0..height {
                let (sin, cos) = (TAU * v * self.grid.north(row)).sin_cos();
                north[row * n + k] = T::of(cos);
                north[(height + row) * n + k] = T::of(sin);
            }
        }
        Factors { east, north }
    }

    /// Calls `f` with a block's exponentials.
    fn with_factors<R>(&self, block: &Block<T>, f: impl FnOnce(&Factors<T>) -> R) -> R {
        match &block.factors {
            Some(factors) => f(factors),
            None => f(&self.factors(&block.uv)),
        }
    }

    fn forward_block(
        &self,
        factors: &Factors<T>,
        image: &[T],
        data: &mut [Complex<T>],
        a: &mut Vec<T>,
    ) {
        let (ImageGrid { width, height, .. }, n) = (self.grid, data.len());
        a.resize(2 * n * height, T::zero());
        let (of_image, of_east) = (Shape::by_rows(height, width), Shape::by_rows(width, 2 * n));
        multiply(image, of_image, &factors.east, of_east, a, false);
        data.fill(Complex::new(T::zero(), T::zero()));
        let (cos, sin) = factors.north.split_at(height * n);
        for ((a, cos), sin) in
            a.chunks_exact(2 * n).zip(cos.chunks_exact(n)).zip(sin.chunks_exact(n))
        {
            let (re, im) = a.split_at(n);
            for (k, datum) in data.iter_mut().enumerate() {
                datum.re += cos[k] * re[k] - sin[k] * im[k];
                datum.im += cos[k] * im[k] + sin[k] * re[k];
            }
        }
    }

    /// Adds to rows `rows` of an image what a block's data give.
    fn adjoint_block(
        &self,
        factors: &Factors<T>,
        data: &[Complex<T>],
        rows: Range<usize>,
        strip: &mut [T],
        z: &mut Vec<T>,
    ) {
        let (ImageGrid { width, height, .. }, n) = (self.grid, data.len());
        z.resize(2 * n * rows.len(), T::zero());
        let (cos, sin) = factors.north.split_at(height * n);
        for (z, row) in z.chunks_exact_mut(2 * n).zip(rows.clone()) {
            let (re, im) = z.split_at_mut(n);
            let (cos, sin) = (&cos[row * n..][..n], &sin[row * n..][..n]);
            for (k, datum) in data.iter().enumerate() {
                re[k] = cos[k] * datum.re + sin[k] * datum.im;
                im[k] = cos[k] * datum.im - sin[k] * datum.re;
            }
        }
        let of_east = Shape::by_rows(width, 2 * n).transposed();
        let z = &z[..2 * n * rows.len()];
        multiply(z, Shape::by_rows(rows.len(), 2 * n), &factors.east, of_east, strip, true);
    }
}

/// A slice cut into consecutive pieces.
fn cut<D>(mut rest: &mut [D], lengths: impl Iterator<Item = usize>) -> Vec<&mut [D]> {
    let mut pieces = Vec::new();
    for length in lengths {
        let (piece, after) = rest.split_at_mut(length);
        pieces.push(piece);
        rest = after;
    }
    pieces
}

impl<T: Float> Operator<T> for Dtft<T> {
    fn frames(&self) -> usize {
        self.frames.len()
    }

    fn pixels(&self) -> usize {
        self.grid.pixels()
    }

    fn data(&self) -> usize {
        self.data
    }

    fn forward(&self, movie: &[T], data: &mut [Complex<T>]) {
        assert_eq!((movie.len(), data.len()), (self.frames.len() * self.pixels(), self.data));
        let pieces = cut(data, self.blocks.iter().map(|block| block.data.len()));
        let frame_of = self.frames.iter().enumerate().flat_map(|(k, r)| r.clone().map(move |_| k));
        let images: Vec<&[T]> =
            frame_of.map(|k| &movie[k * self.pixels()..][..self.pixels()]).collect();
        self.blocks.par_iter().zip(pieces).zip(images).for_each_init(
            Vec::new,
            |a, ((block, data), image)| {
                interrupt::check();
                self.with_factors(block, |factors| self.forward_block(factors, image, data, a));
            },
        );
    }

    fn adjoint(&self, data: &[Complex<T>], movie: &mut [T]) {
        assert_eq!((movie.len(), data.len()), (self.frames.len() * self.pixels(), self.data));
        let ImageGrid { width, height, .. } = self.grid;
        // Exponentials that are not kept would be computed again for every strip.
        let kept = self.blocks.iter().all(|block| block.factors.is_some());
        let rows = if kept && height > 0 { STRIP } else { height };
        movie.par_chunks_mut(self.pixels()).zip(&self.frames).for_each(|(image, blocks)| {
            image.par_chunks_mut(rows * width).enumerate().for_each_init(
                Vec::new,
                |z, (k, strip)| {
                    let rows = k * rows..k * rows + strip.len() / width;
                    // Block after block in each strip: sums do not depend on the number of threads.
                    for block in &self.blocks[blocks.clone()] {
                        interrupt::check();
                        let data = &data[block.data.clone()];
                        self.with_factors(block, |factors| {
                            self.adjoint_block(factors, data, rows.clone(), strip, z);
                        });
                    }
                },
            );
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::conformance;
    use rand::{Rng, RngExt, SeedableRng};
    use rand_pcg::Pcg64Mcg;

    const GRID: ImageGrid = ImageGrid { width: 13, height: 80, pixel_rad: 1e-11 };

    /// (u, v) of three frames, the second without any, the third of two blocks.
    fn frames(random: &mut impl Rng) -> Vec<Vec<[f64; 2]>> {
        let mut uv = |n: usize| -> Vec<[f64; 2]> {
            (0..n).map(|_| [0, 1].map(|_| random.random_range(-1e10..1e10))).collect()
        };
        vec![uv(17), Vec::new(), uv(300)]
    }

    fn random_numbers<T: Float>(random: &mut impl Rng, count: usize) -> Vec<T> {
        (0..count).map(|_| T::of(random.random_range(-1.0..1.0))).collect()
    }

    /// The definition, pixel by pixel.
    fn sum(image: &[f64], [u, v]: [f64; 2], pulse: Pulse) -> Complex<f64> {
        let mut total = Complex::new(0.0, 0.0);
        for row in 0..GRID.height {
            for column in 0..GRID.width {
                let phase = TAU * (u * GRID.east(column) + v * GRID.north(row));
                total += Complex::from_polar(image[row * GRID.width + column], phase);
            }
        }
        total * pulse.transform([u, v], GRID.pixel_rad)
    }

    #[test]
    fn exact_forward_is_the_sum_over_pixels() {
        let mut random = Pcg64Mcg::seed_from_u64(1);
        let frames = frames(&mut random);
        let movie = random_numbers::<f64>(&mut random, 3 * GRID.pixels());
        for pulse in [Pulse::Delta, Pulse::Rectangle, Pulse::Triangle] {
            let operator = Dtft::<f64>::new(GRID, pulse, &frames, usize::MAX);
            let mut data = vec![Complex::new(7.0, 7.0); operator.data()];
            operator.forward(&movie, &mut data);
            let images = movie.chunks_exact(GRID.pixels());
            let expected = frames
                .iter()
                .zip(images)
                .flat_map(|(uv, image)| uv.iter().map(move |uv| sum(image, *uv, pulse)));
            for (found, expected) in data.iter().zip(expected) {
                assert!((found - expected).norm() < 1e-12, "{found} {expected}");
            }
        }
    }

    fn conforms<T: Float>(tolerance: f64) {
        let frames = frames(&mut Pcg64Mcg::seed_from_u64(2));
        for (name, budget) in [("prepared transform", usize::MAX), ("transform on the fly", 0)] {
            let transform = Dtft::<T>::new(GRID, Pulse::Triangle, &frames, budget);
            conformance::operator(name, &transform, tolerance);
        }
    }

    #[test]
    fn exact_adjoints_and_differences_in_both_precisions() {
        conforms::<f64>(1e-14);
        conforms::<f32>(1e-6);
    }

    #[test]
    fn exact_budget_changes_memory_and_nothing_else() {
        let mut random = Pcg64Mcg::seed_from_u64(3);
        let frames = frames(&mut random);
        let kept = Dtft::<f64>::new(GRID, Pulse::Triangle, &frames, usize::MAX);
        let fly = Dtft::<f64>::new(GRID, Pulse::Triangle, &frames, kept.memory_wanted() - 1);
        assert_eq!((kept.memory_kept(), fly.memory_kept()), (kept.memory_wanted(), 0));
        let movie = random_numbers::<f64>(&mut random, 3 * GRID.pixels());
        let run = |operator: &Dtft<f64>| {
            let mut data = vec![Complex::new(0.0, 0.0); operator.data()];
            operator.forward(&movie, &mut data);
            data
        };
        assert_eq!(run(&kept), run(&fly));
    }

    /// A point in the north-east: its phase grows with u and v. A pixel's flux is V at the origin.
    #[test]
    fn exact_signs_and_flux() {
        let grid = ImageGrid { width: 4, height: 4, pixel_rad: 1e-11 };
        let mut image = vec![0.0; 16];
        image[0] = 2.5;
        let uv = vec![vec![[0.0, 0.0], [1e9, 0.0], [0.0, 1e9]]];
        let operator = Dtft::<f64>::new(grid, Pulse::Delta, &uv, 0);
        let mut data = vec![Complex::new(0.0, 0.0); 3];
        operator.forward(&image, &mut data);
        assert_eq!(data[0], Complex::new(2.5, 0.0));
        for datum in &data[1..] {
            let expected = Complex::from_polar(2.5, TAU * 1e9 * 1.5e-11);
            assert!((datum - expected).norm() < 1e-14, "{datum}");
        }
    }
}
