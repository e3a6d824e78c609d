//! A search that does not trust slopes: rays that pass next to the critical curve come and go with every small change
//! of the world, so that χ² has ripples on the way to its minimum. Covariance matrix adaptation (Hansen & Ostermeier
//! 2001) looks at populations of worlds instead.

use super::World;
use super::problem::{Estimate, WorldProblem};
use crate::Error;
use crate::simd::Float;
use cmaes::{CMAESOptions, DVector, TerminationReason};
use std::sync::{Mutex, PoisonError};

/// A world that was evaluated.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sample {
    /// The world.
    pub world: World,
    /// −ln of the posterior density up to a constant, with the volume solved for.
    pub value: f64,
}

/// Where an exploration began and ended.
#[derive(Clone, Debug)]
pub struct Explored {
    /// The first world.
    pub start: World,
    /// The best one.
    pub best: Estimate,
    /// All worlds that were evaluated.
    pub samples: Vec<Sample>,
    /// Whether populations had shrunk, rather than the limit on worlds been reached.
    pub converged: bool,
}

/// How a world is looked for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Exploration {
    /// Standard deviation of the first population in units of [`Parameter::scale`](super::Parameter::scale).
    pub width: f64,
    /// Largest number of worlds to evaluate.
    pub worlds: usize,
    /// Of the draws.
    pub seed: u64,
}

/// Told the number of worlds and the least value so far; says whether to go on.
pub type WorldWatch<'a> = dyn FnMut(usize, f64) -> bool + 'a;

/// Width of the last population, in the same units.
const NARROW: f64 = 0.02;
/// Populations whose values differ by less are alike: a tenth of what one standard deviation makes.
const ALIKE: f64 = 0.05;

/// Record of the worlds that were evaluated.
#[derive(Default)]
struct Log {
    samples: Vec<Sample>,
    error: Option<Error>,
}

impl<T: Float + Default> WorldProblem<'_, T> {
    /// From a start to the best world that populations find; none if it was cancelled. The same for the same seed on
    /// any number of threads.
    ///
    /// # Errors
    /// If a number is out of its range, or a χ² is not finite.
    pub fn explore(
        &self,
        start: World,
        how: &Exploration,
        watch: &mut WorldWatch<'_>,
    ) -> Result<Option<Explored>, Error> {
        let log = Mutex::new(Log::default());
        let look = |u: &DVector<f64>| self.look(self.place(&start, u.as_slice()), &log);
        let options = CMAESOptions::new(vec![0.0; self.free.len()], how.width)
            .seed(how.seed)
            .max_function_evals(how.worlds)
            .tol_x(NARROW)
            .tol_fun(ALIKE)
            .tol_fun_hist(ALIKE);
        let mut search = options.build(look).map_err(|_| {
            let allowed = "above 0, with at least one free parameter";
            Error::out_of_range("width of the population", how.width, allowed)
        })?;
        let ended = loop {
            if let Some(ended) = search.next_parallel() {
                break ended;
            }
            let best = search.overall_best_individual().map_or(f64::INFINITY, |best| best.value);
            if !watch(search.function_evals(), best) {
                return Ok(None);
            }
        };
        let converged = !ended.reasons.contains(&TerminationReason::MaxFunctionEvals);
        drop(search);
        let Log { mut samples, error } = log.into_inner().unwrap_or_else(PoisonError::into_inner);
        if let Some(error) = error {
            return Err(error);
        }
        // Threads look in any order.
        samples.sort_by(|a, b| a.value.total_cmp(&b.value));
        let best = self.solve(samples.first().map_or(start, |best| best.world))?;
        Ok(Some(Explored { start, best, samples, converged }))
    }

    fn look(&self, world: World, log: &Mutex<Log>) -> f64 {
        let solved = self.solve(world);
        let mut log = log.lock().unwrap_or_else(PoisonError::into_inner);
        match solved {
            Ok(Estimate { value, .. }) => {
                log.samples.push(Sample { world, value });
                value
            }
            Err(error) => {
                log.error.get_or_insert(error);
                f64::INFINITY
            }
        }
    }
}
