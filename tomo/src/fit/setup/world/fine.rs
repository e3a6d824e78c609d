//! From the ends of the coarse searches to the best world, and how sure that one is.

use super::discretisation;
use super::posterior::{polished, surely};
use super::search::Trial;
use super::seen::Seen;
use super::steps::{Place, Resolution};
use super::tangent::Anchor;
use crate::fit::journal::Memory;
use crate::fit::linear::{Patience, refined};
use crate::fit::settings::{FitFile, UnknownWorld, WorldView};
use crate::fit::setup::drawn::is_drawn_elsewhere;
use crate::fit::setup::{Measured, Result, spacing};
use crate::fit::world::{
    Effort, Exploration, Explored, Spread, World, WorldModel, WorldProblem, WorldWatch,
};

/// How sure a world is, its χ²/N, and the world.
pub(super) type Sure = (Option<Spread>, f64, World);

/// What is looked at in detail, about one world.
pub(super) struct Detail<'a> {
    /// Settings.
    pub file: &'a FitFile,
    /// Data.
    pub measured: &'a Measured,
    /// What is not known.
    pub unknown: &'a UnknownWorld,
    /// What an earlier search has found.
    pub memory: Memory<'a>,
    /// By what χ² is multiplied where it leaves so much of each datum.
    pub scale: &'a dyn Fn(f64) -> f64,
}

impl Detail<'_> {
    /// From the ends of the coarse searches, the best of which leaves so much of each datum, to the best world, by what χ²
    /// was multiplied there, and what it was looked at through; none if it was cancelled. Where steps lead on from the ends,
    /// these move.
    pub fn search(
        &self,
        (trials, anchor): (&mut [Trial], &Anchor),
        reduced_chi2: f64,
        how: &Exploration,
        watch: &mut WorldWatch<'_>,
    ) -> Result<Option<(Sure, f64, Resolution)>> {
        let errors = (self.scale)(reduced_chi2);
        let WorldView { nodes, pixels, .. } = self.unknown.search.fine;
        let at = Resolution { nodes, pixels, rays: 1, panels: 1 };
        let place = self.place(at, errors)?;
        let [is_stepped, is_convex] = self.through(&place, |problem| {
            Ok([is_stepped(&place.seen, problem), problem.is_convex()])
        })?;
        if is_stepped && is_convex {
            return self.steps(place, trials, watch);
        }
        let found = self.through(&place, |problem| match is_convex {
            true => populated(problem, anchor.world, how, watch),
            false => about_volumes(&place.seen, problem, anchor, how, watch),
        })?;
        let Some((spread, reduced, world)) = found else { return Ok(None) };
        let own = |spread| self.beside_its_own(&place, (spread, reduced));
        let spread = spread.map(own).transpose()?;
        Ok(Some(((spread, reduced, world), errors, at)))
    }

    /// Data at a resolution.
    pub fn place(&self, at: Resolution, errors: f64) -> Result<Place> {
        let Resolution { nodes, pixels, .. } = at;
        let view = WorldView { nodes, pixels, ..self.unknown.search.fine };
        let seen = Seen::finely(self.file, self.measured, &view)?;
        Ok(Place { seen, at, view, errors })
    }

    /// Whether data are of another model than that of the fit.
    pub fn is_foreign(&self) -> Result<bool> {
        Ok(self.file.data.is_some() || is_drawn_elsewhere(self.file)?)
    }

    /// With the errors that the model has of itself, where data are of another one.
    pub fn beside_its_own(
        &self,
        place: &Place,
        (spread, reduced): (Spread, f64),
    ) -> Result<Spread> {
        if !self.is_foreign()? {
            return Ok(spread);
        }
        let about = (self.unknown, spacing(&self.file.screen)?);
        let own = self.through(place, |problem| {
            discretisation::errors(place, about, problem, (&spread, reduced))
        })?;
        Ok(spread.beside(&self.unknown.free, own))
    }

    /// Does something with what is looked at.
    pub fn through<R>(
        &self,
        place: &Place,
        work: impl FnOnce(&WorldProblem<'_, f32>) -> Result<R>,
    ) -> Result<R> {
        let Place { seen, at, view, errors } = place;
        let width = spacing(&self.file.screen)?;
        seen.with(self.unknown, view, (*errors, self.memory), |problem| {
            let model = WorldModel {
                parts: (at.rays > 1).then_some((width, at.rays)),
                split: at.panels * problem.model.split,
                ..problem.model.clone()
            };
            work(&WorldProblem { model: &model, ..*problem })
        })
    }

    /// The same with data that change smoothly about a world.
    pub fn smoothly<R>(
        &self,
        place: &Place,
        about: World,
        work: impl FnOnce(&WorldProblem<'_, f32>) -> Result<R>,
    ) -> Result<R> {
        self.through(place, |problem| place.seen.smoothly(problem, about, work))
    }
}

/// The search about the best end of the coarse ones by a population of worlds, and how sure it is.
fn populated(
    problem: &WorldProblem<'_, f32>,
    start: World,
    how: &Exploration,
    watch: &mut WorldWatch<'_>,
) -> Result<Option<Sure>> {
    let explored = quick(problem).explore((start, None), how, watch)?;
    explored.map(|explored| valued(problem, &explored)).transpose()
}

/// The same where data are convex about a volume only.
fn about_volumes(
    seen: &Seen,
    problem: &WorldProblem<'_, f32>,
    volume: &Anchor,
    how: &Exploration,
    watch: &mut WorldWatch<'_>,
) -> Result<Option<Sure>> {
    let (quick, start) = (quick(problem), volume.world);
    let first = seen.about(&quick, volume, |quick| Ok(Anchor::of(quick, &quick.solve(start)?)))?;
    let Some(first) = first else {
        let x = refined(&volume.voxels, &volume.x, &problem.voxels())?;
        let Some(explored) = quick.explore((start, Some(&x)), how, watch)? else {
            return Ok(None);
        };
        return surely_about((seen, problem), &explored).map(Some);
    };
    let explored = seen.about(&quick, &first, |quick| quick.explore((start, None), how, watch))?;
    let Some(explored) = explored.flatten() else { return Ok(None) };
    let short = Exploration { worlds: how.worlds / 2, ..*how };
    let Some(explored) = nearer(seen, &quick, explored, &short, watch)? else {
        return Ok(None);
    };
    let anchor = Anchor::of(problem, &explored.best);
    let found = seen.about(problem, &anchor, |problem| surely_about((seen, problem), &explored))?;
    Ok(found.map(|(spread, reduced, world)| (spread.filter(|_| reduced < WAY), reduced, world)))
}

/// A problem whose volumes tell worlds apart and no more: populations look for where steps begin, with volumes that are
/// solved for.
fn quick<'a>(problem: &WorldProblem<'a, f32>) -> WorldProblem<'a, f32> {
    let patience = Patience::looking(problem.effort.patience.looking);
    WorldProblem { effort: Effort { patience, ..problem.effort }, ..*problem }
}

