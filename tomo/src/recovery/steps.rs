//! The steps of a representation that is learnt.

use super::progress::{At, Event, Progress};
use super::{Fit, Stopped};
use crate::Error;
use crate::fit::linear::LinearError;
use crate::fit::settings::{FitFile, Loss, LossKind};
use crate::fit::verdict::Outcome;
use crate::fit::{COMPARED, State, Trainer};
use std::time::Instant;

impl Fit<'_, '_> {
    /// All of them, or those after which the model follows noise; an error if it was stopped, after its state was kept.
    pub(super) fn steps(
        &mut self,
        state: &mut State<f32>,
        progress: &mut dyn Progress,
    ) -> Result<(), Error> {
        let steps = self.file.training.steps;
        let mut saved = Instant::now();
        while state.now.step < steps {
            if self.follows_noise(state)? {
                progress.save(state)?;
                return progress.found(Event::FollowsNoise(state.now.step));
            }
            self.solve_leakage(state, progress)?;
            let outcome = match self.trainer.step(state) {
                Ok(outcome) => outcome,
                // The step was not taken: any device may go on from this state.
                Err(Error::Device(error)) => {
                    progress.save(state)?;
                    return Err(error.into());
                }
                Err(error) => return Err(diverged(&mut self.trainer, state, &error)),
            };
            let step = state.now.step;
            let stop = !progress.goes_on(At::Step(step));
            progress.stepped(self, state, outcome)?;
            let late = saved.elapsed().as_secs_f64() > self.file.training.checkpoint_seconds;
            if stop || late || step == steps {
                progress.save(state)?;
                saved = Instant::now();
            }
            if stop {
                return Err(Stopped::After(step).into());
            }
        }
        Ok(())
    }

    /// Returns whether the model explains all data, and some of them better than a right one does: the discrepancy principle
    /// (Morozov 1966, Soviet Mathematics Doklady 7, 414). Nothing tells where gains, leakage or the axis are solved for as well.
    fn follows_noise(&mut self, state: &State<f32>) -> Result<bool, Error> {
        let Self { file, measured, .. } = *self;
        let linear = |loss: &Loss| loss.data == LossKind::Image || loss.data.is_visibilities();
        let is_known = measured.gains.is_none() && measured.leakage.is_none();
        let tells =
            is_known && file.loss.iter().all(linear) && self.trainer.training.axis_rate.is_none();
        let weights: f64 = file.loss.iter().map(|loss| loss.weight).sum();
        let step = state.now.step;
        // The loss is Σ weight · χ²/N. Above Σ weight data are not followed closely on the whole,
        // and the images of all frames need not be computed.
        let may_follow = step > 0 && step.is_multiple_of(COMPARED) && state.now.loss < weights;
        if !tells || !may_follow {
            return Ok(false);
        }
        let frames: Vec<usize> = (0..measured.times.len()).collect();
        let seen = self.trainer.images(&state.now, &frames)?;
        let movie = self.pictured(state, &seen)?;
        let judged = self.judged(state, &seen, &movie)?;
        let explains = judged.verdict.outcome != Outcome::Unexplained;
        Ok(explains && judged.terms.iter().any(|(_, tested)| tested.follows_noise()))
    }

    /// Solves for the leakage beside the present emission before steps at equal intervals, as often as settings say.
    fn solve_leakage(
        &mut self,
        state: &State<f32>,
        progress: &mut dyn Progress,
    ) -> Result<(), Error> {
        let step = state.now.step;
        let due = |interval: u64| step > 0 && step.is_multiple_of(interval);
        if !interval(self.file).is_some_and(due) {
            return Ok(());
        }
        // What comes before cannot be resumed with the leakage that is found now.
        progress.save(state)?;
        let frames: Vec<usize> = (0..self.measured.times.len()).collect();
        let movie = self.trainer.movie(&state.now, &frames, true);
        match self.measured.solve_leakage(&movie)? {
            Some(found) => progress.found(Event::Leakage(Some(step), &found)),
            None => Ok(()),
        }
    }
}

/// Steps of training from one solution for the leakage to the next; none where it is not solved for.
fn interval(file: &FitFile) -> Option<u64> {
    let settings = file.instrument.as_ref()?.leakage?;
    // One interval more than solutions: steps follow the last one, too.
    Some(file.training.steps.div_ceil(settings.rounds as u64 + 1).max(1))
}

/// A fit that cannot go on, with the data that are the reason where one can tell.
fn diverged(trainer: &mut Trainer<'_, f32>, state: &State<f32>, error: &Error) -> Error {
    let frames = trainer.objective.observed();
    if let Some(fault) = trainer.objective.fault() {
        return Error::Failed(fault.to_owned());
    }
    let movie = trainer.images(&state.now, &frames).ok();
    let found = movie.and_then(|movie| trainer.objective.not_finite(&frames, &movie).ok());
    let named = found.flatten().map(named);
    let why = named.map_or(String::new(), |named| format!(": {named}"));
    Error::Failed(format!("{error}{why}"))
}

/// A datum whose residual is not finite, in words.
pub(super) fn named((data, frame, value): (String, usize, f64)) -> String {
    LinearError::NotFinite { data, frame, value }.to_string()
}
