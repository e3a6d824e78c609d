//! Storage of the frames of the matrix: rows that are kept, rows that are made each time, or node by node.

use super::active::{Active, NONE};
use super::operator::Operator;
use super::ray_weights::{Buffers, Place, Walk};
use super::rows::{Held, Rows};
use kerrlight_common::memory;
use kerrlight_common::simd::Float;
use rayon::prelude::*;

/// Share of the memory for rows.
const ROWS: f64 = 1.0 / 4.0;
/// Frames between which the budget is looked at: where rows end and walks begin depends on it, and on no memory.
const AT_A_TIME: usize = 8;
/// Rows that grow take so many times their bytes.
const GROWTH: usize = 2;

impl<'a, T: Float> Operator<'a, T> {
    /// Restricted to these nodes, with at most about `budget` bytes of rows (those of 8 frames more).
    pub fn new(walk: Walk<'a, T>, active: Active, frames: &'a [usize], budget: usize) -> Self {
        Self::within(walk, active, frames, [budget, memory::part(ROWS) as usize])
    }

    /// The same with `room` bytes for what is kept. Nothing but the time depends on it.
    pub fn within(
        walk: Walk<'a, T>,
        active: Active,
        frames: &'a [usize],
        [budget, room]: [usize; 2],
    ) -> Self {
        let (corners, pixels) = (walk.voxels.corners(), walk.model.pixels());
        let mut all = Self { walk, active, corners, frames, pixels, rows: Vec::new() };
        let (mut made, mut largest) = (0, None);
        for some in frames.chunks(AT_A_TIME) {
            if made > budget {
                all.rows.extend(some.iter().map(|_| Held::Walked));
            } else {
                let largest = largest.get_or_insert_with(|| all.largest(some, room));
                made += all.hold(some, largest, room);
            }
        }
        all
    }

    /// Bytes that the rows of a frame take, about: a bound where that fits for all of these, otherwise those of the first.
    fn largest(&self, frames: &[usize], room: usize) -> usize {
        let points = self.walk.model.points() * self.corners.len();
        // A node is in a row of each Stokes parameter; births of every knot before it reach it.
        let images = self.walk.model.planes.as_ref().map_or(1, |planes| planes.count);
        let times = images * self.walk.knots.count;
        let bound = points.saturating_mul(times).saturating_mul(size_of::<T>() + 4);
        // A frame is measured by making its rows: not where even the bound fits.
        if bound.saturating_mul(GROWTH * frames.len()) <= room {
            return bound;
        }
        self.bytes_of(frames[0])
    }

    /// Rows of some frames, kept as long as there is room; the bytes of all of them.
    fn hold(&mut self, frames: &[usize], largest: &mut usize, room: usize) -> usize {
        let (mut bytes, mut kept) = (0, self.bytes());
        let mut rest = frames;
        while !rest.is_empty() {
            // Rows may all be empty, and room is divided by their size.
            let growing = GROWTH * (*largest).max(1);
            let together = (room.saturating_sub(kept) / growing).min(rest.len());
            // Rows without room count against the budget as well: it alone decides where walks
            // begin, and with them the last bits.
            if together == 0 {
                bytes += rest.par_iter().map(|frame| self.bytes_of(*frame)).sum::<usize>();
                self.rows.extend(rest.iter().map(|_| Held::Made));
                break;
            }
            let (some, later) = rest.split_at(together);
            let rows: Vec<_> = some.par_iter().map(|frame| self.rows_of(*frame)).collect();
            let more = rows.iter().map(Rows::bytes).sum::<usize>();
            *largest = rows.iter().map(Rows::bytes).fold(*largest, usize::max);
            self.rows.extend(rows.into_iter().map(Held::Kept));
            (bytes, kept, rest) = (bytes + more, kept + more, later);
        }
        bytes
    }

    /// All rows of a frame.
    pub fn rows_of(&self, frame: usize) -> Rows<T> {
        if self.walk.model.is_flux {
            return self.fluxes_of(frame);
        }
        let mut rows = Rows::default();
        let mut place = vec![NONE; self.active.count()];
        let wanted = Some(self.active.cells.as_slice());
        self.walk.frame(frame, wanted, &mut Buffers::default(), |pixel, places| {
            self.push(&mut rows, pixel, places, &mut place);
        });
        // Vectors grow ahead of their length, which is all that `bytes` counts.
        rows.columns.shrink_to_fit();
        rows.entries.shrink_to_fit();
        rows
    }

    /// Hands over the rows of a frame in the same order, one at a time where rays have their own.
    pub fn each_row(&self, frame: usize, buffers: &mut Buffers<T>, mut take: impl FnMut(&Rows<T>)) {
        if self.walk.model.is_flux {
            return take(&self.fluxes_of(frame));
        }
        let mut row = Rows::default();
        let mut place = vec![NONE; self.active.count()];
        self.walk.frame(frame, Some(&self.active.cells), buffers, |pixel, places| {
            row.clear();
            self.push(&mut row, pixel, places, &mut place);
            take(&row);
        });
    }

    /// Adds up what a ray's nodes take from each column; `place` remembers where in the row a column is.
    fn push(&self, rows: &mut Rows<T>, pixel: u32, places: &[Place<T>], place: &mut [u32]) {
        let start = rows.columns.len();
        self.entries(places, |column, entry| {
            if entry == T::zero() {
                return;
            }
            // `place` is never cleared: what earlier rows left in it lies before `start`, or
            // another column stands there now.
            let known = place[column as usize] as usize;
            if known >= start && rows.columns.get(known) == Some(&column) {
                rows.entries[known] += entry;
            } else {
                place[column as usize] = rows.columns.len() as u32;
                rows.columns.push(column);
                rows.entries.push(entry);
            }
        });
        if rows.columns.len() > start {
            rows.pixel.push(pixel);
            rows.starts.push(rows.columns.len() as u32);
        }
    }

    /// Bytes of the rows of a frame.
    fn bytes_of(&self, frame: usize) -> usize {
        let mut bytes = 0;
        self.each_row(frame, &mut Buffers::default(), |row| bytes += row.bytes());
        bytes
    }

    /// Bytes of the rows that are kept.
    pub fn bytes(&self) -> usize {
        let of = |held: &Held<T>| match held {
            Held::Kept(rows) => rows.bytes(),
            Held::Made | Held::Walked => 0,
        };
        self.rows.iter().map(of).sum()
    }

    /// Rows of data to which all rays add: a number for every node.
    fn fluxes_of(&self, frame: usize) -> Rows<T> {
        let columns = self.active.count();
        // Rays pass the same nodes: a row for each ray would hold a column many times.
        let mut sums = vec![T::zero(); self.pixels * columns];
        let wanted = Some(self.active.cells.as_slice());
        self.walk.frame(frame, wanted, &mut Buffers::default(), |pixel, places| {
            let row = &mut sums[pixel as usize * columns..][..columns];
            self.entries(places, |column, entry| row[column as usize] += entry);
        });
        let mut rows = Rows::default();
        // No column counts where all nodes are dark; chunks of length 0 panic.
        for (pixel, row) in sums.chunks_exact(columns.max(1)).enumerate() {
            let lit = row.iter().enumerate().filter(|(_, entry)| **entry != T::zero());
            for (column, entry) in lit {
                rows.columns.push(column as u32);
                rows.entries.push(*entry);
            }
            rows.pixel.push(pixel as u32);
            rows.starts.push(rows.columns.len() as u32);
        }
        rows
    }
}
