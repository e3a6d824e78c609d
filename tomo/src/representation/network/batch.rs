//! A batch in chunks, whatever the number of threads, and chunks in tiles.
//!
//! A chunk adds up its own gradient, tile after tile; chunks are added up in their order. Both cuts
//! depend on the batch alone, so that threads cannot change a bit of the result.

use super::super::workspace::Lines;
use super::super::{Coordinates, CoordinatesMut, Gradient};
use super::Network;
use super::output::Cotangents;
use super::packed::Packed;
use super::tile::{Activations, POINTS, Tile};
use core::ops::Range;
use kerrlight_common::memory;
use kerrlight_common::simd::Float;
use rayon::prelude::*;
use std::sync::{Mutex, PoisonError};

/// The most chunks, each with a gradient of its own.
const CHUNKS: usize = 32;
/// Most bytes of activations that a recording keeps; points beyond pass through the layers once more.
const RECORDED: usize = 256 << 20;
/// The same as a part of the memory that may be taken.
const PART: f64 = 1.0 / 16.0;
/// Parameters of which one thread adds up the chunks at a time.
const SUMMED: usize = 4096;

/// Direction of a batch.
pub enum Way<'a, T> {
    /// Values only; what the way back needs is kept if `recorded`.
    Forward { values: &'a mut [T], recorded: bool },
    /// Values, if wanted, and the gradient.
    /// Without a forward pass where the last batch was `recorded`.
    Both {
        cotangents: Cotangents<'a, T>,
        values: Option<&'a mut [T]>,
        gradient: Gradient<'a, T>,
        recorded: bool,
    },
}

/// Memory kept from batch to batch.
#[derive(Default)]
pub struct Memory<T> {
    packed: Packed<T>,
    tiles: Mutex<Vec<Tile<T>>>,
    partial: Vec<Lines<T>>,
    recording: Recording<T>,
}

/// Activations of a batch that went forward, for its way back.
#[derive(Default)]
struct Recording<T> {
    /// Points of the batch, until it is used up.
    points: Option<usize>,
    /// Activations of the first tiles of each chunk.
    tiles: Vec<Vec<Activations<T>>>,
}

impl<T: Float> Recording<T> {
    /// Makes room for the tiles of so many chunks, as far as memory may be taken.
    fn prepare(&mut self, network: &Network, cuts: &Cuts<'_>) {
        let all = cuts.points.div_ceil(cuts.chunks).div_ceil(POINTS);
        let most = memory::part(PART).min(RECORDED as f64) as usize;
        let tile = Activations::<T>::bytes(network, cuts.largest);
        let each = (most / (tile * cuts.chunks)).min(all);
        self.tiles.resize_with(self.tiles.len().max(cuts.chunks), Vec::new);
        self.tiles.iter_mut().for_each(|tiles| tiles.resize_with(each, Activations::default));
        for tile in self.tiles[..cuts.chunks].iter_mut().flatten() {
            tile.resize(network, cuts.largest);
        }
        self.points = Some(cuts.points);
    }
}

impl<T: Float> Memory<T> {
    /// Runs a batch; `groups` are tied to the points as in `eval_vjp`, or empty.
    pub fn run(
        &mut self,
        network: &Network,
        parameters: &[T],
        at: Coordinates<'_, T>,
        groups: &[usize],
        way: Way<'_, T>,
    ) {
        assert!(parameters.len() == network.layout.parameters());
        assert!(at.dimension() == network.settings.dimension);
        if at.is_empty() {
            return;
        }
        let cuts = Cuts::new(at.len(), groups);
        let backward = matches!(way, Way::Both { .. });
        // Every run uses a recording up: another batch is not the one recorded, and the way back
        // spoils its slopes.
        let passed = self.recording.points.take() == Some(at.len());
        let recorded = match way {
            Way::Forward { recorded, .. } => recorded,
            Way::Both { recorded, .. } => recorded && passed,
        };
        if recorded && !backward {
            self.recording.prepare(network, &cuts);
        }
        let wanted = matches!(&way, Way::Both { gradient, .. } if gradient.coordinates.is_some());
        self.packed.pack(network, parameters, backward, wanted);
        self.prepare(network, &cuts, backward);
        let (cotangents, values, gradient) = match way {
            Way::Forward { values, .. } => (None, Some(values), None),
            Way::Both { cotangents, values, gradient, .. } => {
                (Some(cotangents), values, Some(gradient))
            }
        };
        let (sums, coordinates) = match gradient {
            Some(Gradient { parameters, coordinates }) => (Some(parameters), coordinates),
            None => (None, None),
        };
        check(at.len(), values.as_deref(), cotangents, coordinates.as_ref());
        let batch = Batch {
            network,
            packed: &self.packed,
            tiles: &self.tiles,
            at,
            cotangents,
            cuts: &cuts,
        };
        let partial = if backward { &mut self.partial[..cuts.chunks] } else { &mut [] };
        let kept = if recorded { &mut self.recording.tiles[..cuts.chunks] } else { &mut [] };
        batch.split(Job { chunks: 0..cuts.chunks, values, coordinates, partial, kept });
        if let Some(sums) = sums {
            add_up(&self.partial[..cuts.chunks], sums);
        }
    }

