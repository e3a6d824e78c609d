//! How a fit is run, and what it remembers from step to step.

use super::device::Delegate;
use super::is_turned;
use super::objective::{Buffers, Loss, Objective};
use super::occupancy::{Occupancy, OccupancySettings};
use super::parts::Ranks;
use super::penalties::{Penalties, ProbeBuffers};
use super::sightlines::Region;
use crate::dynamics::Axis;
use crate::optimise::{Adam, AdamState, Lbfgs, LbfgsState, Polynomial};
use crate::representation::Representation;
use crate::simd::Float;
use serde::{Deserialize, Serialize};

/// What a step looks at.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub enum BatchSize {
    /// That many random (ray, frame) pairs; for images alone.
    Pixels(usize),
    /// That many random frames, whole.
    Frames(usize),
    /// All frames, whole: the same loss at every step.
    All,
}

/// When a mask of what shines is used and renewed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OccupancyPlan {
    /// The mask.
    pub settings: OccupancySettings,
    /// Steps without it.
    pub warm_up: u64,
    /// Steps from one refreshment to the next.
    pub every: u64,
}

/// How a fit is run.
#[derive(Clone, Debug, PartialEq)]
pub struct Training {
    /// Seed of the parameters and of all that is drawn.
    pub seed: u64,
    /// Rule of the steps.
    pub adam: Adam,
    /// Quasi-Newton steps instead of Adam's, for small problems: they have no rates, need [`BatchSize::All`], and their
    /// draws are those of step 0, so that the loss is the same function at every step.
    pub lbfgs: Option<Lbfgs>,
    /// Rates of the parameters.
    pub rate: Polynomial,
    /// Rates of the axis; without them it is held.
    pub axis_rate: Option<Polynomial>,
    /// Steps over which rates grow to what they are: the first steps of Adam, whose memory is empty, are
    /// as long as the rate allows, and would undo a good start.
    pub ramp: u64,
    /// Part of the data of a step.
    pub batch: BatchSize,
    /// Parts that the data of a step are cut into: gradients of parts are summed in an order that does not depend on which
    /// process has which ([`parts`](super::parts)). With 1 they are not cut.
    pub parts: usize,
    /// Mask of what shines, if any.
    pub occupancy: Option<OccupancyPlan>,
    /// Penalties beside the data, if any.
    pub penalties: Option<Penalties>,
    /// Where emission is looked for.
    pub region: Region,
    /// Steps from one good state that is kept to the next.
    pub keep_every: u64,
    /// A loss larger than that of the kept state by this factor is a divergence.
    pub divergence: f64,
}

/// What of a fit goes on from step to step.
#[derive(Clone, Debug, PartialEq)]
pub struct Progress<T> {
    /// Steps taken.
    pub step: u64,
    /// Parameters of the representation.
    pub parameters: Vec<T>,
    /// What Adam remembers of them; nothing, with quasi-Newton steps.
    pub adam: AdamState<T>,
    /// What quasi-Newton steps remember of them, and of the axis behind them where it is learnt.
    pub lbfgs: Option<LbfgsState<T>>,
    /// The axis.
    pub axis: Axis,
    /// What Adam remembers of it.
    pub axis_adam: AdamState<f64>,
    /// Mask of what shines.
    pub occupancy: Option<Occupancy>,
    /// Factor on the rates: halved at each divergence.
    pub caution: f64,
    /// Loss of the last step, dimensionless.
    pub loss: f64,
}

/// All that a fit remembers: what a checkpoint holds.
#[derive(Clone, Debug, PartialEq)]
pub struct State<T> {
    /// Where it is.
    pub now: Progress<T>,
    /// Where it goes back to when it diverges.
    pub good: Option<Box<Progress<T>>>,
    /// How often it has gone back.
    pub setbacks: u32,
}

/// What a step did.
#[derive(Clone, Debug, PartialEq)]
pub enum Outcome {
    /// It moved on.
    Done(Loss),
    /// It diverged, and goes on from an earlier step with half the rates.
    SteppedBack {
        /// The loss that showed it.
        loss: f64,
        /// The step it goes on from.
        to: u64,
        /// The factor on the rates from there.
        caution: f64,
    },
    /// No quasi-Newton step makes the loss smaller: it has come to a minimum within rounding.
    Converged,
}

/// Why a fit cannot go on.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[error(
    "the loss is {loss} at step {step}, after {setbacks} returns to earlier steps with ever smaller learning rates"
)]
pub struct Diverged {
    /// The last loss, dimensionless.
    pub loss: f64,
    /// The step.
    pub step: u64,
    /// Returns.
    pub setbacks: u32,
}

impl<T: Float> State<T> {
    /// The start of a fit.
    pub fn new(representation: &dyn Representation<T>, axis: Axis, training: &Training) -> Self {
        let count = representation.parameters();
        let mut parameters = vec![T::zero(); count];
        representation.initialise(training.seed, &mut parameters);
        let mask = |plan: OccupancyPlan| Occupancy::new(plan.settings, training.region);
        let learnt = training.learns_axis(representation);
        let numbers = count + if learnt { 3 } else { 0 };
        let lbfgs = training.lbfgs.map(|rule| LbfgsState::new(numbers, rule.memory));
        let now = Progress {
            step: 0,
            parameters,
            adam: AdamState::new(if lbfgs.is_some() { 0 } else { count }),
            lbfgs,
            axis,
            axis_adam: AdamState::new(3),
            occupancy: training.occupancy.map(mask),
            caution: 1.0,
            loss: f64::INFINITY,
        };
        Self { now, good: None, setbacks: 0 }
    }
}

/// A fit with its memory.
pub struct Trainer<'a, T> {
    /// What is minimised.
    pub objective: Objective<T>,
    /// The field.
    pub representation: &'a dyn Representation<T>,
    /// How it is run.
    pub training: Training,
    /// Other processes that have parts of each step, if there are any.
    pub ranks: Option<Box<dyn Ranks<T>>>,
    /// A device that takes the steps in place of this processor, if there is one.
    pub device: Option<Delegate<T>>,
    pub(super) observed: Vec<usize>,
    pub(super) buffers: Buffers<T>,
    pub(super) probe: ProbeBuffers<T>,
    pub(super) gradient: Vec<T>,
    pub(super) pairs: Vec<(u32, u32)>,
    pub(super) frames: Vec<usize>,
    /// Gradients of parts that are no longer used.
    pub(super) spare: Vec<Vec<T>>,
}

impl Training {
    /// Whether the axis is learnt, of a representation that knows of it.
    pub fn learns_axis<T: Float>(&self, representation: &dyn Representation<T>) -> bool {
        self.axis_rate.is_some() && is_turned(representation)
    }
}

impl<'a, T: Float> Trainer<'a, T> {
    /// A fit of a representation.
    pub fn new(
        objective: Objective<T>,
        representation: &'a dyn Representation<T>,
        training: Training,
    ) -> Self {
        let (observed, gradient) =
            (objective.observed(), vec![T::zero(); representation.parameters()]);
        Self {
            objective,
            representation,
            training,
            ranks: None,
            device: None,
            observed,
            buffers: Buffers::default(),
            probe: ProbeBuffers::default(),
            gradient,
            pairs: Vec::new(),
            frames: Vec::new(),
            spare: Vec::new(),
        }
    }
}
