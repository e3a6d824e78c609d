//! One minimum.

use crate::problem::ImageProblem;
use kerrlight_tomo::optimise::Lbfgs;

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
    /// True if the gradient says that this is a minimum.
    pub has_converged: bool,
}

/// Pairs of steps and gradient differences that L-BFGS keeps.
const MEMORY: usize = 10;
/// Iterations over which the loss has to fall by [`FALL`] of itself to go on.
const SPAN: usize = 20;
const FALL: f64 = 1e-4;
/// Sum of all slopes with the logarithm of light over the loss, at a minimum at most: pixels that change by 1 % each, whichever way,
/// change the loss by less than 0.15 %.
const FLAT: f64 = 0.15;

/// Result of L-BFGS.
pub(super) struct Minimum {
    pub parameters: Vec<f64>,
    pub loss: f64,
    pub iterations: usize,
    pub has_converged: bool,
}

/// The minimum that L-BFGS comes to from these parameters; none if `go_on` said no.
///
/// It steps in parameters times [`ImageProblem::scales`]. Where it ends, dark pixels that the gradient wants brighter are
/// raised, and it begins again from there, until the gradient says that this is a minimum.
pub fn solve(
    problem: &ImageProblem<'_>,
    start: &[f64],
    iterations: usize,
    go_on: &(dyn Fn() -> bool + Sync),
) -> Option<Solution> {
    let scales = problem.scales();
    let plain = |x: &[f64]| -> Vec<f64> { x.iter().zip(&scales).map(|(x, s)| x / s).collect() };
    let mut objective = |x: &[f64], g: &mut [f64]| {
        let value = problem.value_and_gradient(&plain(x), g);
        g.iter_mut().zip(&scales).for_each(|(g, s)| *g /= s);
        value
    };
    let mut parameters = start.to_vec();
    let (mut least, mut used) = (f64::INFINITY, 0);
    loop {
        let scaled: Vec<f64> = parameters.iter().zip(&scales).map(|(x, s)| x * s).collect();
        let found = minimum(&mut objective, &scaled, iterations - used, go_on)?;
        parameters = plain(&found.parameters);
        used += found.iterations;
        // Before dark pixels are raised: the loss and its gradient are those of this image.
        let image = problem.image(&parameters);
        let mut gradient = vec![0.0; parameters.len()];
        let loss = problem.value_and_gradient(&parameters, &mut gradient);
        let slope = problem.raise(&mut parameters, &gradient);
        let has_converged = slope <= FLAT * loss;
        // A round may make no iteration at all: unless the loss has to fall there is no end.
        let goes_on = least - loss > FALL * loss && used < iterations;
        if has_converged || !goes_on {
            return Some(Solution { parameters, image, loss, iterations: used, has_converged });
        }
        least = loss;
    }
}

/// The same of a function that returns its value and overwrites its gradient.
pub(super) fn minimum(
    objective: &mut dyn FnMut(&[f64], &mut [f64]) -> f64,
    start: &[f64],
    iterations: usize,
    go_on: &(dyn Fn() -> bool + Sync),
) -> Option<Minimum> {
    let mut parameters = start.to_vec();
    let mut lbfgs = Lbfgs::new(parameters.len(), MEMORY);
    let mut losses: Vec<f64> = Vec::new();
    let mut has_settled = false;
    while losses.len() < iterations && !has_settled {
        if !go_on() {
            return None;
        }
        let Some(value) = lbfgs.step(objective, &mut parameters) else { break };
        losses.push(value);
        let before = losses.len().checked_sub(SPAN + 1).map(|k| losses[k]);
        has_settled =
            before.is_some_and(|before| before - losses[losses.len() - 1] < FALL * before);
    }
    let loss = lbfgs.value.unwrap_or(f64::NAN);
    let slope: f64 = lbfgs.gradient.iter().map(|g| g.abs()).sum();
    let has_converged = slope <= FLAT * loss;
    Some(Minimum { parameters, loss, iterations: losses.len(), has_converged })
}
