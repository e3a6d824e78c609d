//! The search about the best end of the coarse ones, steps from its best geometry, and how sure that one is.

use super::discretisation;
use super::posterior::{Resampled, polished, surely};
use super::search_data::{BESIDE_THE_RING, SearchData};
use super::tangent::Anchor;
use crate::fit::geometry::{
    Effort, Exploration, Explored, Geometry, GeometryProblem, Polished, Spread, TrialWatch,
};
use crate::fit::journal::Memory;
use crate::fit::linear::{StopRule, refined};
use crate::fit::settings::{FitFile, SearchView, UnknownGeometry};
use crate::fit::setup::{FitData, Result, spacing};

/// How sure a geometry is, its χ²/N, and the geometry.
type Sure = (Option<Spread>, f64, Geometry);

/// What is looked at in detail, about one geometry.
pub(super) struct Detail<'a> {
    /// Settings.
    pub file: &'a FitFile,
    /// Data.
    pub measured: &'a FitData,
    /// What is not known.
    pub unknown: &'a UnknownGeometry,
    /// What an earlier search has found.
    pub memory: Memory<'a>,
    /// By what χ² is multiplied where it leaves so much of each datum.
    pub scale: &'a dyn Fn(f64) -> f64,
}

impl Detail<'_> {
    /// From the best end of the coarse search, which leaves so much of each datum, to the best geometry, and by what χ² was
    /// multiplied there; none if it was cancelled.
    pub fn search(
        &self,
        start: (Geometry, Option<&Anchor>),
        reduced_chi2: f64,
        how: &Exploration,
        watch: &mut TrialWatch<'_>,
    ) -> Result<Option<(Sure, f64)>> {
        let search = &self.unknown.search;
        let errors = (self.scale)(reduced_chi2);
        let seen = SearchData::finely(self.file, self.measured, &search.fine)?;
        let found = self.through((&seen, &search.fine), errors, |fine, problem| {
            fine.search(problem, start, how, watch)
        })?;
        let Some((spread, reduced, geometry)) = found else { return Ok(None) };
        let Some(finest) = search.finest() else {
            let spread = self.beside_its_own((&seen, &search.fine), errors, (spread, reduced))?;
            return Ok(Some(((spread, reduced, geometry), errors)));
        };
        let errors = (self.scale)(reduced / errors);
        let seen = SearchData::closely(self.file, self.measured, &finest)?;
        let (polished, reduced) =
            self.through((&seen, &finest), errors, |fine, problem| fine.finest(problem, geometry))?;
        let geometry = polished.best.geometry;
        let free = &self.unknown.free;
        // What finer voxels and pixels moved the geometry by is what finer ones still might.
        let spread = spread.map(|spread| spread.moved(free, geometry));
        let spread = self.beside_its_own((&seen, &finest), errors, (spread, reduced))?;
        Ok(Some(((spread, reduced, geometry), errors)))
    }

    /// With the errors that the model has of itself.
    fn beside_its_own(
        &self,
        (seen, view): (&SearchData, &SearchView),
        scale: f64,
        (spread, reduced): (Option<Spread>, f64),
    ) -> Result<Option<Spread>> {
        let Some(spread) = spread else { return Ok(None) };
        let about = (self.unknown, spacing(&self.file.screen)?);
        let own = self.through((seen, view), scale, |_, problem| {
            discretisation::errors((seen, view), about, problem, (&spread, reduced))
        })?;
        Ok(Some(spread.beside(&self.unknown.free, own)))
    }

    fn through<R>(
        &self,
        (seen, view): (&SearchData, &SearchView),
        scale: f64,
        work: impl FnOnce(&Fine<'_>, &GeometryProblem<'_, f32>) -> Result<R>,
    ) -> Result<R> {
        let Self { unknown, memory, .. } = *self;
        let fine = Fine { seen, unknown };
        seen.with(unknown, view, (scale, memory), |problem| work(&fine, problem))
    }
}

/// A search about one geometry.
struct Fine<'a> {
    /// Data.
    seen: &'a SearchData,
    /// What is not known.
    unknown: &'a UnknownGeometry,
}

