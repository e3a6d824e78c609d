//! From settings to a world that is not known: its model, its parameters, and the search for them.

use super::coarse_view::CoarseView;
use super::instrument::ring;
use super::linear_problem::terms;
use super::{Instrument, Measured, Result, axis, drag, forward_model, linear, motion, priors};
use crate::dynamics::Velocity;
use crate::fit::linear::{Prior as Penalty, Weighted};
use crate::fit::settings::{AxisSearch, FitError, FitFile, UnknownWorld, WorldView, refuse};
use crate::fit::world::{
    Effort, Estimate, Exploration, Explored, Law, Parameter, Polish, Polished, Spread, World,
    WorldModel, WorldProblem, WorldWatch,
};
use crate::fit::{Motion, Objective, Redshift, Sampling};
use kerrlight_geodesic::Kerr;

/// Where one search ended, in [`World`]'s units.
#[derive(Clone, Debug)]
pub struct Trial {
    /// Where it began.
    pub start: World,
    /// Where it ended.
    pub end: World,
    /// χ² over the number of data there.
    pub reduced_chi2: f64,
    /// Half of χ² there, and −ln of the priors' densities.
    pub value: f64,
    /// Worlds that were evaluated.
    pub worlds: usize,
    /// Whether the last populations were alike.
    pub converged: bool,
}

/// A world that was found.
#[derive(Clone, Debug)]
pub struct FoundWorld {
    /// The best world.
    pub world: World,
    /// How sure it is; none if the data leave a parameter open.
    pub spread: Option<Spread>,
    /// χ² of the fine search's best world over the number of its data.
    pub reduced_chi2: f64,
    /// Errors that the search took over those of the data: below 1 where residuals are much smaller than the errors,
    /// as those of images without noise.
    pub noise_factor: f64,
    /// The searches from all starts.
    pub trials: Vec<Trial>,
}

/// Told which search of how many goes on, its number of worlds and its least value; says whether to go on.
pub type SearchWatch<'a> = dyn FnMut((usize, usize), usize, f64) -> bool + 'a;

/// Other rays that the best world is looked for through.
const LATTICES: u64 = 4;
/// Steps to the best world of other data, or through other rays.
const STEPS: usize = 3;
/// Iterations of the first solution of a world, for each of a search.
const PATIENCE: usize = 4;

/// Width of the first population from a start, and of the one about the best end, in units of a parameter's scale.
const WIDTHS: [f64; 2] = [1.5, 0.4];

/// Looks for the world from all starts, and again with finer voxels about the best end; none if it was cancelled.
///
/// # Errors
/// If a setting is missing or out of range, or the linear problem of a world has no solution.
pub fn find_world(
    file: &FitFile,
    measured: &Measured,
    unknown: &UnknownWorld,
    watch: &mut SearchWatch<'_>,
) -> Result<Option<FoundWorld>> {
    let search = &unknown.search;
    let count = search.starts + 1;
    let coarse = Seen::new(file, measured, &search.coarse)?;
    let first =
        coarse.with(unknown, &search.coarse, 1.0, |problem| least(problem, search.starts))?;
    let trials = coarse.with(unknown, &search.coarse, scale(first), |problem| {
        let mut trials = Vec::new();
        for (k, start) in problem.starts(search.starts).into_iter().enumerate() {
            let mut told = |worlds: usize, best: f64| watch((k, count), worlds, best);
            let seed = file.seed.wrapping_add(k as u64);
            let how = Exploration { width: WIDTHS[0], worlds: search.coarse.worlds, seed };
            let Some(explored) = problem.explore(start, &how, &mut told)? else { return Ok(None) };
            trials.push(trial(&explored, problem));
        }
        Ok(Some(trials))
    })?;
    let Some(trials) = trials else { return Ok(None) };
    let Some(best) = trials.iter().min_by(|a, b| a.value.total_cmp(&b.value)) else {
        return Ok(None);
    };
    let fine = Seen::new(file, measured, &search.fine)?;
    // The coarse search has left less than it began with.
    let scale = scale(best.reduced_chi2);
    let mut told = |worlds: usize, best: f64| watch((count - 1, count), worlds, best);
    let told: &mut WorldWatch<'_> = &mut told;
    let found = fine.with(unknown, &search.fine, scale, |problem| {
        let how = Exploration { width: WIDTHS[1], worlds: search.fine.worlds, seed: file.seed };
        let Some(explored) = problem.explore(best.end, &how, told)? else { return Ok(None) };
        let data: f64 = problem.terms.iter().map(|term| term.weight).sum();
        let reduced = problem.scale * explored.best.chi2 / data;
        if problem.model.ring.is_some() {
            let (polished, reduced) = polished(problem, &explored.best)?;
            let spread = surely(problem, &polished, reduced)?;
            let world = spread.as_ref().map_or(polished.best.world, |spread| spread.world);
            return Ok(Some((spread, reduced, world)));
        }
        let spread = Spread::of(problem.free, &explored.samples, reduced);
        let world = lower(problem, &explored, spread.as_ref())?;
        Ok(Some((spread, reduced, world)))
    })?;
    Ok(found.map(|(spread, reduced_chi2, world)| FoundWorld {
        world,
        reduced_chi2: reduced_chi2 / scale,
        noise_factor: scale.powf(-0.5),
        spread,
        trials,
    }))
}

