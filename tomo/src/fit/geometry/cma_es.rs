//! A search that does not trust slopes: rays that pass next to the critical curve come and go with every small change
//! of the geometry, so that χ² has ripples on the way to its minimum. Covariance matrix adaptation (Hansen & Ostermeier
//! 2001) looks at populations of geometries instead.

use super::Geometry;
use super::problem::{Estimate, GeometryProblem};
use crate::Error;
use cmaes::{CMAESOptions, DVector};
use kerrlight_common::simd::Float;
use std::sync::{Mutex, PoisonError, RwLock};

/// A geometry that was evaluated.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sample {
    /// The geometry.
    pub geometry: Geometry,
    /// −ln of the posterior density up to a constant, with the volume solved for.
    pub value: f64,
}

/// Begin and end of an exploration.
#[derive(Clone, Debug)]
pub struct Explored {
    /// The first geometry.
    pub start: Geometry,
    /// The best one.
    pub best: Estimate,
    /// All geometries that were evaluated.
    pub samples: Vec<Sample>,
    /// Minimum that is expected from there, if it is known: populations alone do not say so.
    pub further: Option<Geometry>,
}

/// Settings of an exploration.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Exploration {
    /// Standard deviation of the first population in units of [`Parameter::scale`](super::Parameter::scale).
    pub width: f64,
    /// Largest number of geometries to evaluate.
    pub trials: usize,
    /// Seed of the draws.
    pub seed: u64,
}

/// Told the number of geometries and the least value so far; says whether to go on.
pub type TrialWatch<'a> = dyn FnMut(usize, f64) -> bool + 'a;

/// Width of the last population, in the same units.
const NARROW: f64 = 0.02;
/// Populations whose values differ by less are alike: a tenth of what one standard deviation makes.
const ALIKE: f64 = 0.05;

/// Record of the geometries that were evaluated.
#[derive(Default)]
struct Log {
    samples: Vec<Sample>,
    error: Option<Error>,
    /// Best geometry so far, where data are not convex.
    best: Option<Estimate>,
}

impl<T: Float> GeometryProblem<'_, T> {
    /// Explores from a start to the best geometry that populations find; none if it was cancelled. The same for the same seed
    /// on any number of threads.
    ///
    /// Where data are convex, the volume of each geometry is solved for from a dark one. Others have several minima, which only
    /// many starts tell apart: there volumes follow, population by population, the best one so far, at first that of lit
    /// fields in the first geometry, or one that is given.
    ///
    /// # Errors
    /// If a number is out of its range, or a χ² is not finite.
    pub fn explore(
        &self,
        start: Geometry,
        volume: Option<&[f64]>,
        how: &Exploration,
        watch: &mut TrialWatch<'_>,
    ) -> Result<Option<Explored>, Error> {
        let followed = match (self.is_convex(), volume) {
            (true, _) => None,
            (false, Some(volume)) => Some(self.solve_from(start, volume)?),
            (false, None) => Some(self.solve(start)?),
        };
        let log = Mutex::new(Log { best: followed.clone(), ..Log::default() });
        let followed = RwLock::new(followed);
        let look = |u: &DVector<f64>| {
            let from = followed.read().unwrap_or_else(PoisonError::into_inner);
            self.look(self.place(&start, u.as_slice()), from.as_ref(), &log)
        };
        let options = CMAESOptions::new(vec![0.0; self.free.len()], how.width)
            .seed(how.seed)
            .max_function_evals(how.trials)
            .tol_x(NARROW)
            .tol_fun(ALIKE)
            .tol_fun_hist(ALIKE);
        let mut search = options.build(look).map_err(|_| {
            let allowed = "above 0, with at least one free parameter";
            Error::out_of_range("width of the population", how.width, allowed)
        })?;
        while search.next_parallel().is_none() {
            // Between populations only: within one the best so far depends on the order of threads.
            followed.write().unwrap_or_else(PoisonError::into_inner).clone_from(&best_of(&log));
            let best = search.overall_best_individual().map_or(f64::INFINITY, |best| best.value);
            if !watch(search.function_evals(), best) {
                return Ok(None);
            }
        }
        drop(search);
        let log = log.into_inner().unwrap_or_else(PoisonError::into_inner);
        let Log { mut samples, error, best } = log;
        if let Some(error) = error {
            return Err(error);
        }
        // Threads look in any order.
        samples.sort_by(|a, b| a.value.total_cmp(&b.value));
        let best = match best {
            Some(best) => best,
            // Values of convex data, which may be recalled, are kept without their volumes.
            None => self.solve(samples.first().map_or(start, |best| best.geometry))?,
        };
        Ok(Some(Explored { start, best, samples, further: None }))
    }

    fn look(&self, geometry: Geometry, from: Option<&Estimate>, log: &Mutex<Log>) -> f64 {
        // Where volumes follow the search, they have to be known as well: nothing is recalled.
        let solved = match from {
            Some(from) => {
                self.solve_from(geometry, &from.x).map(|found| (found.value, Some(found)))
            }
            None => self.recalled(geometry).map(|value| (value, None)),
        };
        let mut log = log.lock().unwrap_or_else(PoisonError::into_inner);
        match solved {
            Ok((value, found)) => {
                log.samples.push(Sample { geometry, value });
                if log.best.as_ref().is_some_and(|best| value < best.value) {
                    log.best = found;
                }
                value
            }
            Err(error) => {
                // Populations take numbers alone: the first error is told when they have ended.
                log.error.get_or_insert(error);
                f64::INFINITY
            }
        }
    }

    /// The value of a geometry that is solved for, or was by an earlier search.
    fn recalled(&self, geometry: Geometry) -> Result<f64, Error> {
        let free: Vec<_> = self.free.iter().map(|free| free.parameter.name()).collect();
        let effort = format!("{:?}", self.effort);
        // Bit by bit: a search that goes on from its journal has to end with the same bytes.
        let of = (geometry.bits(), free, effort, self.frames, self.scale.to_bits());
        self.memory.number(of, || Ok(self.solve(geometry)?.value))
    }
}

fn best_of(log: &Mutex<Log>) -> Option<Estimate> {
    log.lock().unwrap_or_else(PoisonError::into_inner).best.clone()
}
