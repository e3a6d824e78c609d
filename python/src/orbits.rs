//! Special radii of a hole, and the redshift of matter on circular orbits.

use crate::call::detached;
use crate::refusal::refused;
use kerrlight_geodesic::plunge::Plunge;
use kerrlight_geodesic::{Kerr, flow, interrupt, orbits};
use numpy::{IntoPyArray, PyArray1, PyReadonlyArray1};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::convert::Infallible;

/// Special radii in M, by name. Refuses spins out of range.
#[pyfunction]
pub fn radii(py: Python<'_>, spin: f64) -> PyResult<Bound<'_, PyDict>> {
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

/// Four-velocities in the equatorial plane, four numbers a radius: of circular orbits about +z, and of what plunges from
/// the innermost stable one with its energy and angular momentum. NaN at and inside the horizon.
#[pyfunction]
pub fn velocity<'py>(
    py: Python<'py>,
    spin: f64,
    r: PyReadonlyArray1<'py, f64>,
) -> PyResult<Bound<'py, PyArray1<f64>>> {
    let hole = Kerr::new(spin).map_err(refused)?;
    let (plunge, r) = (Plunge::new(&hole), r.as_slice()?);
    let of = |r: &f64| {
        interrupt::check();
        let inside = plunge.velocity(*r);
        inside.or_else(|| flow::keplerian_velocity(&hole, *r)).unwrap_or([f64::NAN; 4])
    };
    let work = || Ok::<_, Infallible>(r.iter().flat_map(of).collect::<Vec<f64>>());
    Ok(detached(py, work)?.into_pyarray(py))
}

/// Redshift factors g of circular orbits in the equatorial plane; NaN where there is no orbit.
#[pyfunction]
pub fn keplerian_redshift<'py>(
    py: Python<'py>,
    spin: f64,
    r: PyReadonlyArray1<'py, f64>,
    lam: PyReadonlyArray1<'py, f64>,
) -> PyResult<Bound<'py, PyArray1<f64>>> {
    let hole = Kerr::new(spin).map_err(refused)?;
    let (r, lam) = (r.as_slice()?, lam.as_slice()?);
    let factor = |(r, lam): (&f64, &f64)| {
        interrupt::check();
        flow::keplerian_redshift(&hole, *r, *lam).unwrap_or(f64::NAN)
    };
    let work = || Ok::<_, Infallible>(r.iter().zip(lam).map(factor).collect::<Vec<f64>>());
    Ok(detached(py, work)?.into_pyarray(py))
}
