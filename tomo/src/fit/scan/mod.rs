//! Scan for the axis that matter turns about: the linear problem of a coarse grid, solved for axes all over the sphere,
//! and again with a finer grid where its loss is least.
//!
//! The loss of an axis is the least χ² of any field of emission that turns about it (variable
//! projection, Golub & Pereyra 1973), so that no field has to be guessed before the axis is known and both
//! hemispheres are searched alike: a local minimum near the antipode of the axis is usual (Levis et al. 2022).

mod map;
mod refine;

use super::linear::{LinearError, LinearProblem, Voxels};
use crate::Error;
use kerrlight_common::simd::Float;
use kerrlight_render::dynamics::Axis;
use rayon::prelude::*;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

/// A grid, and how long its problem is solved.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Effort {
    /// Nodes along each axis.
    pub nodes: usize,
    /// Iterations from a dark field.
    pub iterations: usize,
}

/// Settings of the search of the sphere.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AxisSettings {
    /// Points of the lattice over the whole sphere.
    pub directions: usize,
    /// Effort of the solution at each axis.
    pub coarse: Effort,
    /// Local minima of the lattice that are refined, the best one of the hemisphere opposite to the best included.
    pub candidates: usize,
    /// Effort of the solutions of the refinement.
    pub fine: Effort,
    /// Times that the step of the refinement is halved; it begins with half the distance of lattice points, √(4π/directions).
    pub halvings: usize,
}

impl Default for AxisSettings {
    fn default() -> Self {
        Self {
            directions: 160,
            coarse: Effort { nodes: 16, iterations: 10 },
            candidates: 3,
            fine: Effort { nodes: 20, iterations: 20 },
            halvings: 3,
        }
    }
}

/// An axis and its loss.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AxisLoss {
    /// Direction.
    pub axis: Axis,
    /// Σ weight · χ²/data of the best field found.
    pub loss: f64,
}

/// Result of a scan.
#[derive(Clone, Debug, PartialEq)]
pub struct AxisScan {
    /// The lattice with its losses, of the coarse problem.
    pub map: Vec<AxisLoss>,
    /// The best axis, with the loss of the fine problem.
    pub best: AxisLoss,
    /// The best one of the opposite hemisphere, with the loss of the fine problem.
    pub runner_up: AxisLoss,
}

/// Told how many problems are solved of about how many, by any thread; says whether to go on.
pub type ScanWatch<'a> = dyn Fn(usize, usize) -> bool + Sync + 'a;

/// Point k of n on a Fibonacci lattice (Swinbank & Purser 2006): z = 1 − (2k + 1)/n, successive points a golden
/// angle apart in longitude. Every point stands for 4π/n of the sphere.
pub fn lattice(directions: usize) -> Vec<Axis> {
    let golden = core::f64::consts::PI * (3.0 - 5f64.sqrt());
    let point = |k: usize| {
        let z = 1.0 - (2 * k + 1) as f64 / directions as f64;
        let (s, (sin, cos)) = ((1.0 - z * z).sqrt(), (golden * k as f64).sin_cos());
        Axis::new([s * cos, s * sin, z]).ok()
    };
    (0..directions).filter_map(point).collect()
}

impl AxisSettings {
    fn checked(self) -> Result<Self, Error> {
        let check =
            |field, value: usize, ok, allowed| Error::check(field, value as f64, ok, allowed);
        check("directions", self.directions, self.directions >= 8, "8 or more")?;
        check("candidates", self.candidates, self.candidates >= 2, "2 or more")?;
        for Effort { nodes, iterations } in [self.coarse, self.fine] {
            check("nodes", nodes, (4..=256).contains(&nodes), "4 to 256 along each axis")?;
            check("iterations", iterations, iterations > 0, "1 or more")?;
        }
        Ok(self)
    }

    /// Distance of lattice points, rad.
    fn distance(&self) -> f64 {
        (4.0 * core::f64::consts::PI / self.directions as f64).sqrt()
    }
}

/// A scan under way.
struct Scanner<'a, T: Float> {
    problem: &'a LinearProblem<'a, T>,
    watch: &'a ScanWatch<'a>,
    solved: AtomicUsize,
    expected: usize,
    cancelled: AtomicBool,
}

impl<'a, T: Float> Scanner<'a, T> {
    fn new(problem: &'a LinearProblem<'a, T>, watch: &'a ScanWatch<'a>, expected: usize) -> Self {
        let (solved, cancelled) = (AtomicUsize::new(0), AtomicBool::new(false));
        Self { problem, watch, solved, expected, cancelled }
    }

    /// The loss of each axis; none if the scan was cancelled. Axes are shared among threads, and each
    /// has its own sums: their number does not change a bit.
    fn losses(&self, axes: &[Axis], effort: Effort) -> Result<Option<Vec<AxisLoss>>, Error> {
        let all: Vec<Option<AxisLoss>> =
            axes.par_iter().map(|axis| self.loss(*axis, effort)).collect::<Result<_, _>>()?;
        Ok(all.into_iter().collect())
    }

    fn loss(&self, axis: Axis, effort: Effort) -> Result<Option<AxisLoss>, Error> {
        // Relaxed: neither the flag nor the count hands anything else from thread to thread.
        if self.cancelled.load(Ordering::Relaxed) {
            return Ok(None);
        }
        // Redshifts depend on the axis: threads that share the model cannot weigh it for theirs.
        let mut own = None;
        if self.problem.model.is_shifted() {
            own.insert(self.problem.model.clone()).weigh(axis);
        }
        let model = own.as_ref().unwrap_or(self.problem.model);
        let voxels = Voxels { nodes: [effort.nodes; 3], ..self.problem.voxels };
        let problem = LinearProblem { model, axis, voxels, ..*self.problem };
        let loss = problem.least(None, effort.iterations)?.value;
        let solved = self.solved.fetch_add(1, Ordering::Relaxed) + 1;
        // Pattern searches may take more than was expected of them.
        if !(self.watch)(solved, self.expected.max(solved)) {
            self.cancelled.store(true, Ordering::Relaxed);
        }
        Ok(Some(AxisLoss { axis, loss }))
    }

