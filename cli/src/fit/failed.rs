//! Fits that fail while they run: exit code 1.

use kerrlight_common::frames::Frames;
use kerrlight_tomo::Error;
use kerrlight_tomo::fit::linear::LinearError;
use kerrlight_tomo::fit::settings::FitFile;
use kerrlight_tomo::fit::{Objective, State, Trainer};

/// What went wrong.
#[derive(Debug, thiserror::Error)]
#[error("{0}")]
pub struct Failed(String);

/// A linear problem without a solution; wrong settings stay what they are.
pub fn linear(error: Error) -> anyhow::Error {
    match error {
        Error::Linear(error) => Failed(error.to_string()).into(),
        other => other.into(),
    }
}

/// A fit that cannot go on, with the data that are the reason where one can tell.
pub fn diverged(
    trainer: &mut Trainer<'_, f32>,
    state: &State<f32>,
    error: &Error,
) -> anyhow::Error {
    let frames = trainer.objective.observed();
    if let Some(fault) = trainer.objective.fault() {
        return Failed(fault.to_owned()).into();
    }
    let movie = trainer.images(&state.now, &frames, true).ok();
    let found = movie.and_then(|movie| trainer.objective.not_finite(&frames, &movie).ok());
    let named = found.flatten().map(named);
    let why = named.map_or(String::new(), |named| format!(": {named}"));
    Failed(format!("{error}{why}")).into()
}

fn named((data, frame, value): (String, usize, f64)) -> String {
    LinearError::NotFinite { data, frame, value }.to_string()
}

fn is_dark(movie: &Frames<f32>) -> anyhow::Result<bool> {
    for image in movie.images() {
        if image?.iter().any(|pixel| *pixel != 0.0) {
            return Ok(false);
        }
    }
    Ok(true)
}

/// Refuses a movie whose χ² is no finite number, or that is dark where dark is no result.
pub fn check(
    file: &FitFile,
    objective: &Objective<f32>,
    frames: &[usize],
    movie: &Frames<f32>,
) -> anyhow::Result<()> {
    if let Some(fault) = objective.fault() {
        return Err(Failed(fault.to_owned()).into());
    }
    if let Some(found) = objective.not_finite(frames, movie)? {
        return Err(Failed(named(found)).into());
    }
    if !file.is_convex() && is_dark(movie)? {
        let data = objective.names().join(", ");
        return Err(Failed(format!(
            "the recovered emission is zero everywhere, where {data} have no gradient: start from a nonzero field, e.g. with training.start.linear"
        ))
        .into());
    }
    Ok(())
}
