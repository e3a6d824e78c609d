//! Pictures and films of scenes.

use crate::call::detached;
use crate::refusal::refused;
use kerrlight_cli::pictures::{Shot, Shown};
use kerrlight_geodesic::interrupt;
use kerrlight_render::picture::Summary;
use numpy::{IntoPyArray, PyArrayMethods};
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyDict};
use std::path::PathBuf;

/// A rendered picture.
#[pyclass(frozen, module = "kerrlight._core")]
pub struct Picture {
    shown: Shown,
}

/// Settings as TOML, from the same settings as JSON.
#[pyfunction]
pub fn toml_of_json(json: &str) -> PyResult<String> {
    let mut table: toml::Table = serde_json::from_str(json).map_err(refused)?;
    table.iter_mut().for_each(|(_, value)| with_infinities(value));
    toml::to_string(&table).map_err(refused)
}

/// A value as TOML writes it in a line, from the same value as JSON.
#[pyfunction]
pub fn toml_value_of_json(json: &str) -> PyResult<String> {
    let mut value: toml::Value = serde_json::from_str(json).map_err(refused)?;
    with_infinities(&mut value);
    Ok(value.to_string())
}

/// Infinities, which JSON has not, in place of the words that stand for them.
fn with_infinities(value: &mut toml::Value) {
    match value {
        toml::Value::String(word) if word == "\0inf" => *value = f64::INFINITY.into(),
        toml::Value::String(word) if word == "-\0inf" => *value = f64::NEG_INFINITY.into(),
        toml::Value::Array(all) => all.iter_mut().for_each(with_infinities),
        toml::Value::Table(table) => table.iter_mut().for_each(|(_, value)| with_infinities(value)),
        _ => {}
    }
}

/// The settings of a table as JSON, in which words stand for infinities and what is no number.
pub fn json_of_toml(table: &toml::Table) -> PyResult<String> {
    let mut table = table.clone();
    table.iter_mut().for_each(|(_, value)| without_infinities(value));
    serde_json::to_string(&table).map_err(refused)
}

fn without_infinities(value: &mut toml::Value) {
    match value {
        toml::Value::Float(number) if !number.is_finite() => {
            let sign = if *number < 0.0 { "-" } else { "" };
            *value = format!("{sign}\0{}", number.abs()).into();
        }
        toml::Value::Array(all) => all.iter_mut().for_each(without_infinities),
        toml::Value::Table(table) => {
            table.iter_mut().for_each(|(_, value)| without_infinities(value));
        }
        _ => {}
    }
}

/// The scene that a picture's file holds.
#[pyfunction]
pub fn scene_of_exr(path: PathBuf) -> PyResult<String> {
    kerrlight_cli::pictures::scene_of_exr(&path).map_err(refused)
}

/// The picture of a scene: its text (TOML; none: the built-in one), the folder of its files, and overrides.
#[pyfunction]
pub fn render(
    py: Python<'_>,
    text: Option<String>,
    folder: PathBuf,
    overrides: Vec<String>,
) -> PyResult<Picture> {
    let work = || {
        let shot = Shot::new(text.as_deref(), &folder, &overrides)?;
        shot.render(&|_| !interrupt::is_wanted())
    };
    Ok(Picture { shown: detached(py, work)? })
}

/// Its pictures at times in M.
#[pyfunction]
pub fn film(
    py: Python<'_>,
    text: Option<String>,
    folder: PathBuf,
    overrides: Vec<String>,
    times: Vec<f64>,
) -> PyResult<Vec<Picture>> {
    let work = || {
        let shot = Shot::new(text.as_deref(), &folder, &overrides)?;
        shot.film(&times, &|_| !interrupt::is_wanted())
    };
    Ok(detached(py, work)?.into_iter().map(|shown| Picture { shown }).collect())
}

#[pymethods]
impl Picture {
    /// Names of the channels.
    fn names(&self) -> Vec<&str> {
        let channels = &self.shown.rendered.picture.channels;
        channels.iter().map(|channel| channel.name.as_str()).collect()
    }

    /// Rows and columns.
    fn shape(&self) -> (usize, usize) {
        let picture = &self.shown.rendered.picture;
        (picture.height, picture.width)
    }

    /// A channel, if there is one of that name.
    fn channel<'py>(&self, py: Python<'py>, name: &str) -> PyResult<Option<Bound<'py, PyAny>>> {
        let Some(values) = self.shown.rendered.picture.channel(name) else { return Ok(None) };
        let (rows, columns) = self.shape();
        let array = values.to_vec().into_pyarray(py).reshape([rows, columns])?;
        Ok(Some(array.into_any()))
    }

    /// Its summary.
    fn summary<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let dict = PyDict::new(py);
        let Summary { rays, unresolved, flux, flux_error, image_error, .. } =
            self.shown.rendered.summary;
        dict.set_item("flux", flux)?;
        dict.set_item("flux_error", flux_error)?;
        dict.set_item("flux_unit", self.shown.rendered.summary.flux_unit)?;
        dict.set_item("intensity_unit", self.shown.rendered.summary.intensity_unit)?;
        dict.set_item("image_error", image_error)?;
        dict.set_item("rays", rays)?;
        dict.set_item("unresolved_rays", unresolved)?;
        Ok(dict)
    }

    /// Returns the attributes in the header of its EXR file.
    fn attributes<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let dict = PyDict::new(py);
        for (name, value) in &self.shown.attributes {
            dict.set_item(name, value)?;
        }
        Ok(dict)
    }

    /// The bytes of an EXR file.
    fn exr<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyBytes>> {
        Ok(PyBytes::new(py, &detached(py, || self.shown.exr())?))
    }

    /// The bytes of a PNG.
    fn png<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyBytes>> {
        Ok(PyBytes::new(py, &detached(py, || self.shown.png())?))
    }
}
