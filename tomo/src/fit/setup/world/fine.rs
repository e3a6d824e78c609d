//! The search about the best end of the coarse ones, steps from its best world, and how sure that one is.

use super::discretisation;
use super::posterior::{Resampled, polished, surely};
use super::seen::{BESIDE_THE_RING, Seen};
use super::tangent::Anchor;
use crate::fit::journal::Memory;
use crate::fit::linear::{Patience, refined};
use crate::fit::settings::{FitFile, UnknownWorld, WorldView};
use crate::fit::setup::{Measured, Result, spacing};
use crate::fit::world::{
    Effort, Exploration, Explored, Polished, Spread, World, WorldProblem, WorldWatch,
};

/// How sure a world is, its χ²/N, and the world.
type Sure = (Option<Spread>, f64, World);

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
    /// From the best end of the coarse search, which leaves so much of each datum, to the best world, and by what χ² was
    /// multiplied there; none if it was cancelled.
    pub fn search(
        &self,
        start: (World, Option<&Anchor>),
        reduced_chi2: f64,
        how: &Exploration,
        watch: &mut WorldWatch<'_>,
    ) -> Result<Option<(Sure, f64)>> {
        let search = &self.unknown.search;
        let errors = (self.scale)(reduced_chi2);
        let seen = Seen::finely(self.file, self.measured, &search.fine)?;
        let found = self.through((&seen, &search.fine), errors, |fine, problem| {
            fine.search(problem, start, how, watch)
        })?;
        let Some((spread, reduced, world)) = found else { return Ok(None) };
        let Some(finest) = search.finest() else {
            let spread = self.beside_its_own((&seen, &search.fine), errors, (spread, reduced))?;
            return Ok(Some(((spread, reduced, world), errors)));
        };
        let errors = (self.scale)(reduced / errors);
        let seen = Seen::closely(self.file, self.measured, &finest)?;
        let (polished, reduced) =
            self.through((&seen, &finest), errors, |fine, problem| fine.finest(problem, world))?;
        let world = polished.best.world;
        let free = &self.unknown.free;
        // What finer voxels and pixels moved the world by is what finer ones still might.
        let spread = spread.map(|spread| spread.moved(free, world));
        let spread = self.beside_its_own((&seen, &finest), errors, (spread, reduced))?;
        Ok(Some(((spread, reduced, world), errors)))
    }

    /// With the errors that the model has of itself.
    fn beside_its_own(
        &self,
        (seen, view): (&Seen, &WorldView),
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
        (seen, view): (&Seen, &WorldView),
        scale: f64,
        work: impl FnOnce(&Fine<'_>, &WorldProblem<'_, f32>) -> Result<R>,
    ) -> Result<R> {
        let Self { unknown, memory, .. } = *self;
        let fine = Fine { seen, unknown };
        seen.with(unknown, view, (scale, memory), |problem| work(&fine, problem))
    }
}

/// A search about one world.
struct Fine<'a> {
    /// Data.
    seen: &'a Seen,
    /// What is not known.
    unknown: &'a UnknownWorld,
}

impl Fine<'_> {
    /// The search about the best end of the coarse one, and how sure it is.
    fn search(
        &self,
        problem: &WorldProblem<'_, f32>,
        (start, volume): (World, Option<&Anchor>),
        how: &Exploration,
        watch: &mut WorldWatch<'_>,
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
        let short = Exploration { worlds: how.worlds / 2, ..*how };
        let Some(explored) = nearer(self.seen, &quick, explored, &short, watch)? else {
            return Ok(None);
        };
        let anchor = Anchor::of(problem, &explored.best);
        let found = self.seen.about(problem, &anchor, |problem| {
            surely_about((self.seen, problem), None, &explored)
        })?;
        Ok(found.map(|(spread, reduced, world)| (spread.filter(|_| reduced < WAY), reduced, world)))
    }

    /// Steps from the best world of a population, and how sure their end is.
    fn steps(&self, problem: &WorldProblem<'_, f32>, explored: &Explored) -> Result<Sure> {
        let beside = (explored.best.world, BESIDE_THE_RING[1]);
        self.seen.smoothly(problem, beside, |problem| {
            surely_about((self.seen, problem), Some((self.seen, self.unknown)), explored)
        })
    }

    /// Steps from a world that a search with fewer voxels and pixels has found, to the best one near it and its χ²/N.
    fn finest(&self, problem: &WorldProblem<'_, f32>, start: World) -> Result<(Polished, f64)> {
        self.seen.smoothly(problem, (start, BESIDE_THE_RING[1]), |problem| {
            polished(problem, &problem.solve(start)?)
        })
    }
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
    resampled: Resampled<'_>,
    explored: &Explored,
) -> Result<Sure> {
    if is_stepped(seen, problem) {
        let (polished, reduced) = polished(problem, &explored.best)?;
        let spread = surely(problem, resampled, &polished, reduced)?;
        let world = spread.as_ref().map_or(polished.best.world, |spread| spread.world);
        return Ok((spread, reduced, world));
    }
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
