//! How sure a world is: second derivatives, other rays and voxels, and worlds found in data of known worlds.

use super::seen::Seen;
use crate::fit::settings::{FitFile, UnknownWorld, refuse};
use crate::fit::setup::{Measured, Result};
use crate::fit::world::{Effort, Estimate, Polish, Polished, Spread, World, WorldProblem};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;

/// Other rays that the best world is looked for through.
const LATTICES: u64 = 4;
/// Steps to the best world of other data, or through other rays.
const STEPS: usize = 3;
/// Of the random numbers for what the data leave open.
const OPEN_DRAWS: u64 = 0x6f70_656e_0000_0000;
/// Iterations of the first solution of a world, for each of a search.
const PATIENCE: usize = 4;
/// The number of a draw that has as many voxels as the fit.
const SAME: u64 = 0;

/// The best world near another one, and its χ²/N.
pub(super) fn polished(
    problem: &WorldProblem<'_, f32>,
    start: &Estimate,
) -> Result<(Polished, f64)> {
    let polished = problem.polish(start, &Polish::default())?;
    let reduced = problem.scale * problem.reduced(polished.best.chi2);
    Ok((polished, reduced))
}

/// A world's best volume with other voxels, and from there its best world through other rays: what is left of both
/// where the data do not decide. Beside a prior, which says what is left, the voxels stay the same.
fn otherwise(problem: &WorldProblem<'_, f32>, polished: &Polished, number: u64) -> Result<World> {
    let model = problem.model.seen_along(number);
    let effort = other_voxels(problem.effort, problem.gaussian.map_or(number, |_| SAME));
    let other = WorldProblem { model: &model, effort, ..*problem };
    let start = other.solve(polished.best.world)?;
    // Those of other voxels are not known.
    let is_same = other.effort.nodes == problem.effort.nodes;
    let responses = if is_same { polished.responses.clone() } else { Vec::new() };
    let from = Polished { best: start, responses, ..polished.clone() };
    Ok(other.follow(&from, STEPS, &Polish::default())?.world)
}

/// A few voxels more or less, and as many iterations as a start from a dark field takes.
fn other_voxels(effort: Effort, number: u64) -> Effort {
    const MORE: [usize; 6] = [2, 5, 1, 4, 3, 6];
    let nodes = effort.nodes + MORE[number as usize % MORE.len()] - 2;
    let nodes = nodes.max(effort.degree.taps());
    Effort { nodes, iterations: PATIENCE * effort.iterations, ..effort }
}

/// How sure a world is: the inverse of the second derivatives, times χ²/N where that is above 1, and how much the world
/// depends on its voxels, and on the rays that its pixels are seen along. Its world is the mean over these.
pub(super) fn surely(
    problem: &WorldProblem<'_, f32>,
    polished: &Polished,
    reduced: f64,
) -> Result<Option<Spread>> {
    let n = problem.free.len();
    if polished.covariance.iter().any(|x| !x.is_finite()) {
        return Ok(None);
    }
    let mut worlds = vec![polished.best.world];
    for number in 1..=LATTICES {
        worlds.push(otherwise(problem, polished, number)?);
    }
    let best = polished.best.world;
    let away = |world: &World, k: usize| {
        let parameter = problem.free[k].parameter;
        parameter.difference(world.get(parameter), best.get(parameter))
    };
    let mean = |k: usize| worlds.iter().map(|w| away(w, k)).sum::<f64>() / worlds.len() as f64;
    let means: Vec<f64> = (0..n).map(mean).collect();
    let scatter = |a: usize, b: usize| {
        let product = |w: &World| (away(w, a) - means[a]) * (away(w, b) - means[b]);
        worlds.iter().map(product).sum::<f64>() / LATTICES as f64
    };
    let covariance: Vec<f64> = (0..n * n)
        .map(|k| polished.covariance[k] * reduced.max(1.0) + scatter(k / n, k % n))
        .collect();
    let whole: Vec<f64> = (0..n).map(|k| covariance[k * n + k].sqrt()).collect();
    let correlation = (0..n * n).map(|k| covariance[k] / (whole[k / n] * whole[k % n]));
    let correlation = correlation.collect();
    // The mean has a smaller error than each of them.
    let world = problem.free.iter().enumerate().fold(best, |world, (k, free)| {
        world.with(free.parameter, free.inside(best.get(free.parameter) + means[k]))
    });
    // Nobody knows less than before the data.
    let sigma = problem.free.iter().zip(whole).map(|(free, x)| x.min(free.prior.deviation()));
    let sigma: Vec<f64> = sigma.collect();
    let open = problem.free.iter().zip(&sigma).map(|(free, sigma)| free.is_open(*sigma)).collect();
    Ok(Some(Spread { world, sigma, open, correlation, ripple: 0.0, worlds: worlds.len() }))
}

