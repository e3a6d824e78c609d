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

/// The functions of the package.
#[pyo3::pymodule(gil_used = false)]
mod _core {
    use pyo3::prelude::*;

    #[pymodule_export]
    use crate::{
        curve::{band, critical_curve, critical_points},
        fits::{data_key, is_same_fit, known_hole},
        fourier::Fourier,
        lengths::{path_lengths, path_points},
        model::{Model, check_voxels},
        observation::{Visibilities, hours_utc_of_gmst},
        observing::{array, observe},
        orbits::{keplerian_redshift, radii, velocity},
        pictures::{Picture, film, render, scene_of_exr, toml_of_json, toml_value_of_json},
        program::{call, program},
        rays::{differentiate, trace},
        volume::view,
    };

    #[pymodule_init]
    fn init(module: &Bound<'_, PyModule>) -> PyResult<()> {
        module.add("__version__", env!("CARGO_PKG_VERSION"))
    }
}
