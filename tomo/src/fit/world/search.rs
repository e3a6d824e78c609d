//! The world that data are most probable in, with the volume solved for: variable projection (Golub & Pereyra 1973) by
//! Gauss–Newton steps with Levenberg's and Marquardt's damping, from starts all over the prior.

use super::matrix::{cholesky_solve, inverse};
use super::{Parameter, Prior, World, WorldBuffers, WorldModel};
use crate::fit::linear::{
    Chosen, Inner, LinearError, LinearProblem, Prior as Penalty, Voxels, Weighted, refined,
};
use crate::fit::{Field, ForwardModel};
use crate::simd::Float;
use rayon::prelude::*;

/// A parameter that is not known.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Free {
    /// Which.
    pub parameter: Parameter,
    /// What is thought of it before.
    pub prior: Prior,
}

/// The data of a search, and what is looked for in them.
#[derive(Clone, Copy)]
pub struct WorldProblem<'a, T: Float> {
    /// The screen and what all worlds share.
    pub model: &'a WorldModel,
    /// Values of the parameters that are known.
    pub known: World,
    /// The others.
    pub free: &'a [Free],
    /// The frames of the movie that count.
    pub frames: &'a [usize],
    /// The data, each with the factor on its χ² times its number of data: the loss is then a sum of χ².
    pub terms: &'a [Weighted<'a, T>],
    /// Half the width of the grid, M.
    pub half_width: f64,
    /// The largest emission that is allowed.
    pub upper: f64,
    /// Penalties on the volume, in units of χ².
    pub penalties: &'a [Penalty],
    /// Told of each evaluation; says whether to go on.
    pub watch: &'a (dyn Fn(&WorldProgress) -> bool + Sync),
}

/// What is known while a search goes on.
#[derive(Clone, Copy, Debug)]
pub struct WorldProgress {
    /// Which of the starts, from 0.
    pub start: usize,
    /// Volumes that were solved for so far from it.
    pub evaluations: usize,
    /// The least value so far from it.
    pub best: f64,
}

/// How a volume is solved for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Effort {
    /// Voxels along each axis.
    pub nodes: usize,
    /// Iterations from a volume that is not near.
    pub first: usize,
    /// Iterations from the volume of a world close by.
    pub again: usize,
    /// Iterations by which voxels follow the world.
    pub follow: usize,
    /// Steps of the world.
    pub steps: usize,
}

/// A world with the volume that explains the data best in it.
#[derive(Clone, Debug)]
pub struct Estimate {
    /// The world.
    pub world: World,
    /// Values at all voxels.
    pub x: Vec<f64>,
    /// Voxels along each axis.
    pub nodes: usize,
    /// χ² and the volume's penalties.
    pub chi2: f64,
    /// Half of that, and −ln of the priors' densities.
    pub value: f64,
}

/// A search's end.
#[derive(Clone, Debug)]
pub struct Found {
    /// Where it began.
    pub start: World,
    /// Where it ended.
    pub end: Estimate,
    /// Second derivatives of the value there, with the voxels following, in the order of the free parameters.
    pub curvature: Vec<f64>,
    /// Volumes that were solved for.
    pub evaluations: usize,
    /// Whether steps became short, rather than too many.
    pub converged: bool,
}

/// First and second derivatives of the value, and how voxels follow.
struct Slopes {
    gradient: Vec<f64>,
    curvature: Vec<f64>,
    follows: Vec<Vec<f64>>,
}

/// Damping to begin with, and the largest.
const DAMPING: [f64; 2] = [1e-2, 1e4];
/// Longest step, in units of [`Parameter::scale`].
const LONGEST: f64 = 1.5;
/// Steps shorter than this part of the scale are the last.
const SHORTEST: f64 = 2e-3;
/// Convergence of inner solutions.
const TOLERANCE: f64 = 1e-4;

