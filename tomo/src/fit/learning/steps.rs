//! Steps of a fit: what is drawn, what is learnt, what is done when it goes wrong.

use super::state::{Outcome, Progress, State, step_back};
use super::trainer::Trainer;
use super::training::{BatchSize, DIVERGENCE};
use crate::Error;
use crate::fit::Field;
use crate::fit::forward::occupancy::Occupancy;
use crate::fit::loss::objective::{Drawn, Gradients, Loss};
use crate::fit::seeds::mixed_seed;
use kerrlight_common::simd::Float;
use kerrlight_render::dynamics::Axis;
use rand::seq::index;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;

/// Parameters at which a loss is taken.
#[derive(Clone, Copy)]
pub struct Place<'a, T> {
    /// Parameters of the representation.
    pub parameters: &'a [T],
    /// The axis that matter turns about.
    pub axis: Axis,
    /// Outside of it nothing shines.
    pub occupancy: Option<&'a Occupancy>,
    /// Step whose draws are taken.
    pub step: u64,
}

// In single precision, that of programs: what is generic is compiled anew in every program that uses it.
impl Trainer<'_, f32> {
    /// One step. It depends on the state and the settings alone: not on threads, and not on what this trainer did before.
    ///
    /// # Errors
    /// If the loss keeps diverging.
    pub fn step(&mut self, state: &mut State<f32>) -> Result<Outcome, Error> {
        // Taken out while it reads this trainer, and put back even if it fails.
        if let Some(mut delegate) = self.device.take() {
            let outcome = self.delegated(&mut delegate, state);
            self.device = Some(delegate);
            return outcome;
        }
        let now = &mut state.now;
        self.refresh(now);
        let mut of_axis = [0.0; 3];
        let (step, occupancy) = (now.step, self.mask(now));
        let place = Place { parameters: &now.parameters, axis: now.axis, occupancy, step };
        let loss = self.loss(place, &mut of_axis);
        // Before a state is kept no loss is too large, unless it is no number.
        let calm = state.good.as_ref().map_or(f64::INFINITY, |good| good.loss);
        let finite = loss.total.is_finite() && of_axis.iter().all(|slope| slope.is_finite());
        if !finite || loss.total > DIVERGENCE * calm {
            let step = now.step;
            return Ok(step_back(state, loss.total, step)?);
        }
        now.loss = loss.total;
        // Before the step is taken: it is these parameters that have this loss.
        if now.step.is_multiple_of(self.training.keep_every.max(1)) {
            state.good = Some(Box::new(now.clone()));
        }
        self.learn(&mut state.now, of_axis);
        Ok(Outcome::Done(loss))
    }

    pub(in crate::fit) fn refresh(&mut self, now: &mut Progress<f32>) {
        let Some(plan) = self.training.occupancy else { return };
        let Some(mask) = &mut now.occupancy else { return };
        if now.step >= plan.warm_up && (now.step - plan.warm_up).is_multiple_of(plan.every.max(1)) {
            let seed = mixed_seed(self.training.seed, now.step, 1);
            let (representation, parameters) = (self.representation, &now.parameters);
            let times = self.training.change.map_or(Vec::new(), |change| change.knots.times());
            mask.refresh(representation, parameters, seed, &times, self.buffers.workspace());
        }
    }

    /// The mask, once it is used.
    pub(in crate::fit) fn mask<'b>(&self, now: &'b Progress<f32>) -> Option<&'b Occupancy> {
        let masked = self.training.occupancy.is_some_and(|plan| now.step >= plan.warm_up);
        now.occupancy.as_ref().filter(|_| masked)
    }

    fn learn(&mut self, now: &mut Progress<f32>, of_axis: [f64; 3]) {
        let rate = self.rate(now, 0);
        let (gradient, parameters) = (&self.gradient, &mut now.parameters);
        match &self.training.muon {
            Some(muon) => muon.step(rate, gradient, &self.matrices, &mut now.adam, parameters),
            None => now.adam.step(rate, gradient, parameters),
        }
        self.representation.project(&mut now.parameters);
        // The step is counted last: the rates of parameters and axis are those of its number.
        self.turn(now, of_axis);
        now.step += 1;
    }

    /// Turns the axis, if it is learnt.
    pub(in crate::fit) fn turn(&self, now: &mut Progress<f32>, of_axis: [f64; 3]) {
        let Some(axis_rate) = &self.training.axis_rate else { return };
        let mut moved = now.axis.vector();
        let rate = self.part(now, 0) * axis_rate.rate(now.step);
        // Adam's step leaves the sphere; the axis is the direction in which it ends.
        now.axis_adam.step(rate, &of_axis, &mut moved);
        now.axis = Axis::new(moved).unwrap_or(now.axis);
    }

    /// Part of the rates that step number `ahead` from here takes.
    fn part(&self, now: &Progress<f32>, ahead: u64) -> f64 {
        let step = now.step + ahead;
        // The first step moves already, and without a ramp at the full rate.
        ((step + 1) as f64 / (self.training.ramp + 1) as f64).min(1.0) * now.caution
    }

    /// Learning rate of the parameters at step number `ahead` from here.
    pub(in crate::fit) fn rate(&self, now: &Progress<f32>, ahead: u64) -> f64 {
        self.part(now, ahead) * self.training.rate.rate(now.step + ahead)
    }
}

