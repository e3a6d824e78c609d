//! Settings of training.

use crate::fit::forward::occupancy::OccupancySettings;
use crate::fit::forward::sightlines::Region;
use crate::fit::loss::change_price::ChangePrice;
use crate::optimise::{LinearDecay, Muon};
use crate::representation::Representation;
use kerrlight_common::simd::Float;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Steps from one comparison of a fit with all of its data to the next.
pub const COMPARED: u64 = 25;

/// Factor by which a loss that diverges exceeds that of the kept state.
pub(super) const DIVERGENCE: f64 = 1e3;

/// Data of a step: rays, or whole frames.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub enum BatchSize {
    /// Random (ray, frame) pairs, that many; for images alone.
    Pixels(#[schemars(range(min = 1, max = 1_000_000_000), extend("unit" = "pixels"))] usize),
    /// Random frames, that many, whole.
    Frames(#[schemars(range(min = 1), extend("unit" = "frames"))] usize),
    /// All frames, whole: the same loss at every step.
    All,
}

/// Training: optimiser, steps and batches.
#[derive(Clone, Debug, PartialEq)]
pub struct Training {
    /// Seed of the parameters and of all that is drawn.
    pub seed: u64,
    /// Rule of the steps of the weight matrices of networks, if it is not Adam's.
    pub muon: Option<Muon>,
    /// First learning rate of Adam and Muon.
    pub rate: LinearDecay,
    /// Rates of the axis; without them it is held.
    pub axis_rate: Option<LinearDecay>,
    /// Steps over which the rate grows from 0.
    pub ramp: u64,
    /// Data of a step.
    pub batch: BatchSize,
    /// A mask that skips dark cells.
    pub occupancy: Option<OccupancySettings>,
    /// Price of change while matter carries emission, where a representation allows it.
    pub change: Option<ChangePrice>,
    /// Region in which emission is looked for.
    pub region: Region,
    /// Steps from one good state that is kept to the next.
    pub keep_every: u64,
}

impl Training {
    /// Returns whether the axis is learnt, of a representation that knows of it.
    pub fn learns_axis<T: Float>(&self, representation: &dyn Representation<T>) -> bool {
        self.axis_rate.is_some() && representation.is_carried()
    }
}
