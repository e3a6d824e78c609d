//! Tables of rays, and their derivatives.

use crate::call::{at_once, detached};
use crate::refusal::refused;
use kerrlight_geodesic::derivatives::{self, Differentiated, Gradient, Gradients};
use kerrlight_geodesic::{
    Inclination, Integrator, Kerr, Observer, Placement, Points, RayTable, Request, Uncertainty,
};
use numpy::{IntoPyArray, PyArrayMethods, PyReadonlyArray1};
use pyo3::prelude::*;
use pyo3::types::PyDict;

/// Place of an observer: inclination, whether that is in degrees, radius (M) and azimuth (radians).
#[derive(Clone, Copy, FromPyObject)]
pub struct Place(f64, bool, f64, f64);

impl Place {
    /// The inclination.
    pub fn inclination(self) -> PyResult<Inclination> {
        let Place(angle, in_degrees, ..) = self;
        let from = if in_degrees { Inclination::from_degrees } else { Inclination::from_radians };
        from(angle).map_err(refused)
    }

    /// The observer, whose radius may be infinite.
    pub fn observer(self) -> PyResult<Observer> {
        let Place(_, _, radius, azimuth) = self;
        let inclination = self.inclination()?;
        let observer = if radius == f64::INFINITY {
            Observer::at_infinity(inclination)
        } else {
            Observer::at_radius(inclination, radius).map_err(refused)?
        };
        Ok(observer.with_azimuth(azimuth))
    }
}

/// Quantities wanted of rays.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub struct Wanted {
    crossings: usize,
    /// Name of a placement with its numbers.
    samples: (String, usize, f64, f64),
    azimuth: bool,
    time: bool,
    momentum: bool,
    weight: bool,
    errors: bool,
}

impl Wanted {
    fn request(self) -> Request {
        let (kind, points, from, to) = self.samples;
        let samples = match kind.as_str() {
            "mino-time" => Placement::MinoTime(points),
            "path-length" => Placement::PathLength { points, radius: to },
            "gauss-legendre" => Placement::GaussLegendre { points, from, to },
            _ => Placement::None,
        };
        Request {
            crossings: self.crossings,
            samples,
            azimuth: self.azimuth,
            time: self.time,
            momentum: self.momentum,
            weight: self.weight,
            uncertainty: self.errors,
        }
    }
}

fn named(name: &str) -> PyResult<Integrator> {
    let names = || Integrator::ALL.iter().map(|one| one.name()).collect::<Vec<_>>().join(", ");
    Integrator::named(name).ok_or_else(|| {
        refused(format!("integrator = \"{name}\" is not allowed: one of {}", names()))
    })
}

/// Rays at (alpha, beta) of a hole's observer, in columns.
#[pyfunction]
pub fn trace<'py>(
    py: Python<'py>,
    spin: f64,
    place: Place,
    screen: (PyReadonlyArray1<'py, f64>, PyReadonlyArray1<'py, f64>),
    how: (String, f64),
    wanted: Wanted,
) -> PyResult<Bound<'py, PyDict>> {
    let (hole, observer) = (Kerr::new(spin).map_err(refused)?, place.observer()?);
    let points = wanted.samples.1.saturating_add(wanted.crossings);
    let (integrator, tolerance, request) = (named(&how.0)?, how.1, wanted.request());
    let (alpha, beta) = (screen.0.as_slice()?, screen.1.as_slice()?);
    let work = || integrator.trace(&hole, &observer, alpha, beta, tolerance, &request);
    let is_brief = alpha.len().saturating_mul(points.saturating_add(1)) <= FEW;
    let rays = if is_brief { at_once(py, work)? } else { detached(py, work)? };
    table(py, rays)
}

/// Rays and points that take less time than to wake another thread.
const FEW: usize = 32;

/// Rays as those of `trace` with `taylor-mino`, and their derivatives.
#[pyfunction]
pub fn differentiate<'py>(
    py: Python<'py>,
    spin: f64,
    place: Place,
    screen: (PyReadonlyArray1<'py, f64>, PyReadonlyArray1<'py, f64>),
    tolerance: f64,
    wanted: Wanted,
) -> PyResult<Bound<'py, PyDict>> {
    let (hole, observer) = (Kerr::new(spin).map_err(refused)?, place.observer()?);
    let request = wanted.request();
    let (alpha, beta) = (screen.0.as_slice()?, screen.1.as_slice()?);
    let work = || derivatives::trace(&hole, &observer, alpha, beta, tolerance, &request);
    let Differentiated { values, mino_total, turning_radius, crossings, samples } =
        detached(py, work)?;
    let dict = table(py, values)?;
    let by = PyDict::new(py);
    by.set_item("mino_total", four(py, mino_total)?)?;
    by.set_item("turning_radius", four(py, turning_radius)?)?;
    by.set_item("crossings", gradients(py, crossings)?)?;
    by.set_item("samples", gradients(py, samples)?)?;
    dict.set_item("derivatives", by)?;
    Ok(dict)
}

