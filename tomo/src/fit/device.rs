//! Steps of a fit that something else than this processor takes: a graphics device.
//!
//! What is drawn, how long steps are, and what is done when the loss diverges is decided here, as ever; the device gets a
//! stretch of steps and gives back what they lead to. Between stretches the whole state is in [`State`], so that a
//! checkpoint that one device has written is taken up by another.

use super::objective::{Loss, Objective};
use super::occupancy::Occupancy;
use super::selection::Selection;
use super::steps::step_back;
use super::train::{BatchSize, Outcome, Progress, State, Trainer};
use crate::Error;
use crate::dynamics::Axis;
use crate::optimise::Adam;
use crate::simd::Float;
use std::time::Instant;

/// Why a device does not take the steps of a fit: it failed, or it does not do what settings ask for.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{0}")]
pub struct DeviceError(pub String);

/// What a step looks at.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Drawn {
    /// (ray, frame) pairs of images.
    Pixels(Vec<(u32, u32)>),
    /// Whole frames, of all data.
    Frames(Vec<usize>),
}

impl Drawn {
    /// The same, borrowed.
    pub fn selection(&self) -> Selection<'_> {
        match self {
            Self::Pixels(pairs) => Selection::Pixels(pairs),
            Self::Frames(frames) => Selection::Frames(frames),
        }
    }
}

/// Some steps in a row, of which the settings are the same.
pub struct Stretch<'a, T> {
    /// Forward model, weighed for the axis, and data.
    pub objective: &'a Objective<T>,
    /// Rule of the steps.
    pub adam: Adam,
    /// The axis that matter turns about.
    pub axis: Axis,
    /// Outside of it nothing shines.
    pub occupancy: Option<&'a Occupancy>,
    /// What each step looks at.
    pub draws: Vec<Drawn>,
    /// Learning rate of each step.
    pub rates: Vec<f64>,
}

/// What a stretch of steps leads to.
#[derive(Clone, Debug, PartialEq)]
pub struct Taken<T> {
    /// Parameters after the last step.
    pub parameters: Vec<T>,
    /// Adam's two moments after it.
    pub moments: [Vec<T>; 2],
    /// Loss of each step, before it was taken.
    pub losses: Vec<Loss>,
}

/// Takes steps in place of this processor.
pub trait StepDevice<T>: Send {
    /// Its name.
    fn name(&self) -> &str;

    /// The most steps of a stretch.
    fn most(&self) -> usize;

    /// Takes these steps from where parameters and moments are.
    ///
    /// # Errors
    /// If the device fails; the steps are not taken then.
    fn take(&mut self, stretch: &Stretch<'_, T>, from: &Progress<T>) -> Result<Taken<T>, Error>;
}

/// A device with the steps that somebody wants to look at.
pub struct Delegate<T> {
    device: Box<dyn StepDevice<T>>,
    pause: u64,
    end: u64,
    /// Steps in about [`SECONDS`].
    pace: u64,
}

/// Time after which a stretch should be over, so that signals are heard.
const SECONDS: f64 = 0.5;

impl<T: Float> Delegate<T> {
    /// A stretch ends at multiples of `pause` steps and at `end`.
    pub fn new(device: Box<dyn StepDevice<T>>, pause: u64, end: u64) -> Self {
        Self { device, pause: pause.max(1), end, pace: 1 }
    }

    /// The name of the device.
    pub fn name(&self) -> &str {
        self.device.name()
    }
}

impl<T: Float> Trainer<'_, T> {
    /// Steps up to the next one at which anything is done beside them.
    pub(super) fn delegated(
        &mut self,
        delegate: &mut Delegate<T>,
        state: &mut State<T>,
    ) -> Result<Outcome, Error> {
        self.refresh(&mut state.now);
        self.objective.model.weigh(state.now.axis);
        let count = self.stretch(delegate, state.now.step);
        let draws = (0..count).map(|k| self.drawn(state.now.step + k)).collect();
        let rates = (0..count).map(|k| self.rate(&state.now, k)).collect();
        let (objective, occupancy) = (&self.objective, self.mask(&state.now));
        let (adam, axis) = (self.training.adam, state.now.axis);
        let stretch = Stretch { objective, adam, axis, occupancy, draws, rates };
        let begun = Instant::now();
        let taken = delegate.device.take(&stretch, &state.now)?;
        let each = begun.elapsed().as_secs_f64() / count as f64;
        delegate.pace = (SECONDS / each.max(1e-9)) as u64;
        self.moved(taken, state)
    }

    /// How many steps to take at once.
    fn stretch(&self, delegate: &Delegate<T>, step: u64) -> u64 {
        let to_multiple = |of: u64| of - step % of;
        let mut count =
            to_multiple(delegate.pause).min(to_multiple(self.training.keep_every.max(1)));
        if let Some(plan) = self.training.occupancy {
            let every = plan.every.max(1);
            let next = match step.checked_sub(plan.warm_up) {
                Some(since) => every - since % every,
                None => plan.warm_up - step,
            };
            count = count.min(next);
        }
        let most = delegate.pace.min(delegate.device.most() as u64);
        count.min(delegate.end.saturating_sub(step)).min(most).max(1)
    }

    fn drawn(&mut self, step: u64) -> Drawn {
        self.choose(step);
        match self.training.batch {
            BatchSize::Pixels(_) => Drawn::Pixels(self.pairs.clone()),
            BatchSize::Frames(_) | BatchSize::All => Drawn::Frames(self.frames.clone()),
        }
    }

    /// Judges the losses as single steps do, and moves on.
    fn moved(&self, taken: Taken<T>, state: &mut State<T>) -> Result<Outcome, Error> {
        let Taken { parameters, moments: [first, second], losses } = taken;
        let begin = state.now.step;
        for (loss, step) in losses.iter().zip(begin..) {
            let calm = state.good.as_ref().map_or(f64::INFINITY, |good| good.loss);
            if !loss.total.is_finite() || loss.total > self.training.divergence * calm {
                return Ok(step_back(state, loss.total, step)?);
            }
            state.now.loss = loss.total;
            if step == begin && step.is_multiple_of(self.training.keep_every.max(1)) {
                state.good = Some(Box::new(state.now.clone()));
            }
        }
        let now = &mut state.now;
        now.step += losses.len() as u64;
        now.adam.steps += losses.len() as u64;
        (now.parameters, now.adam.first, now.adam.second) = (parameters, first, second);
        Ok(Outcome::Done(losses.into_iter().last().unwrap_or_default()))
    }
}
