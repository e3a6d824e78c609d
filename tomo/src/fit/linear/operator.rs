//! Operator from values at some nodes of the grid to pixels, as a sparse matrix, and back.

use super::active::{Active, NONE};
use super::data::Data;
use super::ray_weights::{Buffers, Place, Walk};
use super::rows::{Held, Rows};
use crate::representation::spline::STENCIL;
use core::ops::Range;
use kerrlight_common::memory;
use kerrlight_common::simd::Float;
use rayon::prelude::*;
use std::sync::{Mutex, PoisonError};

/// Pieces that frames are cut into, whatever the number of threads: each adds up its own gradient.
const PIECES: usize = 16;
/// Share of the memory for slopes that are kept to be subtracted.
const SLOPES: f64 = 1.0 / 16.0;

/// The movie as a function of the values at the nodes that count. Rows of the first frames are made, as many as fit into a
/// budget, and kept, as many as there is memory for; all other frames are walked through.
pub(super) struct Operator<'a, T> {
    pub walk: Walk<'a, T>,
    pub active: Active,
    pub corners: Vec<usize>,
    pub frames: &'a [usize],
    pub pixels: usize,
    pub rows: Vec<Held<T>>,
}

/// Memory of a thread.
struct Scratch<T> {
    buffers: Buffers<T>,
    image: Vec<T>,
    slopes: Vec<T>,
}

impl<'a, T: Float> Operator<'a, T> {
    fn image(&self, k: usize, x: &[T], scratch: &mut Scratch<T>) {
        self.carried(k, x, scratch);
        if let Some(quiescent) = &self.walk.model.quiescent {
            quiescent.add(x, &mut scratch.image);
        }
    }

    /// The image of what matter carries.
    fn carried(&self, k: usize, x: &[T], scratch: &mut Scratch<T>) {
        let Scratch { buffers, image, .. } = scratch;
        image.fill(T::zero());
        match &self.rows[k] {
            Held::Kept(rows) => return rows.forward(x, image),
            Held::Made => {
                let frame = self.frames[k];
                return self.each_row(frame, buffers, |row| row.forward(x, image));
            }
            Held::Walked => {}
        }
        self.walk.frame(self.frames[k], Some(&self.active.cells), buffers, |pixel, places| {
            let mut sum = T::zero();
            self.entries(places, |column, entry| sum += entry * x[column as usize]);
            image[pixel as usize] += sum;
        });
    }

    fn back(&self, k: usize, scratch: &mut Scratch<T>, sums: &mut [T]) {
        let Scratch { buffers, slopes, .. } = scratch;
        match &self.rows[k] {
            Held::Kept(rows) => return rows.adjoint(slopes, sums),
            Held::Made => {
                let frame = self.frames[k];
                return self.each_row(frame, buffers, |row| row.adjoint(slopes, sums));
            }
            Held::Walked => {}
        }
        self.walk.frame(self.frames[k], Some(&self.active.cells), buffers, |pixel, places| {
            let slope = slopes[pixel as usize];
            if slope != T::zero() {
                self.entries(places, |column, entry| sums[column as usize] += entry * slope);
            }
        });
    }

    /// Hands over what nodes of a ray take from the columns about them, node after node.
    #[inline(always)]
    pub fn entries(&self, places: &[Place<T>], mut take: impl FnMut(u32, T)) {
        let (mut weights, degree) = ([T::zero(); STENCIL], self.walk.voxels.degree);
        for at in places {
            degree.products(at.within, at.weight, &mut weights);
            for (corner, entry) in self.corners.iter().zip(weights) {
                let column = self.active.column[at.corner as usize + corner];
                if column != NONE {
                    take(column, entry);
                }
            }
        }
    }

    /// The same for all nodes of the grid.
    fn back_to_all(&self, k: usize, scratch: &mut Scratch<T>, sums: &mut [T]) {
        let (Scratch { buffers, slopes, .. }, degree) = (scratch, self.walk.voxels.degree);
        let mut weights = [T::zero(); STENCIL];
        self.walk.frame(self.frames[k], None, buffers, |pixel, places| {
            let slope = slopes[pixel as usize];
            for at in places.iter().filter(|_| slope != T::zero()) {
                degree.products(at.within, at.weight, &mut weights);
                for (corner, entry) in self.corners.iter().zip(weights) {
                    sums[at.corner as usize + corner] += entry * slope;
                }
            }
        });
    }

