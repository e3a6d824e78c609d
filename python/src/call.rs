//! How calls cross the border: what is refused is a `ValueError` with the same words, a bug a `RuntimeError`.

use pyo3::exceptions::{PyRuntimeError, PyValueError};
use pyo3::prelude::*;
use std::any::Any;
use std::fmt::Display;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::Duration;

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
    let work = || {
        stay_on_this_thread();
        work()
    };
    match py.detach(|| catch_unwind(AssertUnwindSafe(work))) {
        Ok(result) => result.map_err(refused),
        Err(panic) => Err(PyRuntimeError::new_err(format!("internal error: {}", message(&*panic)))),
    }
}

thread_local! {
    /// Whether this thread is the only one of a pool of its own; the pool lives as long as the process.
    static IS_ALONE: bool = {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(1).use_current_thread().build();
        pool.map(std::mem::forget).is_ok()
    };
}

/// Where there is one thread for all work (`RAYON_NUM_THREADS=1`), calls from several threads of Python, such as those
/// of dask or joblib, would wait for one another: each then works on the thread that it comes from.
fn stay_on_this_thread() {
    if rayon::current_thread_index().is_none() && rayon::current_num_threads() == 1 {
        IS_ALONE.with(|_| ());
    }
}

/// How long a signal may wait to be seen.
const MOMENT: Duration = Duration::from_millis(50);

/// Does long work that looks at the flag whether to stop, which a signal raises: Python's handler of the signal runs,
/// and what it raises is returned. The work is on a thread of its own, as signals reach Python's main thread alone.
///
/// # Errors
/// As [`detached`], and what the handler of a signal raises.
pub fn interruptible<T: Send, E: Display + Send>(
    py: Python<'_>,
    work: impl FnOnce(&AtomicBool) -> Result<T, E> + Send,
) -> PyResult<T> {
    let [stop, done] = [false, false].map(AtomicBool::new);
    let caller = thread::current();
    thread::scope(|scope| {
        let worker = scope.spawn(|| {
            let result = catch_unwind(AssertUnwindSafe(|| work(&stop)));
            done.store(true, Ordering::Release);
            caller.unpark();
            result
        });
        let mut raised = None;
        while !done.load(Ordering::Acquire) {
            py.detach(|| thread::park_timeout(MOMENT));
            if let (None, Err(error)) = (&raised, py.check_signals()) {
                stop.store(true, Ordering::Relaxed);
                raised = Some(error);
            }
        }
        let result = py.detach(|| worker.join()).and_then(|result| result);
        raised.map_or_else(|| finished(result), Err)
    })
}

/// What is told of work that has ended.
fn finished<T, E: Display>(result: Result<Result<T, E>, Box<dyn Any + Send>>) -> PyResult<T> {
    let text = |panic: &(dyn Any + Send)| format!("internal error: {}", message(panic));
    let result = result.map_err(|panic| PyRuntimeError::new_err(text(&*panic)))?;
    result.map_err(refused)
}

/// What a panic said.
fn message(panic: &(dyn Any + Send)) -> &str {
    let text = panic.downcast_ref::<&str>().copied();
    text.or_else(|| panic.downcast_ref::<String>().map(String::as_str)).unwrap_or("panic")
}
