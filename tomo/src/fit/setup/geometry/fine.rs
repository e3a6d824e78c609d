//! Detailed search, from the ends of the coarse searches to the best geometry and its errors.

use super::detail::{Detail, Detailed, Place, RaySampling, Resolution, Sure, Trial};
use super::posterior::{Looks, polished, surely};
use super::search_data::SearchData;
use super::tangent::Anchor;
use super::{discretisation, seen_through};
use crate::fit::geometry::{
    Effort, Exploration, Explored, Geometry, GeometryProblem, ModelErrors, Spread, TrialWatch,
};
use crate::fit::linear::{StopRule, refined};
use crate::fit::settings::SearchView;
use crate::fit::setup::Result;
use crate::fit::setup::drawn::{has_own_rays, is_drawn_elsewhere};
use crate::fit::setup::instrument::samples;

impl Detail<'_> {
    /// Searches from the ends of the coarse searches, the best of which leaves so much of each datum, for the best geometry;
    /// none if it was cancelled. Where steps lead on from the ends, these move.
    pub fn search(
        &self,
        trials: &mut [Trial],
        anchor: &Anchor,
        reduced_chi2: f64,
        how: &Exploration,
        watch: &mut TrialWatch<'_>,
    ) -> Result<Option<Detailed>> {
        let errors = (self.scale)(reduced_chi2);
        let place = self.first(errors)?;
        let [has_steps, is_convex] = self.through(&place, |problem| {
            // Sums over samples of a smooth image become as fine as steps need them.
            let has_steps = is_stepped(&place.seen, problem)
                || place.seen.is_sampled() && !problem.change.is_any();
            Ok([has_steps, problem.is_convex()])
        })?;
        if has_steps && is_convex {
            return self.steps(place, trials, watch);
        }
        let found = self.through(&place, |problem| match is_convex {
            // By a population of geometries about the best end of the coarse searches.
            true => {
                let explored = quick(problem).explore(anchor.geometry, None, how, watch)?;
                explored.map(|explored| valued(problem, &explored)).transpose()
            }
            false => {
                let looks = Looks { resampled: None, shares_rays: self.shares_rays(&place) };
                about_volumes(&place.seen, looks, problem, anchor, how, watch)
            }
        })?;
        let Some(found) = found else { return Ok(None) };
        let sure = self.beside_its_own(&place, found)?;
        Ok(Some(Detailed { sure, errors, resolution: place.at }))
    }

    /// Data at the resolution that refinements begin with.
    pub fn first(&self, errors: f64) -> Result<Place> {
        let SearchView { nodes, pixels, .. } = self.unknown.search.fine;
        let (per_side, ring) = (samples(self.file)?, self.file.screen.ring_rays);
        let rays = RaySampling { per_side, ring, ..RaySampling::default() };
        self.place(Resolution { nodes, pixels, rays }, errors)
    }

    /// Data at a resolution.
    pub fn place(&self, at: Resolution, errors: f64) -> Result<Place> {
        let Resolution { nodes, pixels, .. } = at;
        let view = SearchView { nodes, pixels, ..self.unknown.search.fine };
        let seen = SearchData::finely(self.file, self.measured, &view)?;
        Ok(Place { seen, at, view, errors, even: None })
    }

    /// Returns whether data are of another model than that of the fit.
    pub fn is_foreign(&self) -> Result<bool> {
        Ok(self.file.data.is_some() || is_drawn_elsewhere(self.file)?)
    }

    /// Returns whether data have the rays through which a place sees them.
    pub fn shares_rays(&self, place: &Place) -> bool {
        let seen = &place.seen;
        has_own_rays(self.file)
            && (seen.is_images() || seen.view.file.screen.pixels == self.file.screen.pixels)
    }

    /// Adds the errors that the model has of itself. Data of the same model have its rays, and no voxels: what is left unexplained
    /// counts.
    pub fn beside_its_own(&self, place: &Place, sure: Sure) -> Result<Sure> {
        let Some(spread) = &sure.spread else { return Ok(sure) };
        let (is_foreign, reduced) = (self.is_foreign()?, sure.reduced_chi2);
        let own = self.through(place, |problem| {
            if is_foreign {
                return discretisation::errors(self.unknown, place, problem, spread, reduced);
            }
            let known = spread.unexplained(problem.excess_of_all(reduced), reduced);
            Ok(ModelErrors { known: known.into_iter().collect(), left_out: None })
        })?;
        let spread = sure.spread.map(|spread| spread.beside(&self.unknown.free, own));
        Ok(Sure { spread, ..sure })
    }

    /// Does something with what is looked at.
    pub fn through<R>(
        &self,
        place: &Place,
        work: impl FnOnce(&GeometryProblem<'_, f32>) -> Result<R>,
    ) -> Result<R> {
        let Place { seen, at, view, errors, .. } = place;
        seen.with(self.unknown, view, *errors, self.memory, |problem| {
            let model = seen_through(&seen.view.file, problem.model.clone(), at.rays)?;
            work(&GeometryProblem { model: &model, ..*problem })
        })
    }

    /// The same with data that change smoothly about a geometry.
    pub fn smoothly<R>(
        &self,
        place: &Place,
        about: Geometry,
        work: impl FnOnce(&GeometryProblem<'_, f32>) -> Result<R>,
    ) -> Result<R> {
        self.through(place, |problem| place.seen.smoothly(problem, about, work))
    }
}

/// The search about the best end of the coarse ones, and how sure it is, where data are convex about a volume only.
fn about_volumes(
    seen: &SearchData,
    looks: Looks<'_>,
    problem: &GeometryProblem<'_, f32>,
    volume: &Anchor,
    how: &Exploration,
    watch: &mut TrialWatch<'_>,
) -> Result<Option<Sure>> {
    let (quick, start) = (quick(problem), volume.geometry);
    let first = seen.about(&quick, volume, |quick| Ok(Anchor::of(quick, &quick.solve(start)?)))?;
    let Some(first) = first else {
        let x = refined(&volume.voxels, &volume.x, &problem.voxels())?;
        let Some(explored) = quick.explore(start, Some(&x), how, watch)? else {
            return Ok(None);
        };
        return surely_about(seen, looks, problem, &explored).map(Some);
    };
    let explored = seen.about(&quick, &first, |quick| quick.explore(start, None, how, watch))?;
    let Some(explored) = explored.flatten() else { return Ok(None) };
    let short = Exploration { trials: how.trials / 2, ..*how };
    let Some(explored) = nearer(seen, &quick, explored, &short, watch)? else {
        return Ok(None);
    };
    let anchor = Anchor::of(problem, &explored.best);
    let found =
        seen.about(problem, &anchor, |problem| surely_about(seen, looks, problem, &explored))?;
    Ok(found.map(|sure| {
        let spread = sure.spread.filter(|_| sure.reduced_chi2 < WAY);
        Sure { spread, ..sure }
    }))
}

/// A problem whose volumes tell geometries apart and no more: populations look for where steps begin, with volumes that are
/// solved for.
fn quick<'a>(problem: &GeometryProblem<'a, f32>) -> GeometryProblem<'a, f32> {
    let patience = StopRule::looking(problem.effort.patience.looking);
    GeometryProblem { effort: Effort { patience, ..problem.effort }, ..*problem }
}

