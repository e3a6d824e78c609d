//! The best field of one of many similar problems: as near the minimum as the differences between them ask.

use super::certificate::Certificate;
use super::data::Data;
use super::descent::{Descended, Ending};
use super::objective::{Objective, Penalised};
use super::operator::Operator;
use super::problem::LinearProblem;
use super::run::Run;
use super::settings::LinearSettings;
use super::solution::{Least, LinearProgress};
use crate::Error;
use crate::fit::forward::occupancy::dilated;
use core::ops::ControlFlow;
use kerrlight_common::simd::Float;

/// Rule that stops the solution of one of many similar problems.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct StopRule {
    /// Iterations over all nodes, from a dark field.
    pub looking: usize,
    /// Rounds over the nodes that shine and their neighbours, at most.
    pub rounds: usize,
    /// Iterations of a round, at most: it ends where ten of them lower the function by less than a hundredth of what
    /// noise changes it by.
    pub settling: usize,
}

/// Part of what noise changes the function by.
const SETTLED: f64 = 1e-2;
/// Nodes shine above this part of the brightest one.
const SHINES: f64 = 1e-3;
/// Iterations from a field that is given, for one from a dark field, where every node counts.
const NEARBY: usize = 2;
/// Rounds with prices of births.
const SHARPER: usize = 6;

impl StopRule {
    /// Nothing but iterations over all nodes.
    pub const fn looking(iterations: usize) -> Self {
        Self { looking: iterations, rounds: 0, settling: 0 }
    }
}

/// Result of a round.
struct Round {
    least: Least,
    ending: Ending,
    /// Gradient at all nodes.
    gradient: Vec<f64>,
}

impl<T: Float> LinearProblem<'_, T> {
    /// The best field after some patience, from a dark field or from one that is given: iterations over all nodes, then,
    /// of convex data, many over those that shine, of which there are few, until the others have no reason to.
    ///
    /// # Errors
    /// As those of [`solve`](Self::solve).
    ///
    /// # Panics
    /// If a field is given that has another number of values.
    pub fn settled(&self, start: Option<&[f64]>, how: StopRule) -> Result<Least, Error> {
        let data = self.data()?;
        if self.change.is_sharpened() && data.is_convex() {
            return self.sharpened(&data, start, how.looking);
        }
        // A prior has something to say of every node.
        if how.rounds == 0 || self.gaussian.is_some() || !data.is_convex() {
            let iterations = if start.is_some() { NEARBY * how.looking } else { how.looking };
            return self.least(start, iterations);
        }
        let mut least = match start {
            Some(start) => Least { x: start.to_vec(), value: f64::INFINITY },
            None => self.least(None, how.looking)?,
        };
        let most = least.x.iter().fold(0.0f64, |most, x| most.max(*x));
        let mut shines: Vec<bool> = least.x.iter().map(|x| *x > SHINES * most).collect();
        for _ in 0..how.rounds {
            let is_active = self.beside_those(shines);
            let round = self.over(&data, &is_active, &least.x, how.settling)?;
            let (x, gradient) = (&round.least.x, &round.gradient);
            let (mut inside, mut outside) = (0.0f64, 0.0f64);
            for ((x, g), is_active) in x.iter().zip(gradient).zip(&is_active) {
                let most = if *is_active { &mut inside } else { &mut outside };
                *most = most.max(Certificate::wrong(*x, *g, self.upper));
            }
            // Others need not satisfy the conditions better than those that count; where iterations
            // ran out, these may still improve.
            let is_done = outside <= inside && round.ending != Ending::Exhausted;
            shines = x.iter().zip(gradient).map(|(x, g)| *x > 0.0 || *g < -inside).collect();
            least = round.least;
            if is_done {
                break;
            }
        }
        Ok(least)
    }

    /// The best field where births that were found cost less than others: what all cost in the first solution pulls the
    /// field, and with it the geometry that is compared by it, towards few births.
    fn sharpened(
        &self,
        data: &Data<'_, T>,
        start: Option<&[f64]>,
        iterations: usize,
    ) -> Result<Least, Error> {
        let first = self.least(start, iterations)?;
        let most = first.x.iter().fold(0.0f64, |most, x| most.max(*x));
        let shines = first.x.iter().map(|x| *x > SHINES * most).collect();
        let active = self.active(&self.beside_those(shines));
        let settings = settling();
        // Prices change from round to round, nodes do not: the matrix is made once.
        let operator = Operator::new(self.walk(), active, self.frames, settings.memory);
        let mut watch = |_: &LinearProgress| ControlFlow::Continue(());
        let mut run = Run::new(self, &settings, &mut watch);
        let mut inner = operator.active.gather(&first.x);
        let mut value = first.value;
        for _ in 0..SHARPER {
            let x = operator.active.expand(&inner);
            let prices = self.change.prices(&x, self.voxels.shape());
            let terms = Penalised { prices: &prices, ..self.penalised(data) };
            let mut objective = Objective::new(&operator, data, terms);
            let found = run.minimise(&mut objective, &inner, iterations / 2);
            value = objective.finite(found.value, &found.x)?;
            inner = found.x;
        }
        Ok(Least { x: operator.active.expand(&inner), value })
    }

    /// Nodes that are not farther than one from those that are marked, and all parameters beside the nodes.
    fn beside_those(&self, mut marked: Vec<bool>) -> Vec<bool> {
        let all = marked.len();
        marked.truncate(all - self.beside());
        let mut is_active = dilated(marked, self.voxels.nodes, 1);
        is_active.resize(all, true);
        is_active
    }

    /// Iterations over some nodes.
    fn over(
        &self,
        data: &Data<'_, T>,
        is_active: &[bool],
        x: &[f64],
        iterations: usize,
    ) -> Result<Round, Error> {
        let settings = settling();
        let mut watch = |_: &LinearProgress| ControlFlow::Continue(());
        let mut run = Run::new(self, &settings, &mut watch);
        let active = self.active(is_active);
        let operator = Operator::new(self.walk(), active, self.frames, settings.memory);
        let mut objective = Objective::new(&operator, data, self.penalised(data));
        let start = operator.active.gather(x);
        let Descended { x: inner, value, ending } =
            run.minimise(&mut objective, &start, iterations);
        let value = objective.finite(value, &inner)?;
        let gradient = self.only_allowed(objective.everywhere(&inner).1);
        Ok(Round { least: Least { x: operator.active.expand(&inner), value }, ending, gradient })
    }
}

/// Returns settings of iterations that end where they hardly lower the function.
fn settling() -> LinearSettings {
    LinearSettings { settled: SETTLED, tolerance: 0.0, ..LinearSettings::default() }
}
