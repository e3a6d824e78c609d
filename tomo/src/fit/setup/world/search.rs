//! The search for a world: from many starts or over a grid with coarse voxels, then with fine ones.

use super::posterior::{polished, surely};
use super::seen::Seen;
use crate::fit::linear::Patience;
use crate::fit::settings::{FieldKind, FitFile, Linear, UnknownWorld};
use crate::fit::setup::{Measured, Result};
use crate::fit::world::{
    Effort, Exploration, Explored, Scanned, Spread, World, WorldProblem, WorldScan, WorldWatch,
};

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
    /// The searches from all starts; none where a grid was scanned in their place.
    pub trials: Vec<Trial>,
    /// The grid of worlds, if one was scanned.
    pub scan: Option<WorldScan>,
}

/// Told which search of how many goes on, its number of worlds and its least value; says whether to go on.
pub type SearchWatch<'a> = dyn FnMut((usize, usize), usize, f64) -> bool + 'a;

/// Width of the first population from a start, and of the one about the best end, in units of a parameter's scale.
const WIDTHS: [f64; 2] = [1.5, 0.4];

/// Worlds of a search for each of that from the twin of its end.
const TWIN: usize = 6;

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
    let coarse = Seen::coarsely(file, measured, &search.coarse)?;
    let gaussian = |linear: &Linear| linear.prior_of(FieldKind::Gaussian).is_some();
    let has_prior = file.linear.as_ref().is_some_and(gaussian);
    // Beside a prior of the voxels data count as their errors say.
    let scale = |reduced: f64| if has_prior { 1.0 } else { scale(reduced) };
    let first =
        coarse.with(unknown, &search.coarse, 1.0, |problem| least(problem, search.starts))?;
    let over = unknown.scanned();
    let found = coarse.with(unknown, &search.coarse, scale(first), |problem| {
        if over.is_empty() {
            return from_starts(problem, file.seed, unknown, watch);
        }
        on_grid(problem, &over, file.seed, unknown, watch)
    })?;
    let Some(Found { start, reduced_chi2, trials, scan }) = found else { return Ok(None) };
    let fine = Seen::finely(file, measured, &search.fine)?;
    // The coarse search has left less than it began with.
    let scale = scale(reduced_chi2);
    let count = trials.len().max(1) + 1;
    let mut told = |worlds: usize, best: f64| watch((count - 1, count), worlds, best);
    let told: &mut WorldWatch<'_> = &mut told;
    let found = fine.with(unknown, &search.fine, scale, |problem| {
        // Populations look for where to begin: steps with volumes that are solved for follow.
        let patience = Patience::looking(search.fine.iterations);
        let quick = WorldProblem { effort: Effort { patience, ..problem.effort }, ..*problem };
        let how = Exploration { width: width(&over), worlds: search.fine.worlds, seed: file.seed };
        let Some(explored) = quick.explore(start, &how, told)? else { return Ok(None) };
        let reduced = problem.scale * problem.left(&explored.best)?;
        // Steps along differences of images know one volume.
        if problem.model.ring.is_some() && !problem.change.is_any() {
            let (polished, reduced) = polished(problem, &explored.best)?;
            let spread = surely(problem, &polished, reduced)?;
            let world = spread.as_ref().map_or(polished.best.world, |spread| spread.world);
            return Ok(Some((spread, reduced, world)));
        }
        let spread = Spread::of(problem.free, &explored.samples, reduced);
        let world = lower(&quick, &explored, spread.as_ref())?;
        Ok(Some((spread, reduced, world)))
    })?;
    Ok(found.map(|(spread, reduced_chi2, world)| FoundWorld {
        world,
        reduced_chi2: reduced_chi2 / scale,
        noise_factor: scale.powf(-0.5),
        spread,
        trials,
        scan,
    }))
}

/// What the coarse search has found: where the fine one begins, with χ²/N there.
struct Found {
    start: World,
    reduced_chi2: f64,
    trials: Vec<Trial>,
    scan: Option<WorldScan>,
}

