//! Voxels whose logarithm is a Gaussian field: positive without a bound, bright in few places.
//!
//! The numbers of the nodes are e = exp(m + S z) with white noise z and S Sᵀ the covariance of the field. In z the prior is
//! |z|², so that what data do not tell costs no iterations. The problem is not convex: a descent from e = exp(m) ends at a
//! stationary point.

use super::gaussian::{GaussianField, Matern};
use super::objective::Objective;
use super::operator::Operator;
use super::ray_weights::Voxels;
use super::scaled::Convex;
use super::{Ending, LinearProblem, LinearProgress, LinearSettings, LinearSolution};
use super::{Stationarity, Watch};
use crate::Error;
use crate::optimise::Lbfgs;
use kerrlight_common::simd::Float;

/// A field on the nodes of a grid whose logarithm is Gaussian, with density exp(−|z − center|²/2).
#[derive(Clone, Debug)]
pub struct LogNormalField {
    logarithm: GaussianField,
    /// Waves at which the density is highest, one number for each.
    center: Vec<f64>,
}

impl LogNormalField {
    /// Takes this law of the logarithm at the nodes.
    ///
    /// # Errors
    /// If a number is out of its range.
    pub fn new(law: Matern, voxels: &Voxels) -> Result<Self, Error> {
        let logarithm = GaussianField::at_nodes(law, voxels)?;
        let center = vec![0.0; logarithm.count()];
        Ok(Self { logarithm, center })
    }

    /// Number of nodes.
    pub fn count(&self) -> usize {
        self.center.len()
    }

    /// A field that it gives, emission at the nodes, the same for the same seed.
    pub fn drawn(&self, seed: u64) -> Vec<f64> {
        self.logarithm.drawn(seed).into_iter().map(f64::exp).collect()
    }

    /// The same density about the field that [`drawn`](Self::drawn) gives for a seed.
    #[must_use]
    pub fn about(self, seed: u64) -> Self {
        Self { center: self.logarithm.white(seed), ..self }
    }
}

/// Function that is minimised over white numbers: −2/data times the logarithm of a density.
pub(super) struct Posterior<'a, 'b, T: Float> {
    pub objective: Objective<'a, 'b, T>,
    pub prior: &'b LogNormalField,
    /// Bound below which emission stays.
    pub upper: f64,
}

impl<T: Float> Posterior<'_, '_, T> {
    /// Emission at the nodes.
    pub fn emission(&self, white: &[f64]) -> Vec<f64> {
        let logarithm = self.prior.logarithm.of_white(white).into_iter();
        logarithm.map(|x| x.exp().min(self.upper)).collect()
    }

    /// Its value; overwrites the gradient.
    pub fn value_and_gradient(&mut self, white: &[f64], gradient: &mut [f64]) -> f64 {
        let emission = self.emission(white);
        let mut slopes = Vec::new();
        let of_data = self.objective.value_and_gradient(&emission, &mut slopes);
        for (slope, e) in slopes.iter_mut().zip(&emission) {
            // de/d ln e = e; emission that is held at its bound does not follow its logarithm.
            *slope *= if *e < self.upper { *e } else { 0.0 };
        }
        let share = 1.0 / self.objective.data.count as f64;
        let mut of_prior = 0.0;
        let slopes = self.prior.logarithm.to_white(&slopes);
        let away = white.iter().zip(&self.prior.center).map(|(z, center)| z - center);
        for ((g, slope), away) in gradient.iter_mut().zip(slopes).zip(away) {
            *g = slope + 2.0 * share * away;
            of_prior += share * away * away;
        }
        of_data + of_prior
    }
}

/// Pairs of steps and gradient differences that are kept.
const MEMORY: usize = 16;

/// State of a descent.
struct Place {
    white: Vec<f64>,
    steps: Lbfgs,
    value: f64,
}

impl Place {
    /// The largest number of the gradient.
    fn slope(&self) -> f64 {
        self.steps.gradient.iter().fold(0.0f64, |most, g| most.max(g.abs()))
    }

    /// The length of the gradient.
    fn violation(&self) -> f64 {
        self.steps.gradient.iter().map(|g| g * g).sum::<f64>().sqrt()
    }
}

impl<T: Float> LinearProblem<'_, T> {
    /// The most probable field beside a log-normal prior, from its median. All threads take part; their number does not
    /// change a bit.
    ///
    /// # Errors
    /// If a number is out of its range, data do not fit the rays or none is in the frames, or χ² is not finite.
    pub fn solve_log_normal(
        &self,
        prior: &LogNormalField,
        settings: &LinearSettings,
        watch: &mut Watch<'_>,
    ) -> Result<LinearSolution<T>, Error> {
        self.check(settings)?;
        self.check_prior(prior.count())?;
        // Beside a prior every datum counts as its error says, here as beside a Gaussian one.
        let data = self.data()?.together(self.frames);
        let operator = Operator::new(self.walk(), self.all(), self.frames, settings.memory);
        let objective = Objective::new(&operator, &data, self.penalised(&data));
        let mut posterior = Posterior { objective, prior, upper: self.upper };
        let count = prior.count();
        let steps = Lbfgs::new(count, MEMORY);
        let mut place = Place { white: vec![0.0; count], steps, value: f64::NAN };
        place.value = posterior.value_and_gradient(&place.white, &mut place.steps.gradient);
        let (start, start_slope) = (place.value, place.slope());
        posterior.objective.finite(start, &posterior.emission(&place.white))?;
        // With its gradient it is known: the first step need not evaluate them again.
        place.steps.value = Some(start);
        let ending = posterior.descend(&mut place, settings, watch);
        let emission = posterior.emission(&place.white);
        let value = posterior.objective.finite(place.value, &emission)?;
        let flatness =
            Stationarity { value, start, violation: place.slope(), start_slope, upper: self.upper };
        Ok(LinearSolution {
            emission: emission.into_iter().map(T::of).collect(),
            quiescent: Vec::new(),
            certificate: None,
            stationarity: Some(flatness),
            ending,
            rounds: 1,
            nodes: count,
            evaluations: posterior.objective.evaluations,
            bytes: operator.bytes(),
        })
    }
}

impl<T: Float> Posterior<'_, '_, T> {
    /// Steps until the slope is small enough, none helps, or there have been as many as all rounds have.
    fn descend(
        &mut self,
        place: &mut Place,
        settings: &LinearSettings,
        watch: &mut Watch<'_>,
    ) -> Ending {
        let enough = settings.tolerance * place.violation();
        for _ in 0..settings.rounds * settings.iterations {
            if place.violation() <= enough {
                return Ending::Converged;
            }
            let mut of =
                |white: &[f64], gradient: &mut [f64]| self.value_and_gradient(white, gradient);
            let Some(value) = place.steps.step(&mut of, &mut place.white) else {
                return Ending::Rounding;
            };
            place.value = value;
            let (evaluations, nodes) = (self.objective.evaluations, place.white.len());
            let now = LinearProgress { round: 1, evaluations, value: place.value, nodes };
            if watch(&now).is_break() {
                return Ending::Cancelled;
            }
        }
        Ending::Exhausted
    }
}
