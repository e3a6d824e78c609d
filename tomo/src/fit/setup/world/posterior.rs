//! Draws of worlds.

use super::seen::Seen;
use super::sureness::{PATIENCE, surest};
use crate::fit::settings::{FitFile, UnknownWorld, refuse};
use crate::fit::setup::{Measured, Result};
use crate::fit::world::{Effort, Free, Spread, World, WorldProblem};
use nalgebra::{DMatrix, DVector};
use rand::{RngExt, SeedableRng};
use rand_distr::StandardNormal;
use rand_pcg::Pcg64;

/// Of the random numbers of draws.
const DRAWS: u64 = 0x6f70_656e_0000_0000;

/// Why there are no worlds to draw.
const NO_BEST: &str =
    "the data leave a parameter of the world open: there is no best world to draw others around";

/// Worlds that the data leave possible: the volume of each is the best one of data with noise once more, in that world
/// (its marginal distribution, then what is left of the volume: Rue & Held 2005, section 2.3).
pub struct WorldPosterior<'a> {
    file: &'a FitFile,
    measured: &'a Measured,
    free: Vec<Free>,
    world: World,
    /// A root of the covariance, in the parameters' own units.
    root: DMatrix<f64>,
    open: Vec<bool>,
    /// Noise of a draw over the data's errors.
    factor: f64,
}

impl<'a> WorldPosterior<'a> {
    /// About a world that was found, with errors of the data that are `noise_factor` of what they say.
    ///
    /// # Errors
    /// If a setting is missing or out of range, the problem has no solution, or the data leave a parameter open.
    pub fn new(
        file: &'a FitFile,
        measured: &'a Measured,
        unknown: &UnknownWorld,
        (world, noise_factor): (World, f64),
    ) -> Result<Self> {
        let scale = noise_factor.powi(-2);
        let seen = Seen::new(file, measured, &unknown.search.fine)?;
        let (spread, reduced) = seen.with(unknown, &unknown.search.fine, scale, |problem| {
            let iterations = PATIENCE * problem.effort.iterations;
            let effort = Effort { iterations, ..problem.effort };
            let start = WorldProblem { effort, ..*problem }.solve(world)?;
            let (_, reduced, spread) = surest(problem, &start)?;
            Ok((spread, reduced))
        })?;
        let Some(spread) = spread else { refuse!("{NO_BEST}") };
        let factor = noise_factor * reduced.max(1.0).sqrt();
        Self::around((file, measured), unknown, (world, &spread), factor)
    }

    /// About a world whose errors a search has found, in data whose noise is `factor` times their errors: for emission that
    /// changes, whose best volume is another one in each world.
    ///
    /// # Errors
    /// If a prior is out of its range.
    pub fn around(
        (file, measured): (&'a FitFile, &'a Measured),
        unknown: &UnknownWorld,
        (world, spread): (World, &Spread),
        factor: f64,
    ) -> Result<Self> {
        let Spread { open, sigma, correlation, .. } = spread;
        let n = sigma.len();
        let covariance =
            DMatrix::from_fn(n, n, |a, b| correlation[a * n + b] * sigma[a] * sigma[b]);
        let apart = || DMatrix::from_diagonal(&DVector::from_column_slice(sigma));
        let root = covariance.cholesky().map_or_else(apart, |factors| factors.l());
        Ok(Self { file, measured, free: unknown.free()?, world, root, open: open.clone(), factor })
    }

    /// Noise of a draw over the data's errors.
    pub fn factor(&self) -> f64 {
        self.factor
    }

    /// A draw: the same for the same number. What the data say nothing about is drawn from its prior, the rest from a
    /// normal distribution with the covariance of the world; bounds are mirrors.
    pub fn draw(&self, number: u64) -> World {
        let mut random = Pcg64::seed_from_u64(self.file.seed ^ DRAWS.wrapping_add(number));
        let normal = |_, _| random.sample::<f64, _>(StandardNormal);
        let normal = DVector::from_fn(self.free.len(), normal);
        let step = &self.root * normal;
        let shares: Vec<f64> = self.free.iter().map(|_| random.random()).collect();
        let each = self.free.iter().zip(&shares).enumerate();
        each.fold(self.world, |world, (k, (free, share))| {
            let value = match self.open[k] {
                true => free.prior.quantile(*share),
                false => free.mirrored(world.get(free.parameter) + step[k]),
            };
            world.with(free.parameter, value)
        })
    }

    /// Data with noise once more.
    ///
    /// # Errors
    /// If there is no room for them.
    pub fn data(&self, number: u64) -> Result<Measured> {
        self.measured.perturbed(&self.file.loss, self.factor, number)
    }
}
