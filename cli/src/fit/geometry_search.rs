//! A geometry that is not known: it is found before the emission is fitted in it.

use super::folder::Folder;
use anyhow::Context;
use kerrlight_tomo::fit::settings::FitFile;
use kerrlight_tomo::recovery::Choice;
use kerrlight_tomo::recovery::results::GeometryResults;

/// Name of the results in the folder of the run.
pub const FILE: &str = "geometry.json";

/// The geometry that a run has found, which is told; none if it has not looked.
pub fn chosen(folder: &Folder, file: &FitFile) -> anyhow::Result<Option<Choice>> {
    let Some(results) = folder.found::<GeometryResults>(FILE)? else { return Ok(None) };
    let Some(unknown) = file.unknown_geometry()? else { return Ok(None) };
    results.lines().iter().for_each(|line| eprintln!("{line}"));
    let geometry = results.geometry_in(file, &unknown.free);
    let geometry = geometry.with_context(|| folder.damaged(FILE))?;
    Ok(Some(Choice::Geometry { geometry, resolution: results.resolution.into() }))
}

/// Coarse searches, geometries of each, and geometries of the fine one, at most.
pub fn planned(file: &FitFile) -> [usize; 3] {
    let search = file.unknown_geometry().ok().flatten().map(|unknown| unknown.search);
    search.map_or([0; 3], |of| [of.starts, of.coarse.trials, of.fine.trials])
}
