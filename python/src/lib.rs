//! `kerrlight._core`, the compiled half of the Python package: the public functions of the crates on numpy arrays.
//!
//! Functions take and return plain numbers, one-dimensional arrays and dictionaries of arrays; the modules of
//! `python/kerrlight/` give them shapes, names and documentation. No state is kept between calls, and long work runs
//! without Python's interpreter lock.

#![cfg(feature = "extension")]

mod call;
mod curve;
mod fits;
mod fourier;
mod lengths;
mod model;
mod model_settings;
mod observation;
mod observing;
mod orbits;
mod pictures;
mod program;
mod rays;
mod refusal;
mod representation;
mod threads;
mod volume;

use pyo3::prelude::*;

/// The functions of the package.
#[pymodule(gil_used = false)]
fn _core(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add("__version__", env!("CARGO_PKG_VERSION"))?;
    curve::add(module)?;
    fits::add(module)?;
    fourier::add(module)?;
    lengths::add(module)?;
    model::add(module)?;
    observation::add(module)?;
    observing::add(module)?;
    orbits::add(module)?;
    pictures::add(module)?;
    program::add(module)?;
    rays::add(module)?;
    volume::add(module)
}