impl<T: Float> Trainer<'_, T> {
    /// The loss of the part of the data that a step looks at, with what change costs. The gradient with respect to the
    /// parameters is [`gradient`](Self::gradient) then; that of the axis is added, if it is learnt.
    pub fn loss(&mut self, place: Place<'_, T>, of_axis: &mut [f64; 3]) -> Loss {
        self.objective.model.weigh(place.axis);
        self.gradient.fill(T::zero());
        let Place { parameters, axis, occupancy, step } = place;
        let field = Field { representation: self.representation, parameters, axis, occupancy };
        let mut loss = self.of_data(field, step, of_axis);
        if let Some(change) = &self.training.change {
            let seed = mixed_seed(self.training.seed, step, 3);
            let (buffers, workspace) = (&mut self.changes, self.buffers.workspace());
            let found =
                change.value_and_gradient(field, seed, &mut self.gradient, buffers, workspace);
            loss.total += found;
            loss.change = Some(found);
        }
        if let Some(quiescent) = self.objective.model.quiescent() {
            loss.total += quiescent.penalty(parameters, &mut self.gradient);
        }
        loss
    }

    /// The gradient with respect to the parameters of the loss that was taken last.
    pub fn gradient(&self) -> &[T] {
        &self.gradient
    }

    fn of_data(&mut self, field: Field<'_, T>, step: u64, of_axis: &mut [f64; 3]) -> Loss {
        let drawn = self.drawn(step);
        let learnt = self.training.learns_axis(self.representation);
        let Self { objective, buffers, gradient, .. } = self;
        let gradients = Gradients { parameters: gradient, axis: learnt.then_some(of_axis) };
        objective.value_and_gradient(field, &drawn, gradients, buffers)
    }

    /// Draws the pairs or frames of a step.
    pub(in crate::fit) fn drawn(&self, step: u64) -> Drawn {
        // Of seed and step alone: a fit that is resumed, or goes back, draws the same.
        let mut random = Pcg64::seed_from_u64(mixed_seed(self.training.seed, step, 0));
        let observed = &self.observed;
        match self.training.batch {
            BatchSize::Pixels(count) => {
                let rays = self.objective.model.rays();
                let pair = |_| {
                    let frame = observed[random.random_range(0..observed.len())];
                    (random.random_range(0..rays) as u32, frame as u32)
                };
                Drawn::Pixels((0..count).map(pair).collect())
            }
            BatchSize::Frames(count) => {
                let count = count.min(observed.len());
                let chosen = index::sample(&mut random, observed.len(), count);
                Drawn::Frames(chosen.into_iter().map(|k| observed[k]).collect())
            }
            BatchSize::All => Drawn::Frames(observed.clone()),
        }
    }
}
