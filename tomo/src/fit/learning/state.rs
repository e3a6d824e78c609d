//! State of a fit from step to step, and how it goes back when its loss diverges.

use super::training::Training;
use crate::fit::forward::occupancy::Occupancy;
use crate::fit::loss::objective::Loss;
use crate::optimise::AdamState;
use crate::representation::Representation;
use kerrlight_common::simd::Float;
use kerrlight_render::dynamics::Axis;

/// Most returns of a fit.
const MOST_SETBACKS: u32 = 12;

/// State of a fit from step to step.
#[derive(Clone, Debug, PartialEq)]
pub struct Progress<T> {
    /// Steps taken.
    pub step: u64,
    /// Parameters of the representation.
    pub parameters: Vec<T>,
    /// State of Adam for the parameters.
    pub adam: AdamState<T>,
    /// The axis.
    pub axis: Axis,
    /// State of Adam for the axis.
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
    /// Present state.
    pub now: Progress<T>,
    /// State it goes back to when it diverges.
    pub good: Option<Box<Progress<T>>>,
    /// Number of times it has gone back.
    pub setbacks: u32,
}

/// Outcome of a step.
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
}

/// Reason why a fit cannot go on.
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
        let now = Progress {
            step: 0,
            parameters,
            adam: AdamState::new(count),
            axis,
            axis_adam: AdamState::new(3),
            occupancy: training.occupancy.map(|mask| Occupancy::new(mask, training.region)),
            caution: 1.0,
            loss: f64::INFINITY,
        };
        Self { now, good: None, setbacks: 0 }
    }
}

/// Back to the last good state, for the loss of `step`.
pub(in crate::fit) fn step_back<T: Float>(
    state: &mut State<T>,
    loss: f64,
    step: u64,
) -> Result<Outcome, Diverged> {
    let diverged = Diverged { loss, step, setbacks: state.setbacks };
    let Some(good) = &mut state.good else { return Err(diverged) };
    if state.setbacks >= MOST_SETBACKS {
        return Err(diverged);
    }
    state.setbacks += 1;
    // In the kept state, too: from there the next divergence halves rates once more.
    good.caution *= 0.5;
    state.now = (**good).clone();
    Ok(Outcome::SteppedBack { loss, to: good.step, caution: good.caution })
}
