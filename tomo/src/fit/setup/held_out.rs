//! Weights of the linear problem, judged by data that its solution has not seen.

use super::change::change;
use super::linear_problem::{Of, misfit, solve_frames};
use super::{Measured, Result};
use crate::fit::journal::{self, Journal};
use crate::fit::linear::{Change, Ending, LinearProgress, Watch};
use crate::fit::settings::{FitError, FitFile, HeldOutBy, HeldOutSettings, Kind, Start};
use crate::fit::{Data, Objective};
use core::ops::ControlFlow;
use kerrlight_render::dynamics::Axis;

/// A value, and what data that were held out say of it.
#[derive(Clone, Debug, PartialEq)]
pub struct Held {
    /// The value of the setting.
    pub value: f64,
    /// Loss of each part that was held out: χ² per data point, weighted as in the fit.
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

/// A forward model with its data, and those as they were measured.
pub struct HeldData<'a> {
    /// Frames of all data.
    pub objective: &'a mut Objective<f32>,
    /// From which baselines are taken.
    pub measured: &'a Measured,
}

/// Solves the linear problem for each value without each part of the data, and looks at that part: the loss of
/// what was not fitted. `times` are those of the first and the last emission, M since the reference time. None if it
/// was cancelled. Parts that the journal knows of an earlier call are not solved again.
///
/// # Errors
/// If a setting is out of range, there are fewer frames or baselines than parts, or a problem has no solution.
pub fn hold_out(
    file: &FitFile,
    held_out: &HeldOutSettings,
    HeldData { objective, measured }: HeldData<'_>,
    (axis, times): (Axis, [f64; 2]),
    journal: &dyn Journal,
    watch: &mut HeldWatch<'_>,
) -> Result<Option<Vec<Held>>> {
    objective.model.weigh(axis);
    check_folds(held_out, objective.observed().len(), measured)?;
    let mut found: Vec<Held> =
        held_out.values.iter().map(|value| Held { value: *value, losses: Vec::new() }).collect();
    for fold in 0..held_out.folds {
        let mut parts = Parts::new((file, held_out), (objective, measured), fold)?;
        for (k, held) in found.iter_mut().enumerate() {
            let key = journal::key((held_out.by.name(), held.value.to_bits(), fold));
            if let Some(&[loss]) = journal.recall(key).as_deref() {
                held.losses.push(loss);
                continue;
            }
            let file = held_out.setting.put(file.clone(), held.value);
            let mut told = |_: &LinearProgress<'_>| match watch(k, fold) {
                true => ControlFlow::Continue(()),
                false => ControlFlow::Break(()),
            };
            let how = (axis, change(&file, times)?);
            let Some(loss) = parts.loss(&file, objective, how, &mut told)? else { return Ok(None) };
            journal.keep(key, &[loss]);
            held.losses.push(loss);
        }
    }
    Ok(Some(found))
}

/// Refuses more parts than there are data for, of which so many frames have some.
///
/// # Errors
/// Names the most parts that data allow.
pub fn check_folds(held_out: &HeldOutSettings, frames: usize, measured: &Measured) -> Result<()> {
    let (all, what) = match held_out.by {
        HeldOutBy::Frames => (frames, "frames with data"),
        HeldOutBy::Baselines => (measured.baselines().len(), "baselines"),
    };
    if all < 2 * held_out.folds {
        let allowed = format!("{} at most, half of the {what}", all / 2);
        return Err(FitError::range("held_out.folds".to_owned(), held_out.folds, &allowed).into());
    }
    Ok(())
}

/// What is fitted, and what is held out of it.
struct Parts {
    /// Frames that are fitted, and those that are held out.
    frames: [Vec<usize>; 2],
    /// Data of the two, where they are not those of the objective.
    data: Option<[Data<f32>; 2]>,
}

impl Parts {
    fn new(
        (file, held_out): (&FitFile, &HeldOutSettings),
        (objective, measured): (&mut Objective<f32>, &Measured),
        fold: usize,
    ) -> Result<Self> {
        let is_held = |k: usize| k % held_out.folds == fold;
        if held_out.by == HeldOutBy::Frames {
            let all = objective.observed();
            let part = |held: bool| -> Vec<usize> {
                let frames = all.iter().enumerate().filter(|(at, _)| is_held(*at) == held);
                frames.map(|(_, frame)| *frame).collect()
            };
            return Ok(Self { frames: [false, true].map(part), data: None });
        }
        let pixels = file.screen.pixels * file.screen.pixels;
        let terms =
            |held: bool| measured.of_baselines(|k| is_held(k) == held).terms(&file.loss, pixels);
        let mut data = [terms(false)?, terms(true)?];
        // What has no data says so by its terms.
        let frames = [0, 1].map(|k| {
            core::mem::swap(&mut objective.data, &mut data[k]);
            let frames = objective.observed();
            core::mem::swap(&mut objective.data, &mut data[k]);
            frames
        });
        Ok(Self { frames, data: Some(data) })
    }

    /// Beside what is fitted, or what is held out.
    fn beside<R>(
        &mut self,
        held: bool,
        objective: &mut Objective<f32>,
        work: impl FnOnce(&Objective<f32>, &[usize]) -> Result<R>,
    ) -> Result<R> {
        let k = usize::from(held);
        if let Some(data) = &mut self.data {
            core::mem::swap(&mut objective.data, &mut data[k]);
        }
        let done = work(objective, &self.frames[k]);
        if let Some(data) = &mut self.data {
            core::mem::swap(&mut objective.data, &mut data[k]);
        }
        done
    }

    /// The loss of what is held out, beside the solution of the rest; none if that was cancelled.
    fn loss(
        &mut self,
        file: &FitFile,
        objective: &mut Objective<f32>,
        how: (Axis, Change),
        watch: &mut Watch<'_>,
    ) -> Result<Option<f64>> {
        let nodes = nodes(file);
        let solution = self.beside(false, objective, |objective, frames| {
            solve_frames(&Of { file, objective, how, nodes, seed: None }, frames, watch)
        })?;
        if solution.ending == Ending::Cancelled {
            return Ok(None);
        }
        let emission = solution.parameters();
        let loss = self.beside(true, objective, |objective, frames| {
            misfit(&Of { file, objective, how, nodes, seed: None }, frames, &emission)
        })?;
        Ok(Some(loss))
    }
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