    fn prepare(&mut self, network: &Network, cuts: &Cuts<'_>, backward: bool) {
        let parameters = network.layout.parameters();
        if backward {
            self.partial.resize_with(self.partial.len().max(cuts.chunks), Lines::default);
            self.partial[..cuts.chunks].iter_mut().for_each(|lines| lines.resize(parameters));
        }
        let tiles = self.tiles.get_mut().unwrap_or_else(PoisonError::into_inner);
        // A chunk holds one tile while it runs.
        let threads = rayon::current_num_threads().min(cuts.chunks);
        tiles.resize_with(tiles.len().max(threads), Tile::default);
        tiles.iter_mut().for_each(|tile| tile.resize(network, cuts.largest, backward));
    }
}

fn check<T>(
    points: usize,
    values: Option<&[T]>,
    cotangents: Option<Cotangents<'_, T>>,
    coordinates: Option<&CoordinatesMut<'_, T>>,
) {
    assert!(values.is_none_or(|values| values.len() == points));
    if let Some(Cotangents::Given(cotangents)) = cotangents {
        assert!(cotangents.len() == points);
    }
    assert!(coordinates.is_none_or(|coordinates| coordinates.len() == points));
}

/// sums += all partial sums, each number in the order of the chunks.
fn add_up<T: Float>(partial: &[Lines<T>], sums: &mut [T]) {
    sums.par_chunks_mut(SUMMED).enumerate().for_each(|(k, sums)| {
        for partial in partial {
            let partial = &partial.read()[k * SUMMED..];
            sums.iter_mut().zip(partial).for_each(|(sum, x)| *sum += *x);
        }
    });
}

/// Cuts of a batch; never inside a group.
struct Cuts<'a> {
    points: usize,
    groups: &'a [usize],
    chunks: usize,
    /// Points of the largest tile.
    largest: usize,
}

impl<'a> Cuts<'a> {
    fn new(points: usize, groups: &'a [usize]) -> Self {
        let widths = groups.windows(2).map(|pair| {
            assert!(pair[0] <= pair[1], "groups in order");
            pair[1] - pair[0]
        });
        let largest = widths.max().unwrap_or(0).max(POINTS);
        if let [first, .., last] = groups {
            assert!(*first == 0 && *last == points, "groups cover all points");
        } else {
            assert!(groups.is_empty(), "one start more than groups");
        }
        Self { points, groups, chunks: points.div_ceil(POINTS).min(CHUNKS), largest }
    }

    /// The first group of a chunk.
    fn group(&self, chunk: usize) -> usize {
        let point = (chunk * self.points).div_ceil(self.chunks);
        if self.groups.is_empty() {
            return point;
        }
        // Empty groups behind the last point belong to the last chunk: the link gets every group.
        if chunk == self.chunks {
            return self.groups.len() - 1;
        }
        self.groups.partition_point(|start| *start < point)
    }

    /// The first point of a group.
    fn point(&self, group: usize) -> usize {
        if self.groups.is_empty() { group } else { self.groups[group] }
    }

    /// The end of a tile of about `wanted` points, at least one group, from `group` on.
    fn tile_end(&self, group: usize, wanted: usize, end: usize) -> usize {
        let point = self.point(group) + wanted;
        if self.groups.is_empty() {
            return point.min(end);
        }
        let next = self.groups.partition_point(|start| *start <= point) - 1;
        next.clamp(group + 1, end)
    }
}

