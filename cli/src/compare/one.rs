//! One case by itself: engines of clusters run each as a command of its own.

use super::cases::{Case, Status};
use super::runner::Runner;
use super::{Failed, runner};
use crate::answer::Answer;
use crate::interrupt::{Interrupted, SignalGuard};
use crate::lock::Lock;
use crate::output::{self, Output};
use crate::plain;
use std::path::{Path, PathBuf};

/// Another process runs the same case.
#[derive(Debug, thiserror::Error)]
#[error("{0} is being run by another kerrlight")]
pub struct Busy(String);

/// Runs a case to its end, from where it is; one that is done is not run again.
pub fn run(case: &Case, runner: &Runner<'_>, folder: &Path) -> anyhow::Result<Answer> {
    let Some(lock) = Lock::of_file(&lock_of(folder, case))? else {
        return Err(Busy(case.slug()).into());
    };
    let keeper = SignalGuard::saving("stopping after the fit's step; a second signal ends at once");
    let status = runner.run(case, &keeper);
    // Why a case failed counts more than that it cannot be kept.
    let kept = keep_failure(folder, case, &status);
    match status {
        Status::Done(results) => {
            drop(lock);
            let _ = std::fs::remove_file(lock_of(folder, case));
            let run = runner.run_of(case).display().to_string();
            Ok(Answer::lines(&format!("{} is done", case.name()), &run)
                .with("case", case.slug())
                .with("folder", run)
                .with("results", results))
        }
        Status::Failed(why) => {
            if let Err(error) = kept {
                eprintln!("warning: {}", plain::reasons(&error));
            }
            Err(Failed { failed: 1, all: 1, names: format!("{}: {why}", case.name()) }.into())
        }
        Status::Open => {
            let how = "the same command resumes it";
            Err(Interrupted(format!("stopped: {} is not done; {how}", case.name())).into())
        }
    }
}

/// Keeps why a case failed for those who look at the folder later; that of a case which did not fail goes.
pub fn keep_failure<T>(folder: &Path, case: &Case, status: &Status<T>) -> anyhow::Result<()> {
    let failure = failure_of(folder, case);
    match status {
        Status::Failed(why) => Output::new(&failure, "")?.write(why.as_bytes()),
        _ => {
            // What is left behind does no harm: results count.
            let _ = std::fs::remove_file(failure);
            Ok(())
        }
    }
}

/// Returns the reason why a case failed when it was run last.
pub fn failure(folder: &Path, case: &Case) -> Option<String> {
    output::read_text(&failure_of(folder, case)).ok()
}

/// The file that is locked while a case is run; beside its folder, which a fit may make anew.
pub fn lock_of(folder: &Path, case: &Case) -> PathBuf {
    folder.join(runner::CASES).join(format!("{}.lock", case.slug()))
}

fn failure_of(folder: &Path, case: &Case) -> PathBuf {
    folder.join(runner::CASES).join(format!("{}.failed", case.slug()))
}
