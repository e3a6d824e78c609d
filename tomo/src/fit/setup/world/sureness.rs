//! How sure a world is: the bowl beneath the ripples, along other rays and with other voxels.
//!
//! Volumes that are not solved for to the end, and voxels that are too coarse, move a world by far more than noise does: where
//! data are not explained, solutions take the iterations that they need, then voxels are made finer, and what may be left of
//! that is part of the error.

use crate::fit::setup::Result;
use crate::fit::world::{
    Effort, Envelope, Estimate, Free, Polish, Polished, Spread, World, WorldProblem,
};

/// Other rays that the best world is looked for through.
const LATTICES: u64 = 3;
/// Iterations of the first solution of a world, for each of a search.
pub(super) const PATIENCE: usize = 4;
/// The number of a lattice that has as many voxels as the fit.
const SAME: u64 = 0;

/// χ²/N above which volumes are not yet solved for, or voxels too coarse.
const ROUGH: f64 = 1.2;
/// Iterations of all solutions are multiplied by this, at most, where the usual ones do not suffice.
const MORE: usize = 4;
/// Voxels along each axis are multiplied by this.
const FINER: [usize; 2] = [5, 4];
/// The most that finer voxels may be thought to leave of what the coarser ones have left: where they help no more, the
/// model is wrong, and errors are large.
const MOST: f64 = 0.8;

/// The best world near another one, its χ²/N, and how sure it is.
pub(super) fn surest(
    problem: &WorldProblem<'_, f32>,
    start: &Estimate,
) -> Result<(Polished, f64, Option<Spread>)> {
    let usual = Polish::default();
    let (first, left) = polished(problem, start, &usual)?;
    // A prior is one of its own voxels, and no χ² of 1 is expected beside it.
    if left < ROUGH || problem.gaussian.is_some() {
        let spread = surely(problem, &first, left, &usual)?;
        return Ok((first, left, spread));
    }
    let how = Polish { iterations: MORE * usual.iterations, around: MORE * usual.around, ..usual };
    let (coarse, left) = patiently(problem, problem.effort.nodes, first.best.world, &how)?;
    if left < ROUGH {
        let patient = patient(problem, problem.effort.nodes);
        let spread = surely(&patient, &coarse, left, &how)?;
        return Ok((coarse, left, spread));
    }
    let nodes = problem.effort.nodes * FINER[0] / FINER[1];
    let (fine, less) = patiently(problem, nodes, coarse.best.world, &how)?;
    let spread = surely(&patient(problem, nodes), &fine, less, &how)?.map(|spread| {
        let worlds = [coarse.best.world, fine.best.world];
        spread.widened(problem.free, &beyond(problem.free, worlds, [left, less]))
    });
    Ok((fine, less, spread))
}

/// The same problem with as many iterations as it takes, and so many voxels along each axis.
fn patient<'a>(problem: &WorldProblem<'a, f32>, nodes: usize) -> WorldProblem<'a, f32> {
    let iterations = MORE * problem.effort.iterations;
    WorldProblem {
        effort: Effort { nodes, iterations, settles: true, ..problem.effort },
        ..*problem
    }
}

/// The best world near another one of that, and its χ²/N.
fn patiently(
    problem: &WorldProblem<'_, f32>,
    nodes: usize,
    about: World,
    how: &Polish,
) -> Result<(Polished, f64)> {
    let problem = patient(problem, nodes);
    polished(&problem, &problem.solve(about)?, how)
}

/// How far the worlds of coarser and finer voxels suggest that the one of the finest would be from the finer one: what is
/// not explained, whose root is `excess`, pulls at the world in proportion.
fn beyond(free: &[Free], [coarse, fine]: [World; 2], reduced: [f64; 2]) -> Vec<f64> {
    let [before, after] = reduced.map(|reduced| (reduced - 1.0).max(0.0).sqrt());
    let part = (after / before).min(MOST);
    let apart = |free: &Free| {
        let parameter = free.parameter;
        parameter.difference(fine.get(parameter), coarse.get(parameter))
    };
    free.iter().map(|free| part / (1.0 - part) * apart(free)).collect()
}

/// The best world near another one, and its χ²/N.
fn polished(
    problem: &WorldProblem<'_, f32>,
    start: &Estimate,
    how: &Polish,
) -> Result<(Polished, f64)> {
    let polished = problem.polish(start, how)?;
    let reduced = problem.scale * problem.reduced(polished.best.chi2);
    Ok((polished, reduced))
}