/// Worlds that the data leave possible: each is the best one of data with noise once more, seen along other rays
/// (randomise, then optimise: Bardsley et al. 2014).
pub struct WorldPosterior<'a> {
    file: &'a FitFile,
    unknown: &'a UnknownWorld,
    measured: &'a Measured,
    polished: Polished,
    /// Noise of a draw over the data's errors.
    factor: f64,
    scale: f64,
}

impl<'a> WorldPosterior<'a> {
    /// About a world that was found, with errors of the data that are `noise_factor` of what they say.
    ///
    /// # Errors
    /// If a setting is missing or out of range, the problem has no solution, or the data leave a parameter open.
    pub fn new(
        file: &'a FitFile,
        measured: &'a Measured,
        unknown: &'a UnknownWorld,
        (world, noise_factor): (World, f64),
    ) -> Result<Self> {
        let scale = noise_factor.powi(-2);
        let seen = Seen::new(file, measured, &unknown.search.fine)?;
        let (polished, reduced) = seen.with(unknown, &unknown.search.fine, scale, |problem| {
            let iterations = PATIENCE * problem.effort.iterations;
            let effort = Effort { iterations, ..problem.effort };
            let start = WorldProblem { effort, ..*problem }.solve(world)?;
            polished(problem, &start)
        })?;
        if polished.covariance.iter().any(|x| !x.is_finite()) {
            refuse!(
                "the data leave a parameter of the world open: there is no best world to draw others around"
            );
        }
        let factor = noise_factor * reduced.max(1.0).sqrt();
        Ok(Self { file, unknown, measured, polished, factor, scale })
    }

    /// Noise of a draw over the data's errors.
    pub fn factor(&self) -> f64 {
        self.factor
    }

    /// A draw: the same for the same data and number. What the data say nothing about is drawn from its prior first. A
    /// prior of the voxels is about a field of its own, drawn with the seed `field`.
    ///
    /// # Errors
    /// As [`new`](Self::new).
    pub fn draw(&self, measured: &Measured, number: u64, field: u64) -> Result<World> {
        let seen = Seen::new(self.file, measured, &self.unknown.search.fine)?;
        seen.with(self.unknown, &self.unknown.search.fine, self.scale, |problem| {
            let gaussian = problem.gaussian.map(|prior| prior.clone().about(prior.drawn(field)));
            let problem = WorldProblem { gaussian: gaussian.as_ref(), ..*problem };
            otherwise(&problem, &self.somewhere(&problem, number), number)
        })
    }

    /// The best world with what the data leave open anywhere in its prior.
    fn somewhere(&self, problem: &WorldProblem<'_, f32>, number: u64) -> Polished {
        let mut random = Pcg64::seed_from_u64(self.file.seed ^ OPEN_DRAWS.wrapping_add(number));
        let mut polished = self.polished.clone();
        let n = problem.free.len();
        for (k, free) in problem.free.iter().enumerate() {
            let share = random.random::<f64>();
            if free.is_open(polished.covariance[k * n + k].sqrt()) {
                let world = &mut polished.best.world;
                *world = world.with(free.parameter, free.inside(free.prior.quantile(share)));
            }
        }
        polished
    }

    /// Data with noise once more.
    ///
    /// # Errors
    /// If there is no room for them.
    pub fn data(&self, number: u64) -> Result<Measured> {
        self.measured.perturbed(&self.file.loss, self.factor, number)
    }
}
