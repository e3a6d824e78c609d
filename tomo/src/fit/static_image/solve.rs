//! One minimum.

use super::ImageProblem;
use crate::optimise::{Lbfgs, LbfgsState, Step};

/// An image that no step improves, or that iterations have ended at.
#[derive(Clone, Debug, PartialEq)]
pub struct Solution {
    /// Parameters of the problem.
    pub parameters: Vec<f64>,
    /// Pixels, Jy.
    pub image: Vec<f64>,
    /// The loss.
    pub loss: f64,
    /// Iterations that were made.
    pub iterations: usize,
    /// Whether the loss had ceased to fall.
    pub has_converged: bool,
}

/// Iterations over which the loss has to fall by [`FALL`] of itself to go on.
const SPAN: usize = 20;
const FALL: f64 = 1e-4;

/// Where L-BFGS came to.
pub(super) struct Minimum {
    pub parameters: Vec<f64>,
    pub loss: f64,
    pub iterations: usize,
    pub has_converged: bool,
}

/// The minimum that L-BFGS comes to from these parameters; none if `go_on` said no.
pub fn solve(
    problem: &ImageProblem<'_>,
    start: &[f64],
    iterations: usize,
    go_on: &(dyn Fn() -> bool + Sync),
) -> Option<Solution> {
    let mut objective = |x: &[f64], g: &mut [f64]| problem.value_and_gradient(x, g);
    let Minimum { parameters, loss, iterations, has_converged } =
        minimum(&mut objective, start, iterations, go_on)?;
    let image = problem.image(&parameters);
    Some(Solution { parameters, image, loss, iterations, has_converged })
}

/// The same of a function that returns its value and overwrites its gradient.
pub(super) fn minimum(
    mut objective: &mut dyn FnMut(&[f64], &mut [f64]) -> f64,
    start: &[f64],
    iterations: usize,
    go_on: &(dyn Fn() -> bool + Sync),
) -> Option<Minimum> {
    let lbfgs = Lbfgs::default();
    let mut parameters = start.to_vec();
    let mut state = LbfgsState::new(parameters.len(), lbfgs.memory);
    let mut losses: Vec<f64> = Vec::new();
    let mut has_converged = false;
    while losses.len() < iterations && !has_converged {
        if !go_on() {
            return None;
        }
        match lbfgs.step(&mut objective, &mut state, &mut parameters) {
            Step::Taken { value, .. } => losses.push(value),
            Step::NoDescent | Step::NotFinite => break,
        }
        let before = losses.len().checked_sub(SPAN + 1).map(|k| losses[k]);
        has_converged =
            before.is_some_and(|before| before - losses[losses.len() - 1] < FALL * before);
    }
    let ended = losses.len() < iterations;
    let loss = state.value.unwrap_or(f64::NAN);
    Some(Minimum {
        parameters,
        loss,
        iterations: losses.len(),
        has_converged: (has_converged || ended) && loss.is_finite(),
    })
}
