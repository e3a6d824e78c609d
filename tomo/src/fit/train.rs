//! Steps of a fit: what is drawn, what is learnt, what is done when it goes wrong.

use super::objective::{Gradients, Loss, Objective, Room, Selection};
use super::occupancy::{Occupancy, OccupancySettings};
use super::sightlines::Region;
use super::{Field, is_turned};
use crate::dynamics::Axis;
use crate::optimise::{Adam, AdamState, Polynomial};
use crate::representation::Representation;
use crate::simd::Scalar;
use rand::seq::index;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;

/// What a step looks at.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BatchSize {
    /// That many random (ray, frame) pairs; for images alone.
    Pixels(usize),
    /// That many random frames, whole.
    Frames(usize),
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
    /// Rates of the parameters.
    pub rate: Polynomial,
    /// Rates of the axis; without them it is held.
    pub axis_rate: Option<Polynomial>,
    /// Steps over which rates grow to what they are: the first steps of Adam, whose memory is empty, are
    /// as long as the rate allows, and would undo a good start.
    pub ramp: u64,
    /// Part of the data of a step.
    pub batch: BatchSize,
    /// Mask of what shines, if any.
    pub occupancy: Option<OccupancyPlan>,
    /// Where emission is looked for.
    pub region: Region,
    /// Steps from one good state that is kept to the next.
    pub keep_every: u64,
    /// A loss this much larger than that of the kept state is a divergence.
    pub divergence: f64,
}

/// What of a fit goes on from step to step.
#[derive(Clone, Debug, PartialEq)]
pub struct Progress<T> {
    /// Steps taken.
    pub step: u64,
    /// Parameters of the representation.
    pub parameters: Vec<T>,
    /// What Adam remembers of them.
    pub adam: AdamState<T>,
    /// The axis.
    pub axis: Axis,
    /// What Adam remembers of it.
    pub axis_adam: AdamState<f64>,
    /// Mask of what shines.
    pub occupancy: Option<Occupancy>,
    /// Factor on the rates: halved at each divergence.
    pub caution: f64,
    /// Loss of the last step.
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
}

/// Why a fit cannot go on.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[error(
    "the loss is {loss} at step {step}, after {setbacks} returns to earlier steps at ever smaller rates"
)]
pub struct Diverged {
    /// The last loss.
    pub loss: f64,
    /// The step.
    pub step: u64,
    /// Returns.
    pub setbacks: u32,
}

/// Most returns of a fit.
const MOST_SETBACKS: u32 = 12;

