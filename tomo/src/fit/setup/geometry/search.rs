//! The search for a geometry: from many starts with coarse voxels, then with fine ones.

use super::detail::{Detail, Detailed, Resolution, Trial};
use super::fine::{PART, nearer};
use super::search_data::SearchData;
use super::tangent::Anchor;
use crate::fit::geometry::{
    Estimate, Exploration, Explored, Geometry, GeometryProblem, Spread, TrialWatch,
};
use crate::fit::journal::{Journal, Memory};
use crate::fit::settings::{FieldKind, FitFile, Linear, UnknownGeometry};
use crate::fit::setup::errors::have_noise;
use crate::fit::setup::{FitData, Result};

use rayon::prelude::*;

/// A geometry that was found.
#[derive(Clone, Debug)]
pub struct FoundGeometry {
    /// The best geometry.
    pub geometry: Geometry,
    /// Errors; none if no quadratic form describes the values around it.
    pub spread: Option<Spread>,
    /// χ² of the fine search's best geometry over the number of its data.
    pub reduced_chi2: f64,
    /// Errors that the search took over those of the data: below 1 where residuals are much smaller than the errors,
    /// as those of images without noise.
    pub noise_factor: f64,
    /// Resolution at the end.
    pub resolution: Resolution,
    /// The searches from all starts.
    pub trials: Vec<Trial>,
}

/// Told which search of how many goes on, its number of geometries and its least value; says whether to go on.
pub type SearchWatch<'a> = dyn FnMut((usize, usize), usize, f64) -> bool + 'a;

/// Width of the first population from a start, and of the one about the best end, in units of a parameter's scale.
const WIDTHS: [f64; 2] = [1.5, 0.4];

/// Geometries of a search for each of that from the mirror solution of its end.
const MIRROR: usize = 6;

/// Looks for the geometry from all starts, and on from their ends with finer voxels; none if it was cancelled. What the
/// journal knows of an earlier search that was interrupted is not looked at again.
///
/// # Errors
/// If a setting is missing or out of range, or the linear problem of a geometry has no solution.
pub fn find_geometry(
    file: &FitFile,
    measured: &FitData,
    unknown: &UnknownGeometry,
    journal: &dyn Journal,
    watch: &mut SearchWatch<'_>,
) -> Result<Option<FoundGeometry>> {
    let (search, memory) = (&unknown.search, Memory::new(journal));
    let coarse = SearchData::coarsely(file, measured, &search.coarse)?;
    let gaussian = |linear: &Linear| linear.prior_of(FieldKind::Gaussian).is_some();
    let has_prior = file.linear.as_ref().is_some_and(gaussian);
    // Beside a prior of the voxels, or with noise, data count as their errors say.
    let is_known = has_prior || have_noise(file);
    let scale = |reduced: f64| if is_known { 1.0 } else { scale(reduced) };
    // The factor weighs χ² against the priors in every value: it has to be known before them.
    let first = coarse
        .with(unknown, &search.coarse, 1.0, memory, |problem| least(problem, search.starts))?;
    let found = coarse.with(unknown, &search.coarse, scale(first), memory, |problem| {
        from_starts(&coarse, problem, file.seed, unknown, watch)
    })?;
    let Some(Found { best, reduced_chi2, mut trials }) = found else {
        return Ok(None);
    };
    let how = Exploration { width: WIDTHS[1], trials: search.fine.trials, seed: file.seed };
    let count = trials.len().max(1) + 1;
    let mut told = |trials: usize, best: f64| watch((count - 1, count), trials, best);
    // The coarse search has left less than it began with.
    let detail = Detail { file, measured, unknown, memory, scale: &scale };
    let found = detail.search(&mut trials, &best, reduced_chi2, &how, &mut told)?;
    Ok(found.map(|Detailed { sure, errors, resolution }| FoundGeometry {
        geometry: sure.geometry,
        reduced_chi2: sure.reduced_chi2 / errors,
        // χ² goes with 1/σ².
        noise_factor: errors.powf(-0.5),
        spread: sure.spread,
        resolution,
        trials,
    }))
}

/// Result of the coarse searches: their best end, with χ²/N there.
struct Found {
    best: Anchor,
    reduced_chi2: f64,
    trials: Vec<Trial>,
}

fn from_starts(
    seen: &SearchData,
    problem: &GeometryProblem<'_, f32>,
    seed: u64,
    UnknownGeometry { search, .. }: &UnknownGeometry,
    watch: &mut SearchWatch<'_>,
) -> Result<Option<Found>> {
    let mut trials: Vec<Trial> = Vec::new();
    let mut best: Option<Estimate> = None;
    let mut told = |trials: usize, best: f64| watch((0, search.starts + 1), trials, best);
    let Some(beginnings) = beginnings(problem, search.starts, &mut told)? else { return Ok(None) };
    for (k, (start, lit)) in beginnings.into_iter().enumerate() {
        let mut told = |trials: usize, best: f64| watch((k, search.starts + 1), trials, best);
        let seed = seed.wrapping_add(k as u64);
        let how = Exploration { width: WIDTHS[0], trials: search.coarse.trials, seed };
        let Some(explored) = searched(seen, problem, start, lit, &how, &mut told)? else {
            return Ok(None);
        };
        trials.push(trial(&explored, problem)?);
        if best.as_ref().is_none_or(|best| explored.best.value < best.value) {
            best = Some(explored.best);
        }
    }
    let Some(best) = best else { return Ok(None) };
    let reduced_chi2 = problem.left(&best)?;
    Ok(Some(Found { best: Anchor::of(problem, &best), reduced_chi2, trials }))
}

