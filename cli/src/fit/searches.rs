//! What is found before the emission is fitted, where it is not known: the geometry, or that of a flare in an orbital band
//! by its light curve.

use super::folder::Folder;
use anyhow::Context;
use kerrlight_tomo::fit::settings::FitFile;
use kerrlight_tomo::recovery::Choice;
use kerrlight_tomo::recovery::results::{BandResults, GeometryResults};

/// Names of the results in the folder of the run.
pub const GEOMETRY: &str = "geometry.json";
pub const BAND: &str = "band.json";

/// The geometry that a run has found, which is told; none if it has not looked.
pub fn geometry(folder: &Folder, file: &FitFile) -> anyhow::Result<Option<Choice>> {
    let Some(results) = folder.found::<GeometryResults>(GEOMETRY)? else { return Ok(None) };
    let Some(unknown) = file.unknown_geometry()? else { return Ok(None) };
    results.lines().iter().for_each(|line| eprintln!("{line}"));
    let geometry = results.geometry_in(file, &unknown.free);
    let geometry = geometry.with_context(|| folder.damaged(GEOMETRY))?;
    Ok(Some(Choice::Geometry { geometry, resolution: results.resolution.into() }))
}

/// The same of a flare.
pub fn band(folder: &Folder) -> anyhow::Result<Option<Choice>> {
    let Some(results) = folder.found::<BandResults>(BAND)? else { return Ok(None) };
    results.sentences().iter().for_each(|line| eprintln!("{line}"));
    results.choice().with_context(|| folder.damaged(BAND)).map(Some)
}

/// Coarse searches, geometries of each, and geometries of the fine one, at most.
pub fn planned(file: &FitFile) -> [usize; 3] {
    let search = file.unknown_geometry().ok().flatten().map(|unknown| unknown.search);
    search.map_or([0; 3], |of| [of.starts, of.coarse.trials, of.fine.trials])
}
