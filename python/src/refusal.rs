//! Refusals, as Python's exceptions.

use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use std::fmt::Display;

/// The `ValueError` with the words of a refusal.
pub fn refused(error: impl Display) -> PyErr {
    PyValueError::new_err(format!("{error:#}"))
}
