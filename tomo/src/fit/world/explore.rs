//! A search that does not trust slopes: rays that pass next to the critical curve come and go with every small change
//! of the world, so that χ² has ripples on the way to its minimum. Covariance matrix adaptation (Hansen & Ostermeier
//! 2001) looks at populations of worlds instead.

use super::search::{Effort, Estimate, WorldProblem, WorldProgress};
use super::{Parameter, World};
use crate::fit::linear::LinearError;
use crate::simd::Float;
use cmaes::{CMAESOptions, DVector};
use core::f64::consts::TAU;
use std::sync::{Mutex, PoisonError};

/// A world that was looked at.
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
    /// All that were looked at.
    pub samples: Vec<Sample>,
    /// Whether populations had shrunk, rather than too many worlds been looked at.
    pub converged: bool,
}

/// How a world is looked for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Exploration {
    /// Voxels along each axis of the volume that is solved for.
    pub nodes: usize,
    /// Iterations of each solution.
    pub iterations: usize,
    /// Worlds that are looked at from one start, at most.
    pub worlds: usize,
    /// Of the draws.
    pub seed: u64,
}

/// Width of the first population, and of the last, in units of [`Parameter::scale`].
const WIDTHS: [f64; 2] = [1.5, 0.02];
/// Populations whose values differ by less are alike: a tenth of what one standard deviation makes.
const ALIKE: f64 = 0.05;

/// What worlds that are looked at leave behind.
#[derive(Default)]
struct Log {
    samples: Vec<Sample>,
    error: Option<LinearError>,
}

impl<T: Float + Default> WorldProblem<'_, T> {
    /// From a start to the best world that populations find; none if it was cancelled.
    ///
    /// # Errors
    /// If a number is out of its range, or a χ² is not finite.
    pub fn explore(
        &self,
        number: usize,
        start: World,
        how: &Exploration,
    ) -> Result<Option<Explored>, LinearError> {
        let log = Mutex::new(Log::default());
        let look = |u: &DVector<f64>| self.look(&self.place(&start, u.as_slice()), how, &log);
        let mut search = CMAESOptions::new(vec![0.0; self.free.len()], WIDTHS[0])
            .seed(how.seed.wrapping_add(number as u64))
            .max_function_evals(how.worlds)
            .tol_x(WIDTHS[1])
            .tol_fun(ALIKE)
            .tol_fun_hist(ALIKE)
            .build(look)
            .map_err(|_| kerrlight_geodesic::Error::out_of_range("worlds", 0.0, "1 or more"))?;
        let ended = loop {
            if let Some(ended) = search.next_parallel() {
                break ended;
            }
            let best = search.overall_best_individual().map_or(f64::INFINITY, |best| best.value);
            let evaluations = search.function_evals();
            if !(self.watch)(&WorldProgress { start: number, evaluations, best }) {
                return Ok(None);
            }
        };
        let converged = !ended.reasons.contains(&cmaes::TerminationReason::MaxFunctionEvals);
        drop(search);
        let Log { samples, error } = log.into_inner().unwrap_or_else(PoisonError::into_inner);
        if let Some(error) = error {
            return Err(error);
        }
        let best = samples.iter().min_by(|a, b| a.value.total_cmp(&b.value));
        let world = best.map_or(start, |best| best.world);
        let best = self.from_dark(world, how)?;
        Ok(Some(Explored { start, best, samples, converged }))
    }

    fn from_dark(&self, world: World, how: &Exploration) -> Result<Estimate, LinearError> {
        self.solve(world, &vec![0.0; how.nodes.pow(3)], how.nodes, how.iterations)
    }

    fn look(&self, world: &World, how: &Exploration, log: &Mutex<Log>) -> f64 {
        let solved = self.from_dark(*world, how);
        let mut log = log.lock().unwrap_or_else(PoisonError::into_inner);
        match solved {
            Ok(Estimate { value, .. }) => {
                log.samples.push(Sample { world: *world, value });
                value
            }
            Err(error) => {
                log.error.get_or_insert(error);
                f64::INFINITY
            }
        }
    }

    /// The world at a place about another one, in units of [`Parameter::scale`]; bounds are mirrors, a whole circle has
    /// none.
    fn place(&self, about: &World, u: &[f64]) -> World {
        let one = |world: World, (k, free): (usize, &super::Free)| {
            let [low, high] = self.bounds(k);
            let value = about.get(free.parameter) + u[k] * free.parameter.scale();
            let value = if self.is_circle(k) {
                low + (value - low).rem_euclid(TAU)
            } else if low.is_finite() && high.is_finite() {
                mirrored(value, low, high)
            } else {
                value.clamp(low, high)
            };
            world.with(free.parameter, value)
        };
        self.free.iter().enumerate().fold(*about, one)
    }
}

fn mirrored(x: f64, low: f64, high: f64) -> f64 {
    let width = high - low;
    let folded = (x - low).rem_euclid(2.0 * width);
    low + if folded > width { 2.0 * width - folded } else { folded }
}

impl Parameter {
    /// The difference of two values, the short way where it is an angle about a circle.
    pub fn difference(self, a: f64, b: f64) -> f64 {
        match self {
            Parameter::PositionAngle => (a - b + 0.5 * TAU).rem_euclid(TAU) - 0.5 * TAU,
            _ => a - b,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exact_mirrors_keep_values_inside() {
        for (x, expected) in [(0.2, 0.2), (-0.3, 0.3), (1.4, 0.6), (2.3, 0.3), (-1.1, 0.9)] {
            assert!((mirrored(x, 0.0, 1.0) - expected).abs() < 1e-14, "{x}");
        }
        let apart = Parameter::PositionAngle.difference(3.1, -3.1);
        assert!((apart + (TAU - 6.2)).abs() < 1e-14);
    }
}