    /// Images of `x`, what `link` (k-th frame, image, slopes) makes of them, and the sum over frames of what
    /// that takes from the nodes. Frames are cut into pieces that do not depend on the number of threads, and
    /// added up in their order.
    fn through(
        &self,
        x: &[T],
        all: bool,
        link: impl Fn(usize, &[T], &mut [T]) -> f64 + Sync,
    ) -> (f64, Vec<f64>) {
        let count = if all { self.active.column.len() } else { self.active.count() };
        let piece = self.frames.len().div_ceil(PIECES);
        let indices: Vec<usize> = (0..self.frames.len()).collect();
        let of_piece = |scratch: &mut Scratch<T>, piece: &[usize]| {
            let (mut value, mut sums) = (0.0, vec![T::zero(); count]);
            for k in piece {
                self.image(*k, x, scratch);
                value += link(*k, &scratch.image, &mut scratch.slopes);
                if all {
                    self.back_to_all(*k, scratch, &mut sums);
                } else {
                    self.back(*k, scratch, &mut sums);
                }
                if let Some(quiescent) = &self.walk.model.quiescent {
                    quiescent.back(&scratch.slopes, &mut sums);
                }
            }
            (value, sums)
        };
        let pieces: Vec<(f64, Vec<T>)> =
            indices.par_chunks(piece).map_init(|| self.scratch(), of_piece).collect();
        let value = pieces.iter().map(|piece| piece.0).sum();
        (value, total(pieces, count))
    }

    fn scratch(&self) -> Scratch<T> {
        Scratch {
            buffers: Buffers::default(),
            image: vec![T::zero(); self.pixels],
            slopes: vec![T::zero(); self.pixels],
        }
    }

    /// Value of the data at `x`, and the gradient with respect to the nodes that count, or to all.
    pub fn value_and_gradient(&self, data: &Data<'_, T>, x: &[T], all: bool) -> (f64, Vec<f64>) {
        self.through(x, all, |k, image, slopes| data.value(self.frames[k], image, slopes))
    }

    /// Gradients with respect to the pixels of all frames where nothing shines.
    pub fn dark(&self, data: &Data<'_, T>) -> Option<Vec<T>> {
        let count = self.frames.len() * self.pixels;
        if (count * size_of::<T>()) as f64 > memory::part(SLOPES) {
            return None;
        }
        let (dark, mut slopes) = (vec![T::zero(); self.pixels], vec![T::zero(); self.pixels]);
        let mut all = Vec::with_capacity(count);
        for frame in self.frames {
            data.value(*frame, &dark, &mut slopes);
            all.extend_from_slice(&slopes);
        }
        Some(all)
    }

    /// Second derivative of quadratic data, times `direction`; `dark` are their slopes where nothing shines, if they are
    /// kept.
    pub fn curvature(&self, data: &Data<'_, T>, dark: Option<&[T]>, direction: &[T]) -> Vec<f64> {
        let nothing = vec![T::zero(); if dark.is_none() { self.pixels } else { 0 }];
        // The gradient of quadratic data is affine in the image: less that of a dark image, it is
        // the second derivative times the image.
        let link = |k: usize, image: &[T], slopes: &mut [T]| {
            let frame = self.frames[k];
            data.value(frame, image, slopes);
            let subtract = |slopes: &mut [T], dark: &[T]| {
                slopes.iter_mut().zip(dark).for_each(|(slope, dark)| *slope -= *dark);
            };
            match dark {
                Some(dark) => subtract(slopes, &dark[k * self.pixels..(k + 1) * self.pixels]),
                None => {
                    let mut dark = nothing.clone();
                    data.value(frame, &nothing, &mut dark);
                    subtract(slopes, &dark);
                }
            }
            0.0
        };
        self.through(direction, false, link).1
    }

    /// The images of `x`, frame after frame.
    pub fn images(&self, x: &[T]) -> Vec<T> {
        self.some_images(x, 0..self.frames.len())
    }

