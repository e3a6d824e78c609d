//! The critical curve and lensing bands.

use crate::call::detached;
use crate::rays::Place;
use crate::refusal::refused;
use kerrlight_geodesic::analytic::{CriticalCurve, LensingBand};
use kerrlight_geodesic::{Inclination, Kerr, interrupt};
use numpy::{IntoPyArray, PyReadonlyArray1};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::convert::Infallible;

/// Names of the numbers of a point; `lambda` is a word of Python.
const COLUMNS: [&str; 8] = ["r", "lam", "eta", "alpha", "beta", "gamma", "delta", "tau"];

/// Names of the coordinates of both edges of a band.
const EDGES: [&str; 4] = ["inner_alpha", "inner_beta", "outer_alpha", "outer_beta"];

fn columns<'py, const N: usize>(
    py: Python<'py>,
    names: [&str; N],
    rows: Vec<[f64; N]>,
) -> PyResult<Bound<'py, PyDict>> {
    let dict = PyDict::new(py);
    for (k, name) in names.into_iter().enumerate() {
        let column: Vec<f64> = rows.iter().map(|row| row[k]).collect();
        dict.set_item(name, column.into_pyarray(py))?;
    }
    Ok(dict)
}

fn curve(spin: f64, place: Place) -> PyResult<(Kerr, Inclination)> {
    Ok((Kerr::new(spin).map_err(refused)?, place.inclination()?))
}

/// `count` points of the critical curve at equal steps of the angle on the screen.
#[pyfunction]
pub fn critical_curve(
    py: Python<'_>,
    spin: f64,
    place: Place,
    count: u32,
) -> PyResult<Bound<'_, PyDict>> {
    let (hole, inclination) = curve(spin, place)?;
    let work = || {
        let points = CriticalCurve::new(&hole, inclination).points(count);
        Ok::<_, Infallible>(points.map(|point| point.numbers()).collect())
    };
    columns(py, COLUMNS, detached(py, work)?)
}

/// The points of the critical curve in these directions of the screen.
#[pyfunction]
pub fn critical_points<'py>(
    py: Python<'py>,
    spin: f64,
    place: Place,
    angles: PyReadonlyArray1<'py, f64>,
) -> PyResult<Bound<'py, PyDict>> {
    let (hole, inclination) = curve(spin, place)?;
    let angles = angles.as_slice()?;
    let work = || {
        let curve = CriticalCurve::new(&hole, inclination);
        let point = |angle: &f64| {
            interrupt::check();
            curve.point(*angle).numbers()
        };
        Ok::<_, Infallible>(angles.iter().map(point).collect())
    };
    columns(py, COLUMNS, detached(py, work)?)
}

/// (alpha, beta) of both edges of a lensing band in these directions; NaN where there is none.
#[pyfunction]
pub fn band<'py>(
    py: Python<'py>,
    spin: f64,
    place: Place,
    order: u16,
    angles: PyReadonlyArray1<'py, f64>,
) -> PyResult<Bound<'py, PyDict>> {
    let (hole, inclination) = curve(spin, place)?;
    let angles = angles.as_slice()?;
    let none = (f64::NAN, f64::NAN);
    let work = || {
        let band = LensingBand::new(&hole, inclination, order);
        let edges = |angle: &f64| {
            interrupt::check();
            let [inner, outer] = [band.inner(*angle), band.outer(*angle).unwrap_or(none)];
            [inner.0, inner.1, outer.0, outer.1]
        };
        Ok::<_, Infallible>(angles.iter().map(edges).collect())
    };
    columns(py, EDGES, detached(py, work)?)
}