impl<T: Scalar> State<T> {
    /// The start of a fit.
    pub fn new(representation: &dyn Representation<T>, axis: Axis, training: &Training) -> Self {
        let count = representation.parameters();
        let mut parameters = vec![T::zero(); count];
        representation.initialise(training.seed, &mut parameters);
        let mask = |plan: OccupancyPlan| Occupancy::new(plan.settings, training.region);
        let now = Progress {
            step: 0,
            parameters,
            adam: AdamState::new(count),
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
    observed: Vec<usize>,
    room: Room<T>,
    gradient: Vec<T>,
    pairs: Vec<(u32, u32)>,
}

impl<'a, T: Scalar> Trainer<'a, T> {
    /// A fit of a representation.
    pub fn new(
        objective: Objective<T>,
        representation: &'a dyn Representation<T>,
        training: Training,
    ) -> Self {
        let (observed, gradient) =
            (objective.observed(), vec![T::zero(); representation.parameters()]);
        let (room, pairs) = (Room::default(), Vec::new());
        Self { objective, representation, training, observed, room, gradient, pairs }
    }

    /// One step. It depends on the state and the settings alone: not on threads, and not on what
    /// this trainer did before.
    ///
    /// # Errors
    /// If the loss keeps diverging.
    pub fn step(&mut self, state: &mut State<T>) -> Result<Outcome, Diverged> {
        let now = &mut state.now;
        self.refresh(now);
        let mut of_axis = [0.0; 3];
        let loss = self.loss(now, &mut of_axis);
        let calm = state.good.as_ref().map_or(f64::INFINITY, |good| good.loss);
        let finite = loss.total.is_finite() && of_axis.iter().all(|slope| slope.is_finite());
        if !finite || loss.total > self.training.divergence * calm {
            return step_back(state, loss.total);
        }
        now.loss = loss.total;
        if now.step.is_multiple_of(self.training.keep_every.max(1)) {
            state.good = Some(Box::new(now.clone()));
        }
        self.learn(&mut state.now, of_axis);
        Ok(Outcome::Done(loss))
    }

    fn refresh(&mut self, now: &mut Progress<T>) {
        let Some(plan) = self.training.occupancy else { return };
        let Some(mask) = &mut now.occupancy else { return };
        if now.step >= plan.warm_up && (now.step - plan.warm_up).is_multiple_of(plan.every.max(1)) {
            let seed = mix(self.training.seed, now.step, 1);
            let (representation, parameters) = (self.representation, &now.parameters);
            mask.refresh(representation, parameters, seed, self.room.workspace());
        }
    }

    fn loss(&mut self, now: &Progress<T>, of_axis: &mut [f64; 3]) -> Loss {
        self.objective.chain.weigh(now.axis);
        self.gradient.fill(T::zero());
        let learnt = self.training.axis_rate.is_some() && is_turned(self.representation);
        let masked = self.training.occupancy.is_some_and(|plan| now.step >= plan.warm_up);
        let field = Field {
            representation: self.representation,
            parameters: &now.parameters,
            axis: now.axis,
            occupancy: now.occupancy.as_ref().filter(|_| masked),
        };
        let gradients =
            Gradients { parameters: &mut self.gradient, axis: learnt.then_some(of_axis) };
        let mut random = Pcg64::seed_from_u64(mix(self.training.seed, now.step, 0));
        match self.training.batch {
            BatchSize::Pixels(count) => {
                let (rays, frames) = (self.objective.chain.rays(), &self.observed);
                self.pairs.clear();
                self.pairs.extend((0..count).map(|_| {
                    let frame = frames[random.random_range(0..frames.len())];
                    (random.random_range(0..rays) as u32, frame as u32)
                }));
                let pixels = Selection::Pixels(&self.pairs);
                self.objective.value_and_gradient(field, pixels, gradients, &mut self.room)
            }
            BatchSize::Frames(count) => {
                let count = count.min(self.observed.len());
                let chosen = index::sample(&mut random, self.observed.len(), count);
                let frames: Vec<usize> = chosen.into_iter().map(|k| self.observed[k]).collect();
                let frames = Selection::Frames(&frames);
                self.objective.value_and_gradient(field, frames, gradients, &mut self.room)
            }
        }
    }

    fn learn(&mut self, now: &mut Progress<T>, of_axis: [f64; 3]) {
        let Training { adam, rate, axis_rate, ramp, .. } = &self.training;
        let part = ((now.step + 1) as f64 / (ramp + 1) as f64).min(1.0) * now.caution;
        let rate = part * rate.rate(now.step);
        adam.step(rate, &self.gradient, &mut now.adam, &mut now.parameters);
        self.representation.project(&mut now.parameters);
        if let Some(axis_rate) = axis_rate {
            let mut moved = now.axis.vector();
            let rate = part * axis_rate.rate(now.step);
            adam.step(rate, &of_axis, &mut now.axis_adam, &mut moved);
            now.axis = Axis::new(moved).unwrap_or(now.axis);
        }
        now.step += 1;
    }

    /// The movie of these frames, with the mask of what shines or without.
    pub fn movie(&mut self, now: &Progress<T>, frames: &[usize], masked: bool) -> Vec<T> {
        self.objective.chain.weigh(now.axis);
        let mut movie = vec![T::zero(); frames.len() * self.objective.chain.pixels()];
        let field = Field {
            representation: self.representation,
            parameters: &now.parameters,
            axis: now.axis,
            occupancy: now.occupancy.as_ref().filter(|_| masked),
        };
        self.objective.movie(field, frames, &mut self.room, &mut movie);
        movie
    }

    /// Emission at points at the reference time.
    pub fn emission(&mut self, now: &Progress<T>, points: [&[T]; 3]) -> Vec<T> {
        self.room.emission(self.representation, &now.parameters, points)
    }
}

fn step_back<T: Scalar>(state: &mut State<T>, loss: f64) -> Result<Outcome, Diverged> {
    let diverged = Diverged { loss, step: state.now.step, setbacks: state.setbacks };
    let Some(good) = &mut state.good else { return Err(diverged) };
    if state.setbacks >= MOST_SETBACKS {
        return Err(diverged);
    }
    state.setbacks += 1;
    good.caution *= 0.5;
    state.now = (**good).clone();
    Ok(Outcome::SteppedBack { loss, to: good.step, caution: good.caution })
}

/// A seed for what a step draws.
fn mix(seed: u64, step: u64, purpose: u64) -> u64 {
    // SplitMix64's finaliser (Steele, Lea & Flood 2014).
    let mut x = seed ^ step.wrapping_mul(0x9E37_79B9_7F4A_7C15) ^ purpose << 62;
    x = (x ^ (x >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    x = (x ^ (x >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    x ^ (x >> 31)
}
