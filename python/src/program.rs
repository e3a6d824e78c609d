//! The program `kerrlight` inside Python's process.

use kerrlight_cli::Program;
use pyo3::prelude::*;
use std::ffi::OsString;

/// Adds the functions of this module.
pub fn add(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_function(wrap_pyfunction!(program, module)?)
}

/// Does what a command line says, whose first word is the program's name; `launcher` starts the program again, for
/// the fits of a comparison. Returns the exit code.
#[pyfunction]
fn program(py: Python<'_>, arguments: Vec<OsString>, launcher: Vec<OsString>) -> u8 {
    py.detach(|| Program::new().launched_by(launcher).run_with(arguments))
}
