//! The program `kerrlight` inside Python's process.

use crate::representation::{self, Raised};
use kerrlight_cli::Program;
use pyo3::prelude::*;
use std::ffi::OsString;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};

/// Adds the functions of this module.
pub fn add(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_function(wrap_pyfunction!(program, module)?)
}

/// Does what a command line says, whose first word is the program's name; `launcher` starts the program again, for
/// the fits of a comparison. Returns the exit code: 1 where a representation that is written in Python raised.
#[pyfunction]
fn program(py: Python<'_>, arguments: Vec<OsString>, launcher: Vec<OsString>) -> u8 {
    let program = Program::new().other_representations(representation::find).launched_by(launcher);
    let run = AssertUnwindSafe(|| program.run_with(arguments));
    py.detach(|| catch_unwind(run)).unwrap_or_else(|panic| match panic.downcast::<Raised>() {
        Ok(raised) => {
            eprintln!("error: the representation raised {}", raised.0);
            1
        }
        Err(panic) => resume_unwind(panic),
    })
}
