//! Calls across the border: refusals are a `ValueError` with the same words, bugs a `RuntimeError`.

use crate::refusal::refused;
use crate::threads::{Pool, stay_on_this_thread};
use kerrlight_geodesic::interrupt::Stopped;
use pyo3::exceptions::{PyKeyboardInterrupt, PyRuntimeError};
use pyo3::prelude::*;
use std::any::Any;
use std::fmt::Display;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::Duration;

/// Result of work, or its panic.
type Ended<T, E> = Result<Result<T, E>, Box<dyn Any + Send>>;

/// Does long work without the interpreter lock. A signal stops work of Python's main thread within moments, as Ctrl-C.
///
/// # Errors
/// `ValueError` for what the work refuses, what the handler of a signal raises, `RuntimeError` if it panics, which is a
/// bug.
pub fn detached<T: Send, E: Display + Send>(
    py: Python<'_>,
    work: impl FnOnce() -> Result<T, E> + Send,
) -> PyResult<T> {
    match Pool::of_call(py)? {
        Some(pool) => watched(py, pool, work),
        None => finished(py.detach(|| catch_unwind(AssertUnwindSafe(work)))),
    }
}

/// Does work that takes less time than to wake another thread.
///
/// # Errors
/// As [`detached`].
pub fn at_once<T: Send, E: Display + Send>(
    py: Python<'_>,
    work: impl FnOnce() -> Result<T, E> + Send,
) -> PyResult<T> {
    stay_on_this_thread();
    finished(py.detach(|| catch_unwind(AssertUnwindSafe(work))))
}

/// Longest time that a signal may wait to be seen.
const MOMENT: Duration = Duration::from_millis(50);

/// Does work in a pool, since signals reach Python's main thread alone, which looks for them.
fn watched<T: Send, E: Display + Send>(
    py: Python<'_>,
    pool: &Pool,
    work: impl FnOnce() -> Result<T, E> + Send,
) -> PyResult<T> {
    let (ended, caller) = (AtomicBool::new(false), thread::current());
    let work = || {
        let result = catch_unwind(AssertUnwindSafe(work));
        ended.store(true, Ordering::Release);
        caller.unpark();
        result
    };
    let mut raised = None;
    let wait = || {
        while !ended.load(Ordering::Acquire) {
            thread::park_timeout(MOMENT);
            // After the first exception, or the end of the work, signals are left to Python.
            if raised.is_none()
                && !ended.load(Ordering::Acquire)
                && let Err(error) = Python::attach(|py| py.check_signals())
            {
                pool.stop(true);
                raised = Some(error);
            }
        }
    };
    let result = py.detach(|| pool.work(work, wait));
    match (raised, result) {
        (Some(error), _) => {
            // The pool serves later calls as well.
            pool.stop(false);
            Err(error)
        }
        (None, Some(result)) => finished(result),
        (None, None) => Err(PyRuntimeError::new_err("internal error: no result")),
    }
}

/// Returns the result of work that has ended.
fn finished<T, E: Display>(result: Ended<T, E>) -> PyResult<T> {
    result.map_err(|panic| unwound(&*panic))?.map_err(refused)
}

/// The exception of work that was stopped in the middle, or has panicked.
pub fn unwound(panic: &(dyn Any + Send)) -> PyErr {
    match panic.is::<Stopped>() {
        true => PyKeyboardInterrupt::new_err(""),
        false => PyRuntimeError::new_err(format!("internal error: {}", message(panic))),
    }
}

/// Returns the words of a panic.
fn message(panic: &(dyn Any + Send)) -> &str {
    let text = panic.downcast_ref::<&str>().copied();
    text.or_else(|| panic.downcast_ref::<String>().map(String::as_str)).unwrap_or("panic")
}
