//! Properties of fits beside their settings.

use crate::refusal::refused;
use kerrlight_tomo::fit::settings::Hole;
use pyo3::prelude::*;
use std::path::PathBuf;

/// Mass (solar masses) and distance (kpc) of Sgr A* or M87*.
#[pyfunction]
pub fn known_hole(name: &str) -> PyResult<(Option<f64>, Option<f64>)> {
    let Hole { mass_msun, distance_kpc, .. } = match name {
        "Sgr A*" => Hole::sgr_a_star(0.0),
        "M87*" => Hole::m87_star(0.0),
        _ => return Err(refused(format!("{name:?} is not allowed: \"Sgr A*\" or \"M87*\""))),
    };
    Ok((mass_msun, distance_kpc))
}

/// The dotted key of the file of data that settings name.
#[pyfunction]
pub fn data_key(text: &str) -> PyResult<String> {
    let table: toml::Table = text.parse().map_err(refused)?;
    let kinds = table.get("data").and_then(toml::Value::as_table);
    let kind = kinds.and_then(|kinds| kinds.keys().next());
    let kind =
        kind.ok_or_else(|| refused("the settings name no data: there is no table [data]"))?;
    Ok(format!("data.{kind}.path"))
}

/// Returns whether two texts are settings of the same fit, whatever their order and their comments. Relative paths start
/// from the folder that the first line of a text names, where it does, or else from `folder`.
#[pyfunction]
pub fn is_same_fit(one: &str, other: &str, folder: PathBuf) -> PyResult<bool> {
    kerrlight_cli::is_same_fit(one, other, &folder).map_err(refused)
}
