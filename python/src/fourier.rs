//! Transforms from images to visibilities, and back.

use crate::call::detached;
use crate::refusal::refused;
use kerrlight_common::units::MICROARCSECOND;
use kerrlight_vlbi::Complex64;
use kerrlight_vlbi::operator::{ImageGrid, Method, Operator, Pulse, Transform};
use numpy::{IntoPyArray, PyArray1, PyReadonlyArray1};
use pyo3::prelude::*;
use std::convert::Infallible;

/// A transform to fixed (u, v), in double precision.
#[pyclass(frozen, module = "kerrlight._core")]
pub struct Fourier {
    transform: Transform<f64>,
}

/// The shape of a pixel with that name.
pub fn pulse(name: &str) -> PyResult<Pulse> {
    match name {
        "delta" => Ok(Pulse::Delta),
        "rectangle" => Ok(Pulse::Rectangle),
        "triangle" => Ok(Pulse::Triangle),
        other => {
            let allowed = "delta, rectangle or triangle";
            Err(refused(format!("pulse = \"{other}\" is not allowed: {allowed}")))
        }
    }
}

/// Exponentials up to this many bytes are kept.
const MEMORY: usize = 256 << 20;

#[pymethods]
impl Fourier {
    /// Makes a transform for images of width × height pixels over a field (µas), `counts[k]` of the flat (u,
    /// v) seeing image k.
    #[new]
    fn new(
        py: Python<'_>,
        screen: (usize, usize, f64),
        pulse: &str,
        uv: PyReadonlyArray1<'_, f64>,
        counts: Vec<usize>,
        accuracy: Option<f64>,
    ) -> PyResult<Self> {
        let (width, height, field_uas) = screen;
        let grid = ImageGrid::new(width, height, field_uas * MICROARCSECOND).map_err(refused)?;
        let pulse = self::pulse(pulse)?;
        let mut pairs = uv.as_slice()?.chunks_exact(2).map(|pair| [pair[0], pair[1]]);
        let frames: Vec<Vec<[f64; 2]>> =
            counts.iter().map(|count| pairs.by_ref().take(*count).collect()).collect();
        let method = accuracy.map_or(Method::Direct, Method::Cheaper);
        let work = || Transform::new(grid, pulse, &frames, method, MEMORY);
        Ok(Fourier { transform: detached(py, work)? })
    }

    /// Names the transform.
    fn describe(&self) -> String {
        self.transform.describe()
    }

    /// Visibilities of a movie.
    fn apply<'py>(
        &self,
        py: Python<'py>,
        movie: PyReadonlyArray1<'py, f64>,
    ) -> PyResult<Bound<'py, PyArray1<Complex64>>> {
        let movie = movie.as_slice()?;
        let work = || {
            let mut data = vec![Complex64::default(); self.transform.data()];
            self.transform.forward(movie, &mut data);
            Ok::<_, Infallible>(data)
        };
        Ok(detached(py, work)?.into_pyarray(py))
    }

    /// The adjoint, under the inner product Re Σ x̄ y of visibilities.
    fn vjp<'py>(
        &self,
        py: Python<'py>,
        data: PyReadonlyArray1<'py, Complex64>,
    ) -> PyResult<Bound<'py, PyArray1<f64>>> {
        let data = data.as_slice()?;
        let work = || {
            let mut movie = vec![0.0; self.transform.frames() * self.transform.pixels()];
            self.transform.adjoint(data, &mut movie);
            Ok::<_, Infallible>(movie)
        };
        Ok(detached(py, work)?.into_pyarray(py))
    }
}