/// The best world near another one, and its χ²/N.
fn polished(problem: &WorldProblem<'_, f32>, start: &Estimate) -> Result<(Polished, f64)> {
    let polished = problem.polish(start, &Polish::default())?;
    let data: f64 = problem.terms.iter().map(|term| term.weight).sum();
    let reduced = problem.scale * polished.best.chi2 / data;
    Ok((polished, reduced))
}

/// A world's best volume with other voxels, and from there its best world through other rays: what is left of both
/// where the data do not decide.
fn otherwise(problem: &WorldProblem<'_, f32>, polished: &Polished, number: u64) -> Result<World> {
    let model = problem.model.seen_along(number);
    let effort = other_voxels(problem.effort, number);
    let other = WorldProblem { model: &model, effort, ..*problem };
    let start = other.solve(polished.best.world)?;
    let from = Polished { best: start, ..polished.clone() };
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
fn surely(
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
    let sigma: Vec<f64> = (0..n).map(|k| covariance[k * n + k].sqrt()).collect();
    let correlation = (0..n * n).map(|k| covariance[k] / (sigma[k / n] * sigma[k % n]));
    let correlation = correlation.collect();
    // The mean has a smaller error than each of them.
    let world = problem.free.iter().enumerate().fold(best, |world, (k, free)| {
        let [low, high] = free.bounds();
        world.with(free.parameter, (best.get(free.parameter) + means[k]).clamp(low, high))
    });
    Ok(Some(Spread { world, sigma, correlation, ripple: 0.0, worlds: worlds.len() }))
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

    /// A draw: the same for the same data and number.
    ///
    /// # Errors
    /// As [`new`](Self::new).
    pub fn draw(&self, measured: &Measured, number: u64) -> Result<World> {
        let seen = Seen::new(self.file, measured, &self.unknown.search.fine)?;
        seen.with(self.unknown, &self.unknown.search.fine, self.scale, |problem| {
            otherwise(problem, &self.polished, number)
        })
    }

    /// Data with noise once more.
    pub fn data(&self, number: u64) -> Measured {
        self.measured.perturbed(&self.file.loss, self.factor, number)
    }
}

/// The lowest point of the quadratic form, if it explains the data better than the best world that was evaluated.
fn lower(
    problem: &WorldProblem<'_, f32>,
    explored: &Explored,
    spread: Option<&Spread>,
) -> Result<World> {
    let Some(spread) = spread else { return Ok(explored.best.world) };
    let lowest = problem.solve(spread.world)?;
    let better = lowest.value < explored.best.value;
    Ok(if better { lowest.world } else { explored.best.world })
}

/// The least χ²/N of the worlds where searches begin.
fn least(problem: &WorldProblem<'_, f32>, starts: usize) -> Result<f64> {
    let data: f64 = problem.terms.iter().map(|term| term.weight).sum();
    problem
        .starts(starts)
        .into_iter()
        .try_fold(f64::INFINITY, |least, start| Ok(least.min(problem.solve(start)?.chi2 / data)))
}

/// χ²/N below which errors say nothing about residuals.
const TOO_SMALL: f64 = 0.5;

/// By what χ² is multiplied so that errors are as large as residuals, where these are much smaller: data without noise
/// whose errors are only a scale.
fn scale(reduced_chi2: f64) -> f64 {
    if reduced_chi2 > 0.0 && reduced_chi2 < TOO_SMALL { 1.0 / reduced_chi2 } else { 1.0 }
}

fn trial(explored: &Explored, problem: &WorldProblem<'_, f32>) -> Trial {
    let data: f64 = problem.terms.iter().map(|term| term.weight).sum();
    Trial {
        reduced_chi2: explored.best.chi2 / data,
        start: explored.start,
        end: explored.best.world,
        value: explored.best.value,
        worlds: explored.samples.len(),
        converged: explored.converged,
    }
}

/// The world that the settings say, for parameters that are known, and for data that are simulated.
pub fn known_world(file: &FitFile) -> World {
    let inclination = file.observer.inclination_deg.to_radians();
    let power = file.effects.redshift_power.unwrap_or(0.0);
    let world = World::new(file.hole.spin, inclination, power);
    let Velocity::Infall { xi, beta_r, beta_phi, .. } = file.motion.velocity else { return world };
    let flow = Parameter::FLOW.into_iter().zip([xi, beta_r, beta_phi]);
    flow.fold(world, |world, (parameter, value)| world.with(parameter, value))
}

/// What a fit looks through in a world, and how matter moves there.
///
/// # Errors
/// If a setting is missing or out of range.
pub fn in_world(
    file: &FitFile,
    unknown: &UnknownWorld,
    instrument: &Instrument,
    measured: &Measured,
    world: &World,
) -> Result<(Instrument, Motion)> {
    let plain = motion(file, measured.times.clone())?;
    let model = model(file, unknown, instrument, &plain)?;
    let power = world.get(Parameter::RedshiftPower);
    let hole = Kerr::new(world.get(Parameter::Spin))?;
    let found = Instrument {
        pixels: instrument.pixels.clone(),
        hole,
        lines: model.sightlines(world)?,
        redshift: instrument.redshift.map(|_| Redshift { power }),
        polarized: model.polarized(world),
        seen: instrument.seen.clone(),
    };
    Ok((found, model.motion_of(world)?))
}

/// What all worlds share.
fn model(
    file: &FitFile,
    unknown: &UnknownWorld,
    instrument: &Instrument,
    motion: &Motion,
) -> Result<WorldModel> {
    let Sampling::Gauss { order, split } = file.region.nodes else {
        let why = "an unknown world needs region.nodes = { gauss = { order, split } }: nodes equidistant in Mino time \
                   have no derivatives";
        return Err(FitError::Conflict(why.to_owned()).into());
    };
    if file.effects.absorption.is_some() {
        let why = "an unknown world and effects.absorption exclude each other".to_owned();
        return Err(FitError::Conflict(why).into());
    }
    if !matches!(file.axis, AxisSearch::Known {}) {
        let why = "an unknown world needs [axis.known]: matter turns about motion.axis, in the frame of the hole";
        return Err(FitError::Conflict(why.to_owned()).into());
    }
    let follows = unknown.search.drag_is_spin;
    let law = match file.motion.velocity {
        Velocity::Keplerian { .. } if follows => Law::CircularOrbits,
        Velocity::Infall { .. } if follows => Law::Infall(None),
        Velocity::Infall { drag: own, .. } => Law::Infall(Some(own.unwrap_or(drag(file)?))),
        _ => Law::Fixed(motion.velocity.clone()),
    };
    let [x, y] = instrument.pixels.clone();
    Ok(WorldModel {
        x,
        y,
        ring: ring(file)?,
        observer_radius: file.observer.radius,
        region: file.region.limits(),
        order,
        split,
        slow_light: file.effects.slow_light,
        redshift: instrument.redshift.is_some(),
        law,
        axis: axis(file)?.0,
        motion: motion.clone(),
        jy: file.screen.jy_per_pixel,
        polarization: file.polarization,
        seen: instrument.seen.clone(),
    })
}

/// Data as a search looks at them.
struct Seen {
    view: CoarseView,
    frames: usize,
}

impl Seen {
    fn new(file: &FitFile, measured: &Measured, view: &WorldView) -> Result<Self> {
        Ok(Self { view: CoarseView::new(file, measured, view.pixels)?, frames: view.frames })
    }

    fn with<R>(
        &self,
        unknown: &UnknownWorld,
        view: &WorldView,
        scale: f64,
        search: impl FnOnce(&WorldProblem<'_, f32>) -> Result<R>,
    ) -> Result<R> {
        let CoarseView { file, instrument, measured } = &self.view;
        let plain = motion(file, measured.times.clone())?;
        let count = file.screen.pixels * file.screen.pixels;
        let data = measured.terms(&file.loss, count)?;
        let objective = Objective { model: forward_model(instrument, &plain)?, data };
        let all = objective.observed();
        let frames: Vec<usize> =
            all.iter().copied().step_by((all.len() / self.frames).max(1)).collect();
        let terms: Vec<Weighted<'_, f32>> =
            terms(&objective.data).into_iter().map(|term| counted(term, &frames)).collect();
        let data: f64 = terms.iter().map(|term| term.weight).sum();
        let settings = linear(file)?;
        let scaled = |penalty: Penalty| Penalty { weight: data * penalty.weight, ..penalty };
        let penalties: Vec<Penalty> = priors(settings).into_iter().map(scaled).collect();
        search(&WorldProblem {
            model: &model(file, unknown, instrument, &plain)?,
            known: known_world(file),
            free: &unknown.free()?,
            frames: &frames,
            terms: &terms,
            half_width: file.region.r_max,
            upper: settings.upper,
            flux: settings.flux_jy,
            penalties: &penalties,
            scale,
            effort: Effort {
                nodes: view.nodes,
                degree: settings.degree,
                iterations: view.iterations,
            },
        })
    }
}

/// Data with their weight times their number in some frames.
fn counted<'a>(term: Weighted<'a, f32>, frames: &[usize]) -> Weighted<'a, f32> {
    let data: usize = frames.iter().map(|frame| term.term.degrees_of_freedom(*frame)).sum();
    Weighted { weight: term.weight * data as f64, ..term }
}
