//! Rooms: the part of a step that the device takes at a time.

use super::pixels::Room;
use crate::fit::learning::training::BatchSize;
use crate::fit::loss::objective::Objective;

/// The most points at a time, if a frame has no more.
const POINTS: usize = 1 << 21;

/// Pairs and whole frames at a time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pieces {
    /// Pairs.
    pub pairs: usize,
    /// Frames.
    pub frames: usize,
    points: usize,
}

impl Pieces {
    /// Takes the steps of a fit.
    pub fn new(objective: &Objective<f32>, batch: BatchSize) -> Self {
        let model = &objective.model;
        let frames = match batch {
            BatchSize::Pixels(count) => {
                let longest =
                    model.starts.windows(2).map(|ends| ends[1] - ends[0]).max().unwrap_or(0).max(1);
                let pairs = count.min((POINTS / longest).max(1));
                return Self { pairs, frames: 1, points: pairs * longest };
            }
            BatchSize::Frames(count) => count.min(model.frames()),
            BatchSize::All => model.frames(),
        };
        let frames = frames.min((POINTS / model.points().max(1)).max(1)).max(1);
        Self { pairs: frames * model.rays(), frames, points: frames * model.points() }
    }

    /// The room that they take.
    pub fn room(&self, nodes: usize, cells: usize, records: usize, axis: Option<bool>) -> Room {
        Room { nodes, pairs: self.pairs, points: self.points, cells, records, axis }
    }
}

/// Place of a piece in its step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ends {
    /// True if it is the first.
    pub is_first: bool,
    /// True if it is the last, of a step that is taken.
    pub is_last_and_learns: bool,
}

/// The pieces of a step, so many of its pairs or frames each.
pub fn pieces<T>(all: &[T], most: usize, learns: bool) -> impl Iterator<Item = (&[T], Ends)> {
    let last = all.len().div_ceil(most).saturating_sub(1);
    all.chunks(most).enumerate().map(move |(k, some)| {
        (some, Ends { is_first: k == 0, is_last_and_learns: learns && k == last })
    })
}
