//! Fits that fail while they run: exit code 1.

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
    let movie = trainer.movie(&state.now, &frames, true);
    let named = trainer.objective.not_finite(&frames, &movie).map(named);
    let why = named.map_or(String::new(), |named| format!(": {named}"));
    Failed(format!("{error}{why}")).into()
}

fn named((data, frame, value): (String, usize, f64)) -> String {
    LinearError::NotFinite { data, frame, value }.to_string()
}

/// Refuses a movie whose χ² is no finite number, or that is dark where dark is no result.
pub fn check(
    file: &FitFile,
    objective: &Objective<f32>,
    frames: &[usize],
    movie: &[f32],
) -> anyhow::Result<()> {
    if let Some(found) = objective.not_finite(frames, movie) {
        return Err(Failed(named(found)).into());
    }
    if !file.is_convex() && movie.iter().all(|pixel| *pixel == 0.0) {
        let data = objective.names().join(", ");
        return Err(Failed(format!(
            "the recovered emission is zero everywhere, where {data} have no gradient: start from a nonzero field, e.g. with training.start.linear"
        ))
        .into());
    }
    Ok(())
}
