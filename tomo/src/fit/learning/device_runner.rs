//! Stretches of steps that a device takes, and what is done with what they lead to.

use super::device::{DeviceRunner, Stretch, Taken};
use super::state::{Outcome, State, step_back};
use super::trainer::Trainer;
use super::training::{COMPARED, DIVERGENCE};
use crate::Error;
use std::time::Instant;

/// Time after which a stretch should be over, so that signals are heard.
const SECONDS: f64 = 0.5;

impl Trainer<'_, f32> {
    /// Steps up to the next one at which anything is done beside them.
    pub(in crate::fit) fn delegated(
        &mut self,
        delegate: &mut DeviceRunner,
        state: &mut State<f32>,
    ) -> Result<Outcome, Error> {
        self.refresh(&mut state.now);
        self.objective.model.weigh(state.now.axis);
        let count = self.stretch(delegate, state.now.step);
        let draws = (0..count).map(|k| self.drawn(state.now.step + k)).collect();
        let rates = (0..count).map(|k| self.rate(&state.now, k)).collect();
        let (objective, occupancy) = (&self.objective, self.mask(&state.now));
        let stretch = Stretch { objective, axis: state.now.axis, occupancy, draws, rates };
        let begun = Instant::now();
        let taken = delegate.device.take(&stretch, &state.now)?;
        let each = begun.elapsed().as_secs_f64() / count as f64;
        delegate.pace = (SECONDS / each.max(1e-9)) as u64;
        self.moved(taken, state)
    }

    /// Returns the number of steps to take at once.
    fn stretch(&self, delegate: &DeviceRunner, step: u64) -> u64 {
        let to_multiple = |of: u64| of - step % of;
        // Where a state is looked at, kept or compared with all data, it has to be here: a device
        // gives it back at the end of a stretch alone.
        let pauses = [delegate.pause, self.training.keep_every.max(1), COMPARED];
        let mut count = pauses.into_iter().map(to_multiple).fold(u64::MAX, u64::min);
        if let Some(plan) = self.training.occupancy {
            let every = plan.every.max(1);
            let next = match step.checked_sub(plan.warm_up) {
                Some(since) => every - since % every,
                None => plan.warm_up - step,
            };
            count = count.min(next);
        }
        let most = delegate.pace.min(delegate.device.most() as u64);
        // A step that takes longer than half a second is a stretch of its own.
        count.min(delegate.end.saturating_sub(step)).min(most).max(1)
    }

    /// Judges the losses as single steps do, and moves on.
    fn moved(&self, taken: Taken, state: &mut State<f32>) -> Result<Outcome, Error> {
        let Taken { parameters, moments: [first, second], losses, of_axis } = taken;
        let begin = state.now.step;
        let finite = of_axis.iter().all(|slope| slope.is_finite());
        for (loss, step) in losses.iter().zip(begin..) {
            let calm = state.good.as_ref().map_or(f64::INFINITY, |good| good.loss);
            if !loss.total.is_finite() || !finite || loss.total > DIVERGENCE * calm {
                return Ok(step_back(state, loss.total, step)?);
            }
            state.now.loss = loss.total;
            // Of later steps only losses are known; stretches end at multiples of `keep_every`.
            if step == begin && step.is_multiple_of(self.training.keep_every.max(1)) {
                state.good = Some(Box::new(state.now.clone()));
            }
        }
        let now = &mut state.now;
        // An axis that is learnt has stretches of one step (`StepDevice::most`): this is its rate.
        self.turn(now, of_axis);
        now.step += losses.len() as u64;
        now.adam.steps += losses.len() as u64;
        (now.parameters, now.adam.first, now.adam.second) = (parameters, first, second);
        Ok(Outcome::Done(losses.into_iter().last().unwrap_or_default()))
    }
}