fn table(py: Python<'_>, rays: RayTable) -> PyResult<Bound<'_, PyDict>> {
    let dict = PyDict::new(py);
    let codes: Vec<i8> = rays.outcome.iter().map(|outcome| outcome.code()).collect();
    dict.set_item("outcome", codes.into_pyarray(py))?;
    dict.set_item("mino_total", rays.mino_total.into_pyarray(py))?;
    dict.set_item("turning_radius", rays.turning_radius.into_pyarray(py))?;
    dict.set_item("crossing_count", rays.crossing_count.into_pyarray(py))?;
    dict.set_item("crossings", points(py, rays.crossings)?)?;
    dict.set_item("samples", points(py, rays.samples)?)?;
    if !rays.uncertainty.is_empty() {
        dict.set_item("errors", errors(py, &rays.uncertainty)?)?;
    }
    Ok(dict)
}

fn points(py: Python<'_>, points: Points) -> PyResult<Bound<'_, PyDict>> {
    let dict = PyDict::new(py);
    let count = points.len();
    // Columns of no points are whole, whatever was requested.
    let is_whole = |length: usize| length == count;
    let ends: Vec<i64> = points.ends().iter().map(|end| *end as i64).collect();
    dict.set_item("ends", ends.into_pyarray(py))?;
    dict.set_item("mino", points.mino_time.into_pyarray(py))?;
    dict.set_item("r", points.radius.into_pyarray(py))?;
    dict.set_item("theta", points.theta.into_pyarray(py))?;
    for (name, column) in
        [("phi", points.azimuth), ("delay", points.delay), ("weight", points.weight)]
    {
        if is_whole(column.len()) {
            dict.set_item(name, column.into_pyarray(py))?;
        }
    }
    if is_whole(points.momentum.len()) {
        let rows = [points.momentum.len(), 4];
        let flat = points.momentum.into_flattened().into_pyarray(py);
        dict.set_item("momentum", flat.reshape(rows)?)?;
    }
    Ok(dict)
}

fn errors<'py>(py: Python<'py>, worst: &[Uncertainty]) -> PyResult<Bound<'py, PyDict>> {
    let dict = PyDict::new(py);
    let column =
        |of: fn(&Uncertainty) -> f64| worst.iter().map(of).collect::<Vec<f64>>().into_pyarray(py);
    dict.set_item("r", column(|error| error.radius))?;
    dict.set_item("theta", column(|error| error.theta))?;
    dict.set_item("phi", column(|error| error.azimuth))?;
    dict.set_item("delay", column(|error| error.delay))?;
    Ok(dict)
}

/// Derivatives as rows of four: by spin, inclination, alpha and beta.
fn four(py: Python<'_>, column: Vec<Gradient>) -> PyResult<Bound<'_, PyAny>> {
    let rows = [column.len(), 4];
    let flat: Vec<f64> = column.into_iter().flat_map(Gradient::to_array).collect();
    Ok(flat.into_pyarray(py).reshape(rows)?.into_any())
}

fn gradients(py: Python<'_>, of: Gradients) -> PyResult<Bound<'_, PyDict>> {
    let dict = PyDict::new(py);
    let count = of.rate.len();
    let columns = [
        ("mino", of.mino_time),
        ("r", of.radius),
        ("theta", of.theta),
        ("phi", of.azimuth),
        ("delay", of.delay),
        ("weight", of.weight),
    ];
    for (name, column) in columns {
        if column.len() == count {
            dict.set_item(name, four(py, column)?)?;
        }
    }
    if of.momentum.len() == count {
        let rows = [of.momentum.len(), 4, 4];
        let each = of.momentum.into_flattened().into_iter().flat_map(Gradient::to_array);
        let flat = each.collect::<Vec<f64>>().into_pyarray(py);
        dict.set_item("momentum", flat.reshape(rows)?)?;
    }
    Ok(dict)
}
