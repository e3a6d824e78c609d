//! Special radii of a hole, and the redshift of matter on circular orbits.

use crate::call::refused;
use kerrlight_geodesic::{Kerr, flow, orbits};
use numpy::{IntoPyArray, PyArray1, PyReadonlyArray1};
use pyo3::prelude::*;
use pyo3::types::PyDict;

/// Adds the functions of this module.
pub fn add(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_function(wrap_pyfunction!(radii, module)?)?;
    module.add_function(wrap_pyfunction!(keplerian_redshift, module)?)
}

/// Special radii in M, by name. Refuses spins out of range.
#[pyfunction]
fn radii(py: Python<'_>, spin: f64) -> PyResult<Bound<'_, PyDict>> {
    let hole = Kerr::new(spin).map_err(refused)?;
    let dict = PyDict::new(py);
    dict.set_item("horizon", hole.horizon())?;
    dict.set_item("inner_horizon", hole.inner_horizon())?;
    dict.set_item("isco", orbits::isco(&hole))?;
    dict.set_item("photon_orbit", orbits::photon_orbit(&hole))?;
    let counter_rotating = orbits::counter_rotating_photon_orbit(&hole);
    dict.set_item("counter_rotating_photon_orbit", counter_rotating)?;
    dict.set_item("polar_photon_orbit", orbits::polar_photon_orbit(&hole))?;
    Ok(dict)
}

/// Redshift factors g of circular orbits in the equatorial plane; NaN where there is no orbit.
#[pyfunction]
fn keplerian_redshift<'py>(
    py: Python<'py>,
    spin: f64,
    r: PyReadonlyArray1<'py, f64>,
    lam: PyReadonlyArray1<'py, f64>,
) -> PyResult<Bound<'py, PyArray1<f64>>> {
    let hole = Kerr::new(spin).map_err(refused)?;
    let pairs = r.as_slice()?.iter().zip(lam.as_slice()?);
    let factor = |(r, lam): (&f64, &f64)| flow::keplerian_redshift(&hole, *r, *lam);
    let factors = pairs.map(|pair| factor(pair).unwrap_or(f64::NAN));
    Ok(factors.collect::<Vec<f64>>().into_pyarray(py))
}
