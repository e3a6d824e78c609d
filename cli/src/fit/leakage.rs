//! Leakage between the feeds of stations, as a run keeps it.

use super::folder::Folder;
use crate::output;
use anyhow::Context;
use kerrlight_tomo::fit::setup::{FitData, SolvedLeakage};
use kerrlight_vlbi::files;
use kerrlight_vlbi::polarimetry::LeakageTable;
use serde_json::json;

/// The table of what was found last.
pub const TABLE: &str = "leakage.csv";

/// Keeps what was found before a step, or beside the linear problem.
pub fn keep(folder: &Folder, step: Option<u64>, found: &SolvedLeakage) -> anyhow::Result<()> {
    folder.file(TABLE)?.write(files::leakage_to_csv(&found.table).as_bytes())?;
    let Some(step) = step else { return Ok(()) };
    folder.log(&json!({ "step": step, "leakage": { "largest_change": found.moved } }))
}

/// Returns the leakage that a run has found last, if it has solved for it.
pub fn kept(measured: &FitData, folder: &Folder) -> anyhow::Result<Option<LeakageTable>> {
    let path = folder.path().join(TABLE);
    if measured.leakage.is_none() || !path.exists() {
        return Ok(None);
    }
    let table = files::parse_leakage(&output::read_text(&path)?);
    table.with_context(|| path.display().to_string()).map(Some)
}
