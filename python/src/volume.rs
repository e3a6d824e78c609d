//! Drawings of volumes in flat space.

use crate::call::detached;
use crate::refusal::refused;
use kerrlight_render::volume::Volume;
use kerrlight_render::volume::projection::{Surroundings, View, project};
use numpy::{IntoPyArray, PyReadonlyArray1};
use pyo3::prelude::*;
use std::convert::Infallible;

/// A box: nodes along x, y and z, and the coordinates (M) of the first and the last of them.
type Corners = ([usize; 3], [f64; 3], [f64; 3]);

/// ∫ e ds along parallel rays from `angles`, azimuth and elevation in degrees, row by row from the top. `lengths` are the
/// width of the picture and the radius of a ball that hides what is behind it, M.
#[pyfunction]
pub fn view<'py>(
    py: Python<'py>,
    corners: Corners,
    emission: PyReadonlyArray1<'py, f32>,
    angles: (f64, f64),
    lengths: (f64, f64),
    pixels: usize,
) -> PyResult<Bound<'py, PyAny>> {
    let (nodes, low, high) = corners;
    let (width, hole_radius) = lengths;
    let volume = Volume::new(nodes, low, high, emission.as_slice()?.to_vec()).map_err(refused)?;
    let around =
        Surroundings { hole_radius, axis: [0.0; 3], ring_radius: 0.0, half_width: 0.5 * width };
    let from = View { azimuth: angles.0, elevation: angles.1 };
    let image = detached(py, || Ok::<_, Infallible>(project(&volume, from, &around, pixels)))?;
    Ok(image.into_pyarray(py).into_any())
}