    /// The best refined axis of the opposite hemisphere; where all have come over to this one, the lattice's best
    /// there, with the loss of the fine problem.
    fn opposite(
        &self,
        axis: Axis,
        found: &[AxisLoss],
        map: &[AxisLoss],
        effort: Effort,
    ) -> Result<Option<AxisLoss>, Error> {
        let best = |all: &[AxisLoss]| {
            let there = all.iter().filter(|found| found.axis.dot(axis) < 0.0);
            there.min_by(|a, b| a.loss.total_cmp(&b.loss)).copied()
        };
        if let Some(found) = best(found) {
            return Ok(Some(found));
        }
        let other = best(map).map_or(axis.antipode(), |other| other.axis);
        Ok(self.losses(&[other], effort)?.and_then(|losses| losses.first().copied()))
    }
}

/// The axis of least loss on the whole sphere; none if the watch wanted no more. The problem is that of any axis, with
/// trilinear voxels of any number.
///
/// # Errors
/// If a number is out of its range, data do not fit the rays, a χ² is not finite, or all axes have the same loss.
pub fn scan_axis(
    problem: &LinearProblem<'_, f32>,
    settings: &AxisSettings,
    watch: &ScanWatch<'_>,
) -> Result<Option<AxisScan>, Error> {
    search(problem, settings, watch)
}

fn search<T: Float>(
    problem: &LinearProblem<'_, T>,
    settings: &AxisSettings,
    watch: &ScanWatch<'_>,
) -> Result<Option<AxisScan>, Error> {
    let settings = settings.checked()?;
    // A candidate takes its own point and a hexagon for each length of steps; moves add more.
    let expected = settings.directions + settings.candidates * (7 + 6 * settings.halvings);
    let scanner = Scanner::new(problem, watch, expected);
    let Some(map) = scanner.losses(&lattice(settings.directions), settings.coarse)? else {
        return Ok(None);
    };
    told_apart(&map)?;
    let candidates = candidates(&map, settings.candidates, settings.distance());
    let mut found = Vec::new();
    for candidate in candidates {
        // A lattice point stands for what lies within half a spacing of it.
        let step = 0.5 * settings.distance();
        match scanner.refined(candidate, step, settings.fine, settings.halvings)? {
            Some(refined) => found.push(refined),
            None => return Ok(None),
        }
    }
    found.sort_by(|a, b| a.loss.total_cmp(&b.loss));
    let best = found[0];
    let Some(runner_up) = scanner.opposite(best.axis, &found, &map, settings.fine)? else {
        return Ok(None);
    };
    Ok(Some(AxisScan { map, best, runner_up }))
}

/// Losses that differ by less than this part of them are the same in single precision.
const SAME: f64 = 1e-6;

/// Refuses a map whose losses are all the same.
fn told_apart(map: &[AxisLoss]) -> Result<(), Error> {
    let least = map.iter().fold(f64::INFINITY, |least, at| least.min(at.loss));
    let most = map.iter().fold(f64::NEG_INFINITY, |most, at| most.max(at.loss));
    if most - least > SAME * most.abs() {
        return Ok(());
    }
    Err(LinearError::Alike { axes: map.len(), loss: least }.into())
}

/// First step of the refinement of an axis, rad: half of what lattice points of 200 are apart by.
const STEP: f64 = 0.06;
/// Iterations of its grids: with few, a wrong axis is as good as the right one.
const ITERATIONS: usize = 40;

/// The axis of least loss near one that is nearly right, on grids of so many nodes along each axis; none if the watch wanted
/// no more. A finer grid and more pixels than those of the scan tell axes apart that it could not.
///
/// # Errors
/// If a number is out of its range, or data do not fit the rays.
pub fn refine_axis(
    problem: &LinearProblem<'_, f32>,
    from: Axis,
    nodes: usize,
    watch: &ScanWatch<'_>,
) -> Result<Option<AxisLoss>, Error> {
    let fine = Effort { nodes, iterations: ITERATIONS };
    let AxisSettings { fine: effort, halvings, .. } =
        AxisSettings { fine, ..AxisSettings::default() }.checked()?;
    Scanner::new(problem, watch, 1 + 8 * (1 + halvings)).refined(from, STEP, effort, halvings)
}

/// The best points that are not near better ones; one of the hemisphere opposite to the best is among them.
fn candidates(map: &[AxisLoss], count: usize, distance: f64) -> Vec<Axis> {
    let mut order = map.to_vec();
    order.sort_by(|a, b| a.loss.total_cmp(&b.loss));
    let apart = (2.0 * distance).cos();
    let mut chosen: Vec<Axis> = Vec::new();
    for point in &order {
        if chosen.len() < count && chosen.iter().all(|axis| axis.dot(point.axis) < apart) {
            chosen.push(point.axis);
        }
    }
    let Some(first) = chosen.first().copied() else { return chosen };
    let opposite = |axis: &Axis| axis.dot(first) < 0.0;
    let other = order.iter().find(|point| opposite(&point.axis));
    if let Some(other) = other.filter(|_| !chosen.iter().any(opposite)) {
        // The worst makes room: a minimum near the antipode of the axis is usual.
        chosen.pop();
        chosen.push(other.axis);
    }
    chosen
}

#[cfg(test)]
mod tests;
