//! How calls cross the border: what is refused is a `ValueError` with the same words, a bug a `RuntimeError`.

use pyo3::exceptions::{PyRuntimeError, PyValueError};
use pyo3::prelude::*;
use std::any::Any;
use std::fmt::Display;
use std::panic::{AssertUnwindSafe, catch_unwind};

/// The `ValueError` with the words of a refusal.
pub fn refused(error: impl Display) -> PyErr {
    PyValueError::new_err(format!("{error:#}"))
}

/// Does long work without the interpreter lock.
///
/// # Errors
/// `ValueError` for what the work refuses, `RuntimeError` if it panics, which is a bug.
pub fn detached<T: Send, E: Display + Send>(
    py: Python<'_>,
    work: impl FnOnce() -> Result<T, E> + Send,
) -> PyResult<T> {
    match py.detach(|| catch_unwind(AssertUnwindSafe(work))) {
        Ok(result) => result.map_err(refused),
        Err(panic) => Err(PyRuntimeError::new_err(format!("internal error: {}", message(&*panic)))),
    }
}

/// What a panic said.
fn message(panic: &(dyn Any + Send)) -> &str {
    let text = panic.downcast_ref::<&str>().copied();
    text.or_else(|| panic.downcast_ref::<String>().map(String::as_str)).unwrap_or("panic")
}