    /// Those of some frames.
    pub fn some_images(&self, x: &[T], frames: Range<usize>) -> Vec<T> {
        let indices: Vec<usize> = frames.collect();
        let of = |scratch: &mut Scratch<T>, k: &usize| {
            self.image(*k, x, scratch);
            scratch.image.clone()
        };
        let all: Vec<Vec<T>> = indices.par_iter().map_init(|| self.scratch(), of).collect();
        all.concat()
    }

    /// Returns the slopes with respect to the nodes that count, from those with respect to pixels, frame after frame.
    pub fn adjoint(&self, slopes: &[T]) -> Vec<f64> {
        // Only the way back is wanted: the images that go with it are not looked at.
        let dark = vec![T::zero(); self.active.count()];
        let link = |k: usize, _: &[T], out: &mut [T]| {
            out.copy_from_slice(&slopes[k * self.pixels..(k + 1) * self.pixels]);
            0.0
        };
        self.through(&dark, false, link).1
    }

    /// Mean over frames of the flux in Stokes I, the first image of every frame; of Q where data have no I, its size.
    pub fn flux(&self, x: &[T]) -> f64 {
        let of_i = self.walk.model.planes.as_ref().map_or(self.pixels, |planes| planes.stride);
        let link = |_: usize, image: &[T], slopes: &mut [T]| {
            slopes.fill(T::zero());
            image[..of_i].iter().map(|pixel| pixel.double()).sum::<f64>().abs()
        };
        self.through(x, false, link).0 / self.frames.len() as f64
    }

    /// Returns those of the nodes that count which any ray meets.
    pub fn seen(&self) -> Vec<bool> {
        let link = |_: usize, _: &[T], slopes: &mut [T]| {
            slopes.fill(T::one());
            0.0
        };
        let sums = self.through(&vec![T::zero(); self.active.count()], false, link).1;
        sums.iter().map(|sum| *sum != 0.0).collect()
    }

    /// The first data at `x` whose χ² is no finite number, with the frame.
    pub fn not_finite(&self, data: &Data<'_, T>, x: &[T]) -> Option<(usize, String, f64)> {
        let first: Mutex<Option<(usize, String, f64)>> = Mutex::new(None);
        let link = |k: usize, image: &[T], slopes: &mut [T]| {
            let frame = self.frames[k];
            if let Some((name, value)) = data.not_finite(frame, image, slopes) {
                let mut first = first.lock().unwrap_or_else(PoisonError::into_inner);
                // Threads take frames in any order; the earliest is always the one that is named.
                if first.as_ref().is_none_or(|(earlier, ..)| frame < *earlier) {
                    *first = Some((frame, name, value));
                }
            }
            slopes.fill(T::zero());
            0.0
        };
        self.through(x, false, link);
        first.into_inner().unwrap_or_else(PoisonError::into_inner)
    }

    /// Sum of squares of each column.
    pub fn squares(&self) -> Vec<f64> {
        let mut sums = vec![0.0; self.active.count()];
        let mut add = |rows: &Rows<T>| {
            for (column, entry) in rows.columns.iter().zip(&rows.entries) {
                sums[*column as usize] += entry.double() * entry.double();
            }
        };
        for (held, frame) in self.rows.iter().zip(self.frames) {
            match held {
                Held::Kept(rows) => add(rows),
                Held::Made => self.each_row(*frame, &mut Buffers::default(), &mut add),
                // Frames without rows are left out: norms only scale the steps.
                Held::Walked => {}
            }
        }
        if let Some(quiescent) = &self.walk.model.quiescent {
            // A pixel that does not move enters every frame with the same factor.
            let square = self.frames.len() as f64 * quiescent.unit() * quiescent.unit();
            quiescent.of_mut(&mut sums).fill(square);
        }
        sums
    }
}

fn total<T: Float>(pieces: Vec<(f64, Vec<T>)>, count: usize) -> Vec<f64> {
    let mut sums = vec![0.0; count];
    const SHARE: usize = 8192;
    // A thread adds all pieces for its own nodes, in the order of frames: the same bits on any
    // number of threads.
    sums.par_chunks_mut(SHARE).enumerate().for_each(|(k, sums)| {
        for (_, piece) in &pieces {
            let piece = &piece[k * SHARE..k * SHARE + sums.len()];
            sums.iter_mut().zip(piece).for_each(|(sum, x)| *sum += x.double());
        }
    });
    sums
}