fn from_starts(
    problem: &WorldProblem<'_, f32>,
    seed: u64,
    UnknownWorld { search, .. }: &UnknownWorld,
    watch: &mut SearchWatch<'_>,
) -> Result<Option<Found>> {
    let mut trials: Vec<Trial> = Vec::new();
    for (k, start) in problem.starts(search.starts).into_iter().enumerate() {
        let mut told = |worlds: usize, best: f64| watch((k, search.starts + 1), worlds, best);
        let seed = seed.wrapping_add(k as u64);
        let how = Exploration { width: WIDTHS[0], worlds: search.coarse.worlds, seed };
        let Some(explored) = problem.explore(start, &how, &mut told)? else { return Ok(None) };
        let Some(explored) = or_twin(problem, explored, &how, &mut told)? else { return Ok(None) };
        trials.push(trial(&explored, problem)?);
    }
    let best = trials.iter().min_by(|a, b| a.value.total_cmp(&b.value));
    let best = best.map(|best| (best.end, best.reduced_chi2));
    Ok(best.map(|(start, reduced_chi2)| Found { start, reduced_chi2, trials, scan: None }))
}

/// Where a search has ended, or a short one from the twin of that world, if that ends at a better one.
fn or_twin(
    problem: &WorldProblem<'_, f32>,
    mut explored: Explored,
    how: &Exploration,
    watch: &mut WorldWatch<'_>,
) -> Result<Option<Explored>> {
    let Some(twin) = problem.twin(&explored.best.world) else { return Ok(Some(explored)) };
    let short = Exploration { width: WIDTHS[1], worlds: how.worlds / TWIN, ..*how };
    let Some(other) = problem.explore(twin, &short, watch)? else { return Ok(None) };
    if other.best.value < explored.best.value {
        (explored.best, explored.converged) = (other.best, other.converged);
    }
    explored.samples.extend(other.samples);
    Ok(Some(explored))
}

fn on_grid(
    problem: &WorldProblem<'_, f32>,
    over: &[Scanned],
    seed: u64,
    UnknownWorld { search, .. }: &UnknownWorld,
    watch: &mut SearchWatch<'_>,
) -> Result<Option<Found>> {
    let mut told = |worlds: usize, best: f64| watch((0, 2), worlds, best);
    let how = Exploration { width: WIDTHS[0], worlds: search.coarse.worlds, seed };
    let Some(scan) = problem.scan(over, &how, &mut told)? else { return Ok(None) };
    let best = scan.best().map(|best| (best.world, best.reduced_chi2));
    Ok(best.map(|(start, reduced_chi2)| Found {
        start,
        reduced_chi2,
        trials: Vec::new(),
        scan: Some(scan),
    }))
}

/// Width of the fine search's first population: where a grid is coarse, half of its cells.
fn width(over: &[Scanned]) -> f64 {
    let cell = |scanned: &Scanned| 0.5 * scanned.step() / scanned.parameter.scale();
    over.iter().map(cell).fold(WIDTHS[1], f64::max)
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
    problem.starts(starts).into_iter().try_fold(f64::INFINITY, |least, start| {
        Ok(least.min(problem.left(&problem.solve(start)?)?))
    })
}

/// χ²/N below which errors say nothing about residuals.
const TOO_SMALL: f64 = 0.5;

/// By what χ² is multiplied so that errors are as large as residuals, where these are much smaller: data without noise
/// whose errors are only a scale.
fn scale(reduced_chi2: f64) -> f64 {
    if reduced_chi2 > 0.0 && reduced_chi2 < TOO_SMALL { 1.0 / reduced_chi2 } else { 1.0 }
}

fn trial(explored: &Explored, problem: &WorldProblem<'_, f32>) -> Result<Trial> {
    Ok(Trial {
        reduced_chi2: problem.left(&explored.best)?,
        start: explored.start,
        end: explored.best.world,
        value: explored.best.value,
        worlds: explored.samples.len(),
        converged: explored.converged,
    })
}