impl<T: Float + Default> WorldProblem<'_, T> {
    /// Places to begin: shares of the priors by an additive recurrence in all dimensions (Roberts 2018), the first one
    /// in the middle.
    pub fn starts(&self, count: usize) -> Vec<World> {
        let dimensions = self.free.len() as f64;
        // The positive root of x^(d + 1) = x + 1.
        let root = (0..64).fold(2.0f64, |x, _| (1.0 + x).powf(1.0 / (dimensions + 1.0)));
        let start = |k: usize| {
            let share = |d: usize| (0.5 + k as f64 * root.powi(-(d as i32 + 1))).fract();
            let free = self.free.iter().enumerate();
            free.fold(self.known, |world, (d, free)| {
                world.with(free.parameter, free.prior.quantile(share(d)))
            })
        };
        (0..count).map(start).collect()
    }

    /// From a start to where the value is least near it, with a volume from before or none; none if it was cancelled.
    ///
    /// # Errors
    /// If a number is out of its range, or a χ² is not finite.
    pub fn descend(
        &self,
        number: usize,
        start: World,
        volume: Option<&Estimate>,
        effort: &Effort,
    ) -> Result<Option<Found>, LinearError> {
        let x = match volume {
            Some(from) => self.volume(from, effort.nodes)?,
            None => vec![0.0; effort.nodes.pow(3)],
        };
        let mut best = self.solve(start, &x, effort.nodes, effort.first)?;
        let (mut damping, mut evaluations, mut converged) = (DAMPING[0], 1, false);
        let mut slopes = self.slopes(&best, effort)?;
        for _ in 0..effort.steps {
            let progress = WorldProgress { start: number, evaluations, best: best.value };
            if !(self.watch)(&progress) {
                return Ok(None);
            }
            let Some(step) = self.step(&best.world, &slopes, damping) else { break };
            let next = self.moved(&best, &step, &slopes, effort)?;
            evaluations += 1;
            let shortest = self.length(&step) < SHORTEST;
            if next.value < best.value {
                best = next;
                damping *= 0.2;
                slopes = self.slopes(&best, effort)?;
            } else {
                damping *= 10.0;
            }
            converged = shortest || damping > DAMPING[1];
            if converged {
                break;
            }
        }
        let curvature = slopes.curvature;
        Ok(Some(Found { start, end: best, curvature, evaluations, converged }))
    }

    /// The volume of an estimate on another grid.
    fn volume(&self, from: &Estimate, nodes: usize) -> Result<Vec<f64>, LinearError> {
        if from.nodes == nodes {
            return Ok(from.x.clone());
        }
        Ok(refined(&self.voxels(from.nodes), &from.x, &self.voxels(nodes))?)
    }

    fn voxels(&self, nodes: usize) -> Voxels {
        Voxels::cube(nodes, self.half_width)
    }

    fn inner<'a>(&'a self, forward: &'a ForwardModel<T>, nodes: usize) -> LinearProblem<'a, T> {
        LinearProblem {
            model: forward,
            axis: self.model.axis,
            frames: self.frames,
            terms: self.terms,
            voxels: self.voxels(nodes),
            upper: self.upper,
            flux: None,
            priors: self.penalties,
        }
    }

    /// The best volume of a world.
    ///
    /// # Errors
    /// If a number is out of its range, or χ² is not finite.
    pub fn solve(
        &self,
        world: World,
        start: &[f64],
        nodes: usize,
        iterations: usize,
    ) -> Result<Estimate, LinearError> {
        let forward = self.model.forward(&world)?;
        let active = vec![true; start.len()];
        let chosen = Chosen { start, active: &active, iterations, tolerance: TOLERANCE };
        let Inner { x, value } = self.inner(&forward, nodes).solve_from(chosen)?;
        let penalty = |free: &Free| free.prior.penalty(world.get(free.parameter))[0];
        let penalties: f64 = self.free.iter().map(penalty).sum();
        Ok(Estimate { world, x, nodes, chi2: value, value: 0.5 * value + penalties })
    }

    fn slopes(&self, at: &Estimate, effort: &Effort) -> Result<Slopes, LinearError> {
        let parameters: Vec<Parameter> = self.free.iter().map(|free| free.parameter).collect();
        let (forward, tangents) = self.model.differentiated::<T>(&at.world, &parameters)?;
        let (grid, x) = (self.voxels(at.nodes).grid()?, rounded::<T>(&at.x));
        let axis = self.model.axis;
        let field = Field { representation: &grid, parameters: &x, axis, occupancy: None };
        let image = |buffers: &mut WorldBuffers<T>, frame: &usize| {
            forward.image_tangents(field, *frame, &tangents, buffers)
        };
        let images: Vec<Vec<Vec<T>>> =
            self.frames.par_iter().map_init(WorldBuffers::default, image).collect();
        let active = vec![true; at.x.len()];
        let inner = self.inner(&forward, at.nodes);
        let response = inner.response(&at.x, &active, &images, effort.follow)?;
        let half = |matrix: Vec<f64>| matrix.into_iter().map(|x| 0.5 * x).collect::<Vec<f64>>();
        let (mut gradient, mut curvature) = (half(response.gradient), half(response.reduced));
        for (k, free) in self.free.iter().enumerate() {
            let [_, slope, bend] = free.prior.penalty(at.world.get(free.parameter));
            gradient[k] += slope;
            curvature[k * self.free.len() + k] += bend.max(0.0);
        }
        Ok(Slopes { gradient, curvature, follows: response.follows })
    }

    /// A damped step; none if nothing can move. Parameters at a bound that want to leave it stay there.
    fn step(&self, world: &World, slopes: &Slopes, damping: f64) -> Option<Vec<f64>> {
        let n = self.free.len();
        let mut held = vec![false; n];
        loop {
            let free: Vec<usize> = (0..n).filter(|k| !held[*k]).collect();
            let scale = |k: usize| self.free[k].parameter.scale();
            let mut matrix = Vec::with_capacity(free.len() * free.len());
            for row in &free {
                for column in &free {
                    let bend = slopes.curvature[row * n + column] * scale(*row) * scale(*column);
                    let floor = if row == column { damping * bend.abs() + 1e-9 } else { 0.0 };
                    matrix.push(bend + floor);
                }
            }
            let right: Vec<f64> = free.iter().map(|k| -slopes.gradient[*k] * scale(*k)).collect();
            let solved = cholesky_solve(&matrix, &right)?;
            let mut step = vec![0.0; n];
            free.iter().zip(&solved).for_each(|(k, x)| step[*k] = x * scale(*k));
            let shrink = (LONGEST / self.length(&step).max(1e-300)).min(1.0);
            step.iter_mut().for_each(|x| *x *= shrink);
            let leaves = free.iter().find(|k| self.is_stuck(world, **k, step[**k]));
            match leaves {
                Some(k) => held[*k] = true,
                None if free.is_empty() => return None,
                None => return Some(step),
            }
        }
    }

    /// Whether a parameter is at a bound that the step would leave.
    fn is_stuck(&self, world: &World, k: usize, step: f64) -> bool {
        let ([low, high], value) = (self.bounds(k), world.get(self.free[k].parameter));
        !self.is_circle(k) && ((value <= low && step < 0.0) || (value >= high && step > 0.0))
    }

    pub(super) fn bounds(&self, k: usize) -> [f64; 2] {
        let Free { parameter, prior } = self.free[k];
        let ([low, high], [least, most]) = (parameter.range(), prior.bounds());
        [low.max(least), high.min(most)]
    }

    /// Whether a position angle may be anything.
    pub(super) fn is_circle(&self, k: usize) -> bool {
        let [low, high] = self.bounds(k);
        self.free[k].parameter == Parameter::PositionAngle
            && high - low > core::f64::consts::TAU - 1e-6
    }

    fn length(&self, step: &[f64]) -> f64 {
        let pairs = self.free.iter().zip(step);
        pairs.map(|(free, x)| (x / free.parameter.scale()).powi(2)).sum::<f64>().sqrt()
    }

    /// A world a step away, with the volume that follows.
    fn moved(
        &self,
        from: &Estimate,
        step: &[f64],
        slopes: &Slopes,
        effort: &Effort,
    ) -> Result<Estimate, LinearError> {
        let (mut world, mut x) = (from.world, from.x.clone());
        for (k, free) in self.free.iter().enumerate() {
            let ([low, high], value) = (self.bounds(k), world.get(free.parameter) + step[k]);
            let value = if self.is_circle(k) {
                low + (value - low).rem_euclid(core::f64::consts::TAU)
            } else {
                value.clamp(low, high)
            };
            world = world.with(free.parameter, value);
            x.iter_mut().zip(&slopes.follows[k]).for_each(|(x, by)| *x += step[k] * by);
        }
        x.iter_mut().for_each(|x| *x = x.clamp(0.0, self.upper));
        self.solve(world, &x, from.nodes, effort.again)
    }
}

impl Found {
    /// Covariance of the free parameters by the curvature (Laplace); none where the data and priors leave a
    /// direction open.
    pub fn covariance(&self) -> Option<Vec<f64>> {
        inverse(&self.curvature)
    }
}

fn rounded<T: Float>(x: &[f64]) -> Vec<T> {
    x.iter().map(|x| T::of(*x)).collect()
}