/// Whether steps along differences of images follow a search: χ² has to be smooth, and they know one volume.
pub(super) fn is_stepped(seen: &Seen, problem: &WorldProblem<'_, f32>) -> bool {
    (problem.model.ring.is_some() || seen.is_images()) && !problem.change.is_any()
}

/// χ²/N above which a search about volumes is still on its way: the bowl there says nothing about where it leads.
const WAY: f64 = 3.0;

/// How sure the best of the worlds that were explored is.
fn surely_about(
    (seen, problem): (&Seen, &WorldProblem<'_, f32>),
    explored: &Explored,
) -> Result<Sure> {
    if is_stepped(seen, problem) {
        let (polished, reduced) = polished(problem, &explored.best)?;
        let spread = surely(problem, None, &polished, reduced)?;
        let world = spread.as_ref().map_or(polished.best.world, |spread| spread.world);
        return Ok((spread, reduced, world));
    }
    valued(problem, explored)
}

/// How sure it is, by the values of the worlds around.
fn valued(problem: &WorldProblem<'_, f32>, explored: &Explored) -> Result<Sure> {
    let reduced = problem.scale * problem.left(&explored.best)?;
    let spread = Spread::of(problem.free, &explored.samples, reduced);
    let world = lower(&quick(problem), explored, spread.as_ref())?;
    Ok((spread, reduced, world))
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

/// Searches of a part of the worlds, each about a nearer volume, at most, and that part.
const NEARER: usize = 16;
pub(super) const PART: usize = 4;

/// Short searches, each about the best volume so far, until none is better: their best world with the volume that explains
/// the data as they are, which a last search about it has looked around.
pub(super) fn nearer(
    seen: &Seen,
    problem: &WorldProblem<'_, f32>,
    mut explored: Explored,
    short: &Exploration,
    watch: &mut WorldWatch<'_>,
) -> Result<Option<Explored>> {
    explored.best = problem.solve_from(explored.best.world, &explored.best.x)?;
    for _ in 0..NEARER {
        let (anchor, world) = (Anchor::of(problem, &explored.best), explored.best.world);
        let next =
            seen.about(problem, &anchor, |problem| problem.explore((world, None), short, watch))?;
        let Some(mut next) = next.flatten() else { return Ok(None) };
        next.best = problem.solve_from(next.best.world, &next.best.x)?;
        if next.best.value >= explored.best.value {
            break;
        }
        explored = next;
    }
    Ok(Some(explored))
}