/// A few voxels more or less, and as many iterations as a start from a dark field takes.
fn other_voxels(effort: Effort, number: u64) -> Effort {
    const MORE: [usize; 6] = [2, 5, 1, 4, 3, 6];
    let nodes = effort.nodes + MORE[number as usize % MORE.len()] - 2;
    let nodes = nodes.max(effort.degree.taps());
    Effort { nodes, iterations: PATIENCE * effort.iterations, ..effort }
}

/// How sure a world is: the bowl beneath the ripples of the values around, seen along several lattices of rays and with
/// several numbers of voxels; without one, the second derivatives at the best world alone. Errors grow with χ²/N where that is
/// above 1.
fn surely(
    problem: &WorldProblem<'_, f32>,
    polished: &Polished,
    reduced: f64,
    how: &Polish,
) -> Result<Option<Spread>> {
    let n = problem.free.len();
    if polished.covariance.iter().any(|x| !x.is_finite()) {
        return Ok(None);
    }
    let inflation = reduced.max(1.0);
    let envelope = enveloped(problem, polished, (inflation, how))?.unwrap_or_else(|| Envelope {
        world: polished.best.world,
        covariance: polished.covariance.iter().map(|x| x * inflation).collect(),
        ripple: 0.0,
        worlds: 1,
    });
    let Envelope { world, covariance, ripple, worlds } = envelope;
    let whole: Vec<f64> = (0..n).map(|k| covariance[k * n + k].sqrt()).collect();
    let correlation = (0..n * n).map(|k| covariance[k] / (whole[k / n] * whole[k % n]));
    let correlation = correlation.collect();
    // Nobody knows less than before the data.
    let sigma = problem.free.iter().zip(whole).map(|(free, x)| x.min(free.prior.deviation()));
    let sigma: Vec<f64> = sigma.collect();
    let open = problem.free.iter().zip(&sigma).map(|(free, sigma)| free.is_open(*sigma)).collect();
    Ok(Some(Spread { world, sigma, open, correlation, ripple, worlds }))
}

/// The bowl beneath the ripples, along other lattices of rays too; with other voxels, where the data alone decide.
fn enveloped(
    problem: &WorldProblem<'_, f32>,
    polished: &Polished,
    (inflation, how): (f64, &Polish),
) -> Result<Option<Envelope>> {
    let numbers = 1..=LATTICES;
    let models: Vec<_> = numbers.clone().map(|number| problem.model.seen_along(number)).collect();
    let others: Vec<WorldProblem<'_, f32>> = numbers
        .zip(&models)
        .map(|(number, model)| {
            let effort = other_voxels(problem.effort, problem.gaussian.map_or(number, |_| SAME));
            WorldProblem { model, effort, ..*problem }
        })
        .collect();
    problem.envelope(polished, &others, (inflation, how))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fit::world::{Parameter, Prior};

    /// Residuals that shrink by a half, and worlds that are 0.2 apart: as much again is to come. Where nothing is gained, four
    /// times as much.
    #[test]
    fn exact_what_is_to_come_is_a_geometric_series() {
        let prior = Prior::Uniform { low: -0.9, high: 0.9 };
        let free = [Free { parameter: Parameter::Spin, prior }];
        let world = |spin: f64| World::new(spin, 1.0, 2.0);
        let of = |reduced: [f64; 2]| beyond(&free, [world(0.3), world(0.5)], reduced)[0];
        assert!((of([5.0, 2.0]) - 0.2).abs() < 1e-12);
        assert!((of([5.0, 5.0]) - 0.8).abs() < 1e-12);
        assert_eq!(of([5.0, 0.9]), 0.0);
        let spread = Spread {
            world: world(0.5),
            sigma: vec![0.03],
            open: vec![false],
            correlation: vec![1.0],
            ripple: 0.0,
            worlds: 9,
        };
        let wider = spread.clone().widened(&free, &[0.04]);
        assert!((wider.sigma[0] - 0.05).abs() < 1e-12);
        assert!((wider.correlation[0] - 1.0).abs() < 1e-12);
        assert_eq!(spread.widened(&free, &[9.0]).open, [true]);
    }
}