/// Geometries whose lit fields are tried, for each from which a search begins.
const LIT: usize = 16;
/// Number of geometries at a time.
const AT_A_TIME: usize = 8;

/// Begin of a search, with its volume from lit fields where data are not convex.
type Beginning = (Geometry, Option<Estimate>);

/// Returns the begins of searches: places all over the priors. Where data are not convex, the best of many such places,
/// with their volumes: geometries far from the truth then lead to other minima, and lit fields tell them apart.
fn beginnings(
    problem: &GeometryProblem<'_, f32>,
    starts: usize,
    watch: &mut TrialWatch<'_>,
) -> Result<Option<Vec<Beginning>>> {
    if problem.is_convex() {
        return Ok(Some(
            problem.starts(starts).into_iter().map(|geometry| (geometry, None)).collect(),
        ));
    }
    let mut tried: Vec<Estimate> = Vec::new();
    for trials in problem.starts(LIT * starts).chunks(AT_A_TIME) {
        let solved = trials.par_iter().map(|geometry| problem.solve(*geometry));
        tried.extend(solved.collect::<core::result::Result<Vec<_>, _>>()?);
        tried.sort_by(|a, b| a.value.total_cmp(&b.value));
        // The volumes of all others need not be in memory at a time.
        tried.truncate(starts);
        if !watch(0, tried[0].value) {
            return Ok(None);
        }
    }
    Ok(Some(tried.into_iter().map(|lit| (lit.geometry, Some(lit))).collect()))
}

/// A search from a start. Where data are not convex, it is one about the volume there, and again about the volume of each
/// search before, as long as that is a better one; where they have no such form, volumes follow the search.
fn searched(
    seen: &SearchData,
    problem: &GeometryProblem<'_, f32>,
    start: Geometry,
    lit: Option<Estimate>,
    how: &Exploration,
    watch: &mut TrialWatch<'_>,
) -> Result<Option<Explored>> {
    let mut from = |problem: &GeometryProblem<'_, f32>| -> Result<Option<Explored>> {
        let Some(explored) = problem.explore(start, None, how, watch)? else { return Ok(None) };
        let Some(explored) = or_twin(problem, explored, how, watch)? else { return Ok(None) };
        let further = lowest(problem, &explored)?;
        Ok(Some(Explored { further, ..explored }))
    };
    let Some(lit) = lit else { return from(problem) };
    let about = seen.about(problem, &Anchor::of(problem, &lit), &mut from)?;
    let Some(explored) = about else { return from(problem) };
    let Some(explored) = explored else { return Ok(None) };
    let short = Exploration { width: WIDTHS[1], trials: how.trials / PART, ..*how };
    let Some(nearer) = nearer(seen, problem, explored, &short, watch)? else { return Ok(None) };
    let further = lowest(problem, &nearer)?;
    Ok(Some(Explored { start, further, ..nearer }))
}

/// The lowest point of the quadratic form through geometries that were explored, if there is one.
fn lowest(problem: &GeometryProblem<'_, f32>, explored: &Explored) -> Result<Option<Geometry>> {
    let reduced = problem.scale * problem.left(&explored.best)?;
    Ok(Spread::of(problem.free, &explored.samples, reduced).map(|form| form.geometry))
}

/// Returns the end of a search, or of a short one from the mirror solution of that geometry, if that ends at a better
/// one.
fn or_twin(
    problem: &GeometryProblem<'_, f32>,
    mut explored: Explored,
    how: &Exploration,
    watch: &mut TrialWatch<'_>,
) -> Result<Option<Explored>> {
    let Some(mirror) = problem.mirror_solution(&explored.best.geometry) else {
        return Ok(Some(explored));
    };
    let short = Exploration { width: WIDTHS[1], trials: how.trials / MIRROR, ..*how };
    let Some(other) = problem.explore(mirror, None, &short, watch)? else { return Ok(None) };
    if other.best.value < explored.best.value {
        explored.best = other.best;
    }
    explored.samples.extend(other.samples);
    // The quadratic form goes through the best ones: it takes them sorted.
    explored.samples.sort_by(|a, b| a.value.total_cmp(&b.value));
    Ok(Some(explored))
}

/// The least χ²/N of the geometries where searches begin.
fn least(problem: &GeometryProblem<'_, f32>, starts: usize) -> Result<f64> {
    // Data that are not convex have errors, and their volumes take long.
    if !problem.is_convex() {
        return Ok(1.0);
    }
    problem.starts(starts).into_iter().try_fold(f64::INFINITY, |least, start| {
        Ok(least.min(problem.left(&problem.solve(start)?)?))
    })
}

/// χ²/N below which errors say nothing about residuals.
const TOO_SMALL: f64 = 0.5;

/// Returns the factor of χ² that makes errors as large as residuals, where these are much smaller: data without noise
/// whose errors are only a scale.
fn scale(reduced_chi2: f64) -> f64 {
    if reduced_chi2 > 0.0 && reduced_chi2 < TOO_SMALL { 1.0 / reduced_chi2 } else { 1.0 }
}

fn trial(explored: &Explored, problem: &GeometryProblem<'_, f32>) -> Result<Trial> {
    Ok(Trial {
        reduced_chi2: problem.left(&explored.best)?,
        start: explored.start,
        end: explored.best.geometry,
        value: explored.best.value,
        trials: explored.samples.len(),
        further: explored.further,
    })
}
