//! Weights of the linear problem, judged by frames that its solution has not seen.

use super::change::change;
use super::linear_problem::{misfit, solve_frames};
use super::{Result, linear_problem};
use crate::dynamics::Axis;
use crate::fit::Objective;
use crate::fit::journal::{self, Journal};
use crate::fit::linear::{Ending, LinearProgress};
use crate::fit::settings::{FitError, FitFile, HeldOutSettings, Kind, Start};
use core::ops::ControlFlow;

/// A value, and what frames that were held out say of it.
#[derive(Clone, Debug, PartialEq)]
pub struct Held {
    /// The value of the setting.
    pub value: f64,
    /// Loss of the held-out frames of each part: χ² per data point, weighted as in the fit.
    pub losses: Vec<f64>,
}

impl Held {
    /// Mean over the parts.
    pub fn mean(&self) -> f64 {
        self.losses.iter().sum::<f64>() / self.losses.len() as f64
    }

    /// Standard error of the difference between its mean and that of another, from the same parts.
    pub fn error_beside(&self, other: &Held) -> f64 {
        let n = self.losses.len() as f64;
        let apart: Vec<f64> = self.losses.iter().zip(&other.losses).map(|(a, b)| a - b).collect();
        let mean = apart.iter().sum::<f64>() / n;
        let square: f64 = apart.iter().map(|x| (x - mean).powi(2)).sum();
        (square / (n - 1.0) / n).sqrt()
    }
}

/// The value with the least mean loss.
pub fn best(all: &[Held]) -> Option<&Held> {
    all.iter().min_by(|a, b| a.mean().total_cmp(&b.mean()))
}

/// Told which value and which part is being solved, both from 0; says whether to go on.
pub type HeldWatch<'a> = dyn FnMut(usize, usize) -> bool + 'a;

/// Solves the linear problem for each value without each part of the frames, and looks at that part: the loss of
/// what was not fitted. `times` are those of the first and the last emission, M since the reference time. None if it
/// was cancelled. Parts that the journal knows of an earlier call are not solved again.
///
/// # Errors
/// If a setting is out of range, there are fewer frames than parts, or a problem has no solution.
pub fn hold_out(
    file: &FitFile,
    held_out: &HeldOutSettings,
    objective: &mut Objective<f32>,
    (axis, times): (Axis, [f64; 2]),
    journal: &dyn Journal,
    watch: &mut HeldWatch<'_>,
) -> Result<Option<Vec<Held>>> {
    let all = objective.observed();
    let folds = held_out.folds;
    if all.len() < 2 * folds {
        let allowed = format!("{} at most, half of the frames with data", all.len() / 2);
        return Err(FitError::range("held_out.folds".to_owned(), folds, &allowed).into());
    }
    objective.model.weigh(axis);
    let mut found = Vec::new();
    for (k, value) in held_out.values.iter().copied().enumerate() {
        let file = held_out.setting.put(file.clone(), value);
        let how = (axis, change(&file, times)?);
        let mut losses = Vec::new();
        for fold in 0..folds {
            let part = |seen: bool| -> Vec<usize> {
                let frames = all.iter().enumerate().filter(|(at, _)| (at % folds != fold) == seen);
                frames.map(|(_, frame)| *frame).collect()
            };
            let mut told = |_: &LinearProgress<'_>| match watch(k, fold) {
                true => ControlFlow::Continue(()),
                false => ControlFlow::Break(()),
            };
            let key = journal::key(("held out", value.to_bits(), fold));
            if let Some(&[loss]) = journal.recall(key).as_deref() {
                losses.push(loss);
                continue;
            }
            let nodes = nodes(&file);
            let problem = linear_problem::Of { file: &file, objective, how, nodes, seed: None };
            let solution = solve_frames(&problem, &part(true), &mut told)?;
            if solution.ending == Ending::Cancelled {
                return Ok(None);
            }
            let loss = misfit(&problem, &part(false), &solution.parameters())?;
            journal.keep(key, &[loss]);
            losses.push(loss);
        }
        found.push(Held { value, losses });
    }
    Ok(Some(found))
}

/// Nodes along each axis of the voxels that frames judge: those of the fit, or of its start.
fn nodes(file: &FitFile) -> usize {
    match file.training.start {
        Start::Linear { nodes, .. } if file.representation.kind != Kind::LinearGrid => nodes,
        _ => file.representation.grid_nodes(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exact_means_and_errors_of_differences() {
        let held = |value: f64, losses: [f64; 3]| Held { value, losses: losses.to_vec() };
        let all =
            [held(0.1, [1.0, 2.0, 3.0]), held(1.0, [1.5, 2.5, 3.5]), held(9.0, [1.0, 2.0, 6.0])];
        assert_eq!(best(&all).unwrap().value, 0.1);
        assert_eq!(all[0].mean(), 2.0);
        // The same difference in all parts is certain, however much the parts differ.
        assert_eq!(all[1].error_beside(&all[0]), 0.0);
        assert!((all[2].error_beside(&all[0]) - 1.0).abs() < 1e-12);
    }
}
