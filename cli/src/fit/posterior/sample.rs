//! One draw from the posterior: the fit of data with noise once more.

use super::super::failed;
use super::super::results::verdict::Evidence;
use super::predictive::Check;
use super::{DrawNumbers, Kept};
use crate::interrupt::SignalGuard;
use anyhow::{Context, bail};
use kerrlight_common::frames::Frames;
use kerrlight_tomo::fit::linear::LinearProgress;
use kerrlight_tomo::fit::settings::{FitFile, Kind, Start};
use kerrlight_tomo::fit::setup::{self, FitData, Instrument};
use kerrlight_tomo::fit::verdict::Tested;
use kerrlight_tomo::fit::{Motion, Objective, State, Trainer};
use kerrlight_tomo::representation::Registry;
use std::ops::ControlFlow;

/// Stream of the random numbers of a prior's field, for the seed of a draw.
const PRIOR: u64 = 0x7072_696f_7200_0000;

/// Problem and settings that a fit goes through.
pub struct Through<'a> {
    /// Settings, with the geometry that the draw has.
    pub file: &'a FitFile,
    /// Rays of that geometry.
    pub instrument: &'a Instrument,
    /// Motion of that geometry.
    pub motion: &'a Motion,
    /// Representations of others.
    pub registry: &'a Registry,
    /// The data as they were measured.
    pub measured: &'a FitData,
    /// Steps that the fit took.
    pub steps: u64,
    /// Noise of the draw over the errors of the data.
    pub noise_factor: f64,
}

/// Fits `measured` from the start, with draws of the representation's parameters of their own, and says nothing of the
/// geometry; none if it was stopped.
pub fn draw(
    through: &Through<'_>,
    measured: &FitData,
    keeper: &SignalGuard,
    told: &dyn Fn(&str),
) -> anyhow::Result<Option<Kept>> {
    let Through { file, instrument, motion, registry, .. } = *through;
    let pixels = file.screen.pixels * file.screen.pixels;
    let data = measured.terms(&file.loss, pixels)?;
    let objective = Objective { model: instrument.forward(motion)?, data };
    let times = setup::emission_times(instrument, motion);
    let representation = setup::representation(file, registry, times)?;
    let (axis, rate) = setup::axis(file)?;
    let training = setup::training(file, rate, times)?;
    let mut state = State::new(&*representation, axis, &training);
    let mut trainer = Trainer::new(objective, &*representation, training);
    if !begin(file, &mut trainer, &mut state, times, keeper, told)? {
        return Ok(None);
    }
    if !learn(&mut trainer, &mut state, through.steps, keeper, told)? {
        return Ok(None);
    }
    let frames: Vec<usize> = (0..measured.times.len()).collect();
    let movie = trainer.images(&state.now, &frames)?;
    let chi2_per_datum = trainer.objective.loss_of(&frames, &movie)?.terms;
    let volume = super::super::results::recovered(file, &mut trainer, &state)?;
    let predicted = predicted(through, &movie)?;
    let noise_factor = through.noise_factor;
    let numbers = DrawNumbers { geometry: None, chi2_per_datum, noise_factor, predicted };
    Ok(Some(Kept { volume, numbers }))
}

/// Returns the probabilities of data that are as far from a draw's images as the measured ones.
fn predicted(through: &Through<'_>, movie: &Frames<f32>) -> anyhow::Result<Vec<Check>> {
    let Through { file, instrument, motion, measured, .. } = *through;
    let pixels = file.screen.pixels * file.screen.pixels;
    // The data as they were measured: those that were fitted have noise once more.
    let data = measured.terms(&file.loss, pixels)?;
    let objective = Objective { model: instrument.forward(motion)?, data };
    let compared = (objective.names(), objective.statistics(movie)?);
    let evidence = Evidence { file: Some(file), losses: &file.loss, seed: file.seed, measured };
    let of = |(data, tested): &(String, Tested)| {
        let found = tested.predicted()?;
        Some(Check {
            data: data.clone(),
            chi2_per_datum: tested.statistics.chi2()?,
            larger_chi2: found.all,
            larger_on_a_baseline: found.groups,
            larger_in_a_frame: found.frames,
            beyond_what_passes: found.beyond,
        })
    };
    // Total intensity is the first of the images of a frame; frames of light curves have none.
    let total = match measured.curve {
        None => Some(movie.mapped(pixels, |image| image[..pixels].to_vec())?),
        Some(_) => None,
    };
    Ok(evidence
        .judged(compared, total.as_ref().unwrap_or(movie), None)?
        .terms
        .iter()
        .filter_map(of)
        .collect())
}

/// The seed of the field that a prior of voxels gives a draw.
pub fn prior_seed(file: &FitFile) -> u64 {
    file.seed ^ PRIOR
}

/// The linear problem, where the representation is solved by it or starts from it; whether to go on.
fn begin(
    file: &FitFile,
    trainer: &mut Trainer<'_, f32>,
    state: &mut State<f32>,
    times: [f64; 2],
    keeper: &SignalGuard,
    told: &dyn Fn(&str),
) -> anyhow::Result<bool> {
    let is_linear = file.representation.kind == Kind::LinearGrid;
    if !is_linear && file.training.start == Start::Drawn {
        return Ok(true);
    }
    let mut watch = |now: &LinearProgress| {
        told(&format!("linear grid, round {}, loss {:.4e}", now.round, now.value));
        if keeper.stopped() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    };
    let (objective, axis, seed) = (&mut trainer.objective, state.now.axis, Some(prior_seed(file)));
    let solution = setup::solve_linear(file, objective, axis, times, seed, &mut watch);
    let solution = solution.map_err(failed::failed).context("linear")?;
    // A solver that is told to stop returns what it has, which is no draw.
    if keeper.stopped() {
        return Ok(false);
    }
    if is_linear {
        state.now.parameters = solution.parameters();
    } else {
        setup::warm_start(file, trainer.representation, &solution, times, state)?;
    }
    Ok(true)
}

/// All steps; whether to go on.
fn learn(
    trainer: &mut Trainer<'_, f32>,
    state: &mut State<f32>,
    steps: u64,
    keeper: &SignalGuard,
    told: &dyn Fn(&str),
) -> anyhow::Result<bool> {
    while state.now.step < steps {
        if keeper.stopped() {
            return Ok(false);
        }
        match trainer.step(state) {
            Ok(_) => told(&format!("step {}, loss {:.4e}", state.now.step, state.now.loss)),
            Err(error) => bail!("a draw diverged at step {}: {error}", state.now.step),
        }
    }
    Ok(true)
}