/// Returns whether steps along differences of images follow a search: χ² has to be smooth, and they know one volume.
pub(super) fn is_stepped(seen: &SearchData, problem: &GeometryProblem<'_, f32>) -> bool {
    (problem.model.ring.is_some() || seen.is_images()) && !problem.change.is_any()
}

/// χ²/N above which a search about volumes is still on its way: the bowl there says nothing about where it leads.
const WAY: f64 = 3.0;

/// Returns the errors of the best of the geometries that were explored.
fn surely_about(
    seen: &SearchData,
    looks: Looks<'_>,
    problem: &GeometryProblem<'_, f32>,
    explored: &Explored,
) -> Result<Sure> {
    if is_stepped(seen, problem) {
        let (polished, reduced) = polished(problem, &explored.best)?;
        return surely(problem, looks, &polished, reduced);
    }
    valued(problem, explored)
}

/// Returns the errors by the values of the geometries around.
fn valued(problem: &GeometryProblem<'_, f32>, explored: &Explored) -> Result<Sure> {
    let reduced_chi2 = problem.scale * problem.left(&explored.best)?;
    let spread = Spread::of(problem.free, &explored.samples, reduced_chi2);
    // Values of other patience than that of the samples do not compare with theirs.
    let geometry = lower(&quick(problem), explored, spread.as_ref())?;
    Ok(Sure { geometry, spread, reduced_chi2 })
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
    // By the data as they are: values about different volumes do not compare.
    explored.best = problem.solve_from(explored.best.geometry, &explored.best.x)?;
    for _ in 0..NEARER {
        let (anchor, geometry) = (Anchor::of(problem, &explored.best), explored.best.geometry);
        let next =
            seen.about(problem, &anchor, |problem| problem.explore(geometry, None, short, watch))?;
        let Some(mut next) = next.flatten() else { return Ok(None) };
        next.best = problem.solve_from(next.best.geometry, &next.best.x)?;
        if next.best.value >= explored.best.value {
            break;
        }
        explored = next;
    }
    Ok(Some(explored))
}
