//! Geometries that are weighed by the light curve of a flare in an orbital band, before the emission is fitted.

use super::folder::Folder;
use anyhow::Context;
use kerrlight_tomo::recovery::Choice;
use kerrlight_tomo::recovery::results::BandResults;

/// Name of the results in the folder of the run.
pub const FILE: &str = "band.json";

/// The geometry that a run has found, which is told; none if it has not looked.
pub fn chosen(folder: &Folder) -> anyhow::Result<Option<Choice>> {
    let Some(results) = folder.found::<BandResults>(FILE)? else { return Ok(None) };
    results.sentences().iter().for_each(|line| eprintln!("{line}"));
    results.choice().with_context(|| folder.damaged(FILE)).map(Some)
}