impl Fine<'_> {
    /// The search about the best end of the coarse one, and how sure it is.
    fn search(
        &self,
        problem: &GeometryProblem<'_, f32>,
        (start, volume): (Geometry, Option<&Anchor>),
        how: &Exploration,
        watch: &mut TrialWatch<'_>,
    ) -> Result<Option<Sure>> {
        let quick = quick(problem);
        let Some(volume) = volume.filter(|_| !problem.is_convex()) else {
            let beside = (start, BESIDE_THE_RING[0]);
            let explored = self
                .seen
                .smoothly(&quick, beside, |problem| problem.explore((start, None), how, watch))?;
            let Some(explored) = explored else { return Ok(None) };
            return self.steps(problem, &explored).map(Some);
        };
        let first =
            self.seen.about(&quick, volume, |quick| Ok(Anchor::of(quick, &quick.solve(start)?)))?;
        let Some(first) = first else {
            let x = refined(&volume.voxels, &volume.x, &problem.voxels())?;
            let Some(explored) = quick.explore((start, Some(&x)), how, watch)? else {
                return Ok(None);
            };
            return surely_about((self.seen, problem), None, &explored).map(Some);
        };
        let explored =
            self.seen.about(&quick, &first, |quick| quick.explore((start, None), how, watch))?;
        let Some(explored) = explored.flatten() else { return Ok(None) };
        let short = Exploration { trials: how.trials / 2, ..*how };
        let Some(explored) = nearer(self.seen, &quick, explored, &short, watch)? else {
            return Ok(None);
        };
        let anchor = Anchor::of(problem, &explored.best);
        let found = self.seen.about(problem, &anchor, |problem| {
            surely_about((self.seen, problem), None, &explored)
        })?;
        Ok(found.map(|(spread, reduced, geometry)| {
            (spread.filter(|_| reduced < WAY), reduced, geometry)
        }))
    }

    /// Steps from the best geometry of a population, and how sure their end is.
    fn steps(&self, problem: &GeometryProblem<'_, f32>, explored: &Explored) -> Result<Sure> {
        let beside = (explored.best.geometry, BESIDE_THE_RING[1]);
        self.seen.smoothly(problem, beside, |problem| {
            surely_about((self.seen, problem), Some((self.seen, self.unknown)), explored)
        })
    }

    /// Steps from a geometry that a search with fewer voxels and pixels has found, to the best one near it and its χ²/N.
    fn finest(
        &self,
        problem: &GeometryProblem<'_, f32>,
        start: Geometry,
    ) -> Result<(Polished, f64)> {
        self.seen.smoothly(problem, (start, BESIDE_THE_RING[1]), |problem| {
            polished(problem, &problem.solve(start)?)
        })
    }
}

/// A problem whose volumes tell geometries apart and no more: populations look for where steps begin, with volumes that are
/// solved for.
fn quick<'a>(problem: &GeometryProblem<'a, f32>) -> GeometryProblem<'a, f32> {
    let patience = StopRule::looking(problem.effort.patience.looking);
    GeometryProblem { effort: Effort { patience, ..problem.effort }, ..*problem }
}

/// Whether steps along differences of images follow a search: χ² has to be smooth, and they know one volume.
pub(super) fn is_stepped(seen: &SearchData, problem: &GeometryProblem<'_, f32>) -> bool {
    (problem.model.ring.is_some() || seen.is_images()) && !problem.change.is_any()
}

/// χ²/N above which a search about volumes is still on its way: the bowl there says nothing about where it leads.
const WAY: f64 = 3.0;

/// How sure the best of the geometries that were explored is.
fn surely_about(
    (seen, problem): (&SearchData, &GeometryProblem<'_, f32>),
    resampled: Resampled<'_>,
    explored: &Explored,
) -> Result<Sure> {
    if is_stepped(seen, problem) {
        let (polished, reduced) = polished(problem, &explored.best)?;
        let spread = surely(problem, resampled, &polished, reduced)?;
        let geometry = spread.as_ref().map_or(polished.best.geometry, |spread| spread.geometry);
        return Ok((spread, reduced, geometry));
    }
    let reduced = problem.scale * problem.left(&explored.best)?;
    let spread = Spread::of(problem.free, &explored.samples, reduced);
    let geometry = lower(&quick(problem), explored, spread.as_ref())?;
    Ok((spread, reduced, geometry))
}

/// The lowest point of the quadratic form, if it explains the data better than the best geometry that was evaluated.
fn lower(
    problem: &GeometryProblem<'_, f32>,
    explored: &Explored,
    spread: Option<&Spread>,
) -> Result<Geometry> {
    let Some(spread) = spread else { return Ok(explored.best.geometry) };
    let lowest = problem.solve(spread.geometry)?;
    let better = lowest.value < explored.best.value;
    Ok(if better { lowest.geometry } else { explored.best.geometry })
}

/// Searches of a part of the geometries, each about a nearer volume, at most, and that part.
const NEARER: usize = 16;
pub(super) const PART: usize = 4;

/// Short searches, each about the best volume so far, until none is better: their best geometry with the volume that explains
/// the data as they are, which a last search about it has looked around.
pub(super) fn nearer(
    seen: &SearchData,
    problem: &GeometryProblem<'_, f32>,
    mut explored: Explored,
    short: &Exploration,
    watch: &mut TrialWatch<'_>,
) -> Result<Option<Explored>> {
    explored.best = problem.solve_from(explored.best.geometry, &explored.best.x)?;
    for _ in 0..NEARER {
        let (anchor, geometry) = (Anchor::of(problem, &explored.best), explored.best.geometry);
        let next = seen
            .about(problem, &anchor, |problem| problem.explore((geometry, None), short, watch))?;
        let Some(mut next) = next.flatten() else { return Ok(None) };
        next.best = problem.solve_from(next.best.geometry, &next.best.x)?;
        if next.best.value >= explored.best.value {
            break;
        }
        explored = next;
    }
    Ok(Some(explored))
}