/// Some chunks and what is theirs alone.
struct Job<'a, T> {
    chunks: Range<usize>,
    values: Option<&'a mut [T]>,
    coordinates: Option<CoordinatesMut<'a, T>>,
    partial: &'a mut [Lines<T>],
    kept: &'a mut [Vec<Activations<T>>],
}

/// Batch that all chunks share.
struct Batch<'a, T> {
    network: &'a Network,
    packed: &'a Packed<T>,
    tiles: &'a Mutex<Vec<Tile<T>>>,
    at: Coordinates<'a, T>,
    cotangents: Option<Cotangents<'a, T>>,
    cuts: &'a Cuts<'a>,
}

impl<T: Float> Batch<'_, T> {
    fn split(&self, job: Job<'_, T>) {
        if job.chunks.len() == 1 {
            return self.chunk(job);
        }
        let Job { chunks, values, coordinates, partial, kept } = job;
        let middle = chunks.start + chunks.len() / 2;
        let start = |chunk| self.cuts.point(self.cuts.group(chunk));
        let points = start(middle) - start(chunks.start);
        let (values, more_values) = values.map(|values| values.split_at_mut(points)).unzip();
        let (coordinates, more_coordinates) = coordinates.map(|all| all.split_at(points)).unzip();
        let count = (middle - chunks.start).min(partial.len());
        let (partial, more_partial) = partial.split_at_mut(count);
        let (kept, more_kept) = kept.split_at_mut((middle - chunks.start).min(kept.len()));
        let left = Job { chunks: chunks.start..middle, values, coordinates, partial, kept };
        let (values, coordinates) = (more_values, more_coordinates);
        let (partial, kept) = (more_partial, more_kept);
        let right = Job { chunks: middle..chunks.end, values, coordinates, partial, kept };
        rayon::join(|| self.split(left), || self.split(right));
    }

    fn chunk(&self, job: Job<'_, T>) {
        let pool = || self.tiles.lock().unwrap_or_else(PoisonError::into_inner);
        // None is left where a link waits for other work and its thread begins one more chunk.
        let mut tile = pool().pop().unwrap_or_else(|| {
            let mut tile = Tile::default();
            tile.resize(self.network, self.cuts.largest, self.cotangents.is_some());
            tile
        });
        self.tiles_of(job, &mut tile);
        pool().push(tile);
    }

    fn tiles_of(&self, job: Job<'_, T>, tile: &mut Tile<T>) {
        let Job { chunks, mut values, mut coordinates, partial, kept } = job;
        let cuts = self.cuts;
        let (mut group, end) = (cuts.group(chunks.start), cuts.group(chunks.end));
        let points = cuts.point(end) - cuts.point(group);
        // Tiles of about the same size.
        let wanted = points.div_ceil(points.div_ceil(POINTS).max(1));
        let mut sums = partial.first_mut().map(Lines::all);
        // Without a group no tile overwrites what the last batch has left there.
        if let (Some(sums), 0) = (&mut sums, points) {
            sums.fill(T::zero());
        }
        let mut overwrite = true;
        let mut kept = kept.iter_mut().flatten();
        while group < end {
            let next = cuts.tile_end(group, wanted, end);
            let range = cuts.point(group)..cuts.point(next);
            let ours = values.take().map(|all| all.split_at_mut(range.len()));
            let (ours, rest) = ours.unzip();
            values = rest;
            let mut kept = kept.next();
            if let Some(kept) = &mut kept {
                core::mem::swap(*kept, &mut tile.passed);
            }
            // A kept tile on its way back has gone forward already.
            if kept.is_none() || self.cotangents.is_none() {
                let (at, slopes) =
                    (self.at.range(range.clone()), self.cotangents.is_some() || kept.is_some());
                tile.passed.forward(self.network, self.packed, at, slopes);
            }
            if let Some(ours) = ours {
                ours.copy_from_slice(tile.passed.values());
            }
            if let (Some(cotangents), Some(sums)) = (self.cotangents, &mut sums) {
                let (ours, rest) = coordinates.take().map(|all| all.split_at(range.len())).unzip();
                coordinates = rest;
                tile.cotangents(cotangents, group..next, range);
                tile.backward(self.network, self.packed, sums, overwrite, ours);
                overwrite = false;
            }
            if let Some(kept) = kept {
                core::mem::swap(kept, &mut tile.passed);
            }
            group = next;
        }
    }
}
