//! Fits that fail while they run: exit code 1.

use super::device_runner;
use super::folder::Folder;
use crate::interrupt::Interrupted;
use crate::plain;
use kerrlight_tomo::Error;
use kerrlight_tomo::recovery::Stopped;

/// A failure of a fit.
#[derive(Debug, thiserror::Error)]
#[error("{0}")]
pub struct Failed(String);

/// Returns the error with which a fit ended, as the program tells it: one that was stopped says how
/// it goes on.
pub fn told(error: anyhow::Error, folder: &Folder) -> anyhow::Error {
    match error.downcast::<Error>() {
        Ok(Error::Stopped(Stopped::Kept)) => Interrupted(folder.stopped()).into(),
        Ok(Error::Stopped(stopped @ Stopped::Lost(_))) => Interrupted(stopped.to_string()).into(),
        Ok(Error::Stopped(stopped @ Stopped::After(_))) => {
            let path = plain::word(folder.path());
            Interrupted(format!("{stopped}; resume with: kerrlight fit --resume {path}")).into()
        }
        Ok(Error::Device(error)) => device_runner::failed(error, folder),
        Ok(error) => failed(error),
        Err(other) => other,
    }
}

/// A problem without a solution; wrong settings stay what they are.
pub fn failed(error: Error) -> anyhow::Error {
    match error {
        // It was the program's own before it passed through the library.
        Error::Kept(error) => anyhow::Error::from_boxed(error),
        error if has_no_solution(&error) => Failed(error.to_string()).into(),
        other => other.into(),
    }
}

fn has_no_solution(error: &Error) -> bool {
    match error {
        Error::Linear(_) | Error::Diverged(_) | Error::Failed(_) => true,
        Error::In { error, .. } => has_no_solution(error),
        _ => false,
    }
}
