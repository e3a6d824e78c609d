//! What is known of a fit's settings before it runs.

use crate::call::{detached, refused};
use crate::representation;
use kerrlight_tomo::fit::settings::{FitFile, StaticImageFile};
use kerrlight_tomo::fit::setup;
use kerrlight_tomo::representation::Registry;
use pyo3::prelude::*;

/// Adds the functions of this module.
pub fn add(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_function(wrap_pyfunction!(check_fit, module)?)
}

/// Steps of training of a fit's settings, or iterations of a static image's, which it refuses if they make no sense, as far as can be told without
/// tracing rays.
#[pyfunction]
fn check_fit(py: Python<'_>, text: &str) -> PyResult<u64> {
    if StaticImageFile::is_meant(text) {
        return Ok(StaticImageFile::parse(text).map_err(refused)?.image.iterations as u64);
    }
    let file = FitFile::parse(text).map_err(refused)?;
    let mut registry = Registry::new();
    registry.find_others(representation::find);
    detached(py, || setup::check(&file, &registry))?;
    Ok(file.training.steps)
}
