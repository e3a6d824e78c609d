//! Recovered volumes as stores of Zarr, in builds with the feature `zarr`.

use super::super::folder::Folder;
use kerrlight_render::volume::vti;
use std::path::{Path, PathBuf};

/// The store of the recovered volume and, if it is known, the true one.
pub fn of_run(folder: &Folder) -> PathBuf {
    folder.path().join("volume.zarr")
}

/// The store of the mean of draws and of what is derived from them.
pub fn of_draws(draws: &Path) -> PathBuf {
    draws.join("posterior.zarr")
}

/// Writes fields of the run in `folder`, and what is needed to make them again: version, settings, sums of what was read.
#[cfg(feature = "zarr")]
pub fn write(
    folder: &Folder,
    path: &Path,
    fields: &[vti::Field<'_>],
    axis: Option<[f64; 3]>,
) -> anyhow::Result<()> {
    use crate::output;
    use crate::zarr::{self, Field};
    use serde_json::json;
    let fields = fields.iter().map(|field| Field {
        name: field.name,
        meaning: meaning(field.name),
        unit: if field.name == "signal_to_noise" { "1" } else { "model units" },
        volume: field.volume,
    });
    let fields: Vec<Field<'_>> = fields.collect();
    let mut attributes = serde_json::Map::new();
    attributes.insert("version".to_owned(), json!(env!("CARGO_PKG_VERSION")));
    let settings = output::read_text(&folder.path().join(super::super::SETTINGS))?;
    attributes.insert("settings".to_owned(), json!(settings));
    attributes.insert("inputs".to_owned(), json!(folder.inputs().files));
    if let Some(axis) = axis {
        attributes.insert("axis".to_owned(), json!(axis));
    }
    zarr::write(path, &fields, attributes)
}

/// What the numbers of a field are.
#[cfg(feature = "zarr")]
fn meaning(name: &str) -> &'static str {
    match name {
        "truth" => "simulated emission per unit of affine parameter",
        "mean" => "mean emission of all draws",
        "deviation" => "standard deviation of the emission of all draws",
        "signal_to_noise" => "mean over standard deviation",
        _ => "emission per unit of affine parameter",
    }
}

/// Removes a store: one that a program with the feature has left would be of other results.
#[cfg(not(feature = "zarr"))]
pub fn write(
    _: &Folder,
    path: &Path,
    _: &[vti::Field<'_>],
    _: Option<[f64; 3]>,
) -> anyhow::Result<()> {
    use anyhow::Context;
    match std::fs::remove_dir_all(path) {
        Err(error) if error.kind() != std::io::ErrorKind::NotFound => {
            Err(error).with_context(|| format!("cannot remove {}", path.display()))
        }
        _ => Ok(()),
    }
}
