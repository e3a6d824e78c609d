//! Weights of the linear problem, judged by data that its solution has not seen.

use super::Result;
use super::change::change;
use super::linear_problem::{Of, solve_frames};
use crate::fit::Objective;
use crate::fit::journal::{self, Journal};
use crate::fit::linear::{Ending, LinearProgress, Watch};
use crate::fit::settings::{FieldKind, FitError, FitFile, HeldOutSettings};
use core::ops::ControlFlow;
use kerrlight_render::dynamics::Axis;

/// A value, and what data that were held out say of it.
#[derive(Clone, Debug, PartialEq)]
pub struct Held {
    /// The value of the setting.
    pub value: f64,
    /// χ² per data point of each part that was held out; of several kinds of data their mean, weighted as in the fit.
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

/// Says so where the chosen value is the first or the last of those that were tried; nothing of one between them.
pub fn told_end(tried: impl Iterator<Item = f64>, chosen: f64) -> &'static str {
    let [least, most] =
        tried.fold([f64::INFINITY, f64::NEG_INFINITY], |[a, b], x| [a.min(x), b.max(x)]);
    match [least, most].contains(&chosen) {
        true => "; it is the first or the last of the list, a better one may lie beyond",
        false => "",
    }
}

/// Told which value and which part is being solved, both from 0; says whether to go on.
pub type HeldWatch<'a> = dyn FnMut(usize, usize) -> bool + 'a;

/// Solves the linear problem for each value without each part of the data, and looks at that part: the loss of
/// what was not fitted. `times` are those of the first and the last emission, M since the reference time. None if it
/// was cancelled. Parts that the journal knows of an earlier call are not solved again.
///
/// # Errors
/// If a setting is out of range, there are fewer frames than parts, or a problem has no solution.
pub fn hold_out(
    file: &FitFile,
    held_out: &HeldOutSettings,
    objective: &mut Objective<f32>,
    axis: Axis,
    times: [f64; 2],
    journal: &dyn Journal,
    watch: &mut HeldWatch<'_>,
) -> Result<Option<Vec<Held>>> {
    objective.model.weigh(axis);
    let observed = objective.observed();
    check_folds(held_out, observed.len())?;
    let mut found: Vec<Held> =
        held_out.values.iter().map(|value| Held { value: *value, losses: Vec::new() }).collect();
    for fold in 0..held_out.folds {
        let (out, kept): (Vec<_>, Vec<_>) =
            observed.iter().enumerate().partition(|(at, _)| at % held_out.folds == fold);
        let parts = [kept, out].map(|part| part.into_iter().map(|(_, frame)| *frame).collect());
        for (k, held) in found.iter_mut().enumerate() {
            let key = journal::key((held.value.to_bits(), fold));
            if let Some(&[loss]) = journal.recall(key).as_deref() {
                held.losses.push(loss);
                continue;
            }
            let file = held_out.setting.put(file.clone(), held.value);
            let mut told = |_: &LinearProgress| match watch(k, fold) {
                true => ControlFlow::Continue(()),
                false => ControlFlow::Break(()),
            };
            let change = change(&file, times)?;
            let of = Of { file: &file, objective, axis, change, seed: None };
            let Some(loss) = loss(&of, &parts, &mut told)? else { return Ok(None) };
            journal.keep(key, &[loss]);
            held.losses.push(loss);
        }
    }
    Ok(Some(found))
}

/// Refuses more parts than half of the frames with data.
///
/// # Errors
/// Names the most parts that data allow.
pub fn check_folds(held_out: &HeldOutSettings, frames: usize) -> Result<()> {
    if frames < 2 * held_out.folds {
        let allowed = format!("{} at most, half of the frames with data", frames / 2);
        return Err(FitError::range("held_out.folds".to_owned(), held_out.folds, &allowed).into());
    }
    Ok(())
}

/// The loss of frames that are held out, beside the solution of the others; none if that was cancelled.
fn loss(of: &Of<'_>, [kept, out]: &[Vec<usize>; 2], watch: &mut Watch<'_>) -> Result<Option<f64>> {
    let solution = solve_frames(of, kept, watch)?;
    if solution.ending == Ending::Cancelled {
        return Ok(None);
    }
    // Beside a Gaussian prior of the voxels it is a mean over all data already.
    let prior = of.file.linear.as_ref().and_then(|linear| linear.prior_of(FieldKind::Gaussian));
    let weights: f64 = of.file.loss.iter().map(|loss| loss.weight).sum();
    let whole = if prior.is_some() { 1.0 } else { weights };
    let sum = of.with(out, |problem| problem.misfit(&solution.parameters()))?;
    Ok(Some(sum / whole))
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
