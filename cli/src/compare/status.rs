//! How the cases of a folder stand: done, running, failed and open.

use super::cases::Case;
use super::one;
use super::runner::CASES;
use crate::answer::Answer;
use crate::lock::Lock;
use anyhow::anyhow;
use serde_json::{Value, json};
use std::collections::HashSet;
use std::fmt::Write;
use std::path::Path;

/// Failed cases that are named.
const NAMED: usize = 10;

/// Counts cases from what lies in the folder: it is read once, and of cases only those are looked into that have begun.
pub fn show(folder: &Path, cases: &[Case]) -> anyhow::Result<Answer> {
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
    let (mut done, mut running, mut failed) = (0, 0, Vec::new());
    for case in cases {
        let has = |ending: &str| there.contains(&format!("{}.{ending}", case.slug));
        if there.contains(&case.slug) && at.join(&case.slug).join("report.html").is_file() {
            done += 1;
        } else if has("lock") && Lock::is_held(&one::lock_of(folder, case)) {
            running += 1;
        } else if let Some(why) = &case.error {
            failed.push((case.name(), why.clone()));
        } else if has("failed") {
            failed.push((case.name(), one::failure(folder, case).unwrap_or_default()));
        }
    }
    let open = cases.len() - done - running - failed.len();
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

/// Of a folder in which nothing was begun.
pub fn no_comparison(folder: &Path) -> anyhow::Error {
    anyhow!("{} holds no comparison: there is no {} in it", folder.display(), super::plan::FILE)
}
