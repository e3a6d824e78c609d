//! Status of the cases of a folder: done, running, failed and open.

use super::cases::Case;
use super::one;
use super::runner::{self, CASES};
use crate::answer::Answer;
use crate::lock::Lock;
use anyhow::{anyhow, bail};
use rayon::prelude::*;
use serde_json::{Value, json};
use std::collections::HashSet;
use std::fmt::Write;
use std::path::Path;

/// Failed cases that are named.
const NAMED: usize = 10;

/// State of a case.
enum State {
    Done,
    Running,
    /// Its name, and why.
    Failed(String, String),
    Open,
}

/// Counts cases from what lies in the folder: it is read once, and of cases only those are looked into that have begun.
///
/// `samples` are the draws that each is to have.
pub fn show(folder: &Path, cases: &[Case], samples: Option<u32>) -> anyhow::Result<Answer> {
    if !folder.join(super::plan::FILE).is_file() {
        return Err(no_comparison(folder));
    }
    let at = folder.join(CASES);
    let there: HashSet<String> = std::fs::read_dir(&at)
        .into_iter()
        .flatten()
        .flatten()
        .map(|entry| entry.file_name().to_string_lossy().into_owned())
        .collect();
    let state = |case: &Case| {
        let slug = case.slug();
        let has = |ending: &str| there.contains(&format!("{slug}.{ending}"));
        let is_done = || runner::finished(&at.join(&slug), samples).is_some();
        if there.contains(&slug) && is_done() {
            State::Done
        } else if has("lock") && Lock::is_held(&one::lock_of(folder, case)) {
            // The lock file outlives its process, the lock does not.
            State::Running
        } else if let Some(why) = case.early_error() {
            State::Failed(case.name(), why.to_owned())
        } else if has("failed") {
            State::Failed(case.name(), one::failure(folder, case).unwrap_or_default())
        } else {
            State::Open
        }
    };
    let (mut done, mut running, mut open, mut failed) = (0, 0, 0, Vec::new());
    for state in cases.par_iter().map(state).collect::<Vec<State>>() {
        match state {
            State::Done => done += 1,
            State::Running => running += 1,
            State::Open => open += 1,
            State::Failed(name, why) => failed.push((name, why)),
        }
    }
    let mut text = format!(
        "{done} of {} cases done, {running} running, {} failed, {open} open\n",
        cases.len(),
        failed.len(),
    );
    for (name, why) in failed.iter().take(NAMED) {
        let _ = writeln!(text, "  failed: {name}: {why}");
    }
    if failed.len() > NAMED {
        let _ = writeln!(text, "  … and {} more", failed.len() - NAMED);
    }
    let told = |(name, why): &(String, String)| json!({"name": name, "error": why});
    Ok(Answer::text(text)
        .with("cases", cases.len())
        .with("done", done)
        .with("running", running)
        .with("open", open)
        .with("failed", failed.iter().map(told).collect::<Vec<Value>>()))
}

/// Refuses a folder whose cases are all of other settings than `cases`, all of the experiment: a report would be of none.
pub fn refuse_others(folder: &Path, cases: &[Case]) -> anyhow::Result<()> {
    let own: HashSet<String> = cases.iter().map(Case::slug).collect();
    let entries = std::fs::read_dir(folder.join(CASES)).into_iter().flatten().flatten();
    let folders = entries.filter(|entry| entry.path().is_dir()).map(|entry| entry.file_name());
    let names = folders.map(|name| name.to_string_lossy().into_owned());
    let names: Vec<String> = names.filter(|name| !name.contains(runner::ASIDE)).collect();
    match names.iter().find(|_| names.iter().all(|name| !own.contains(name))) {
        Some(other) => bail!(
            "{} holds {other} and none of the cases of the experiment: it or its fit file has changed since they ran",
            folder.display(),
        ),
        None => Ok(()),
    }
}

/// Returns the error of a folder in which nothing was begun.
pub fn no_comparison(folder: &Path) -> anyhow::Error {
    anyhow!("{} holds no comparison: there is no {} in it", folder.display(), super::plan::FILE)
}
