//! The threads that loops are shared among: pools of this process, made anew after a fork, whose child has none of its
//! parent's threads.

use crate::refusal::refused;
use kerrlight_cli::threads;
use kerrlight_geodesic::interrupt;
use pyo3::prelude::*;
use std::process;
use std::ptr::null_mut;
use std::sync::atomic::{AtomicBool, AtomicPtr, Ordering};

/// Threads with the flag that stops their work. It lives as long as its process.
pub struct Pool {
    process: u32,
    threads: rayon::ThreadPool,
    stop: &'static AtomicBool,
}

/// Pool of Python's main thread, whose work signals stop, and that of all other threads. No lock that a fork could copy.
static POOLS: [AtomicPtr<Pool>; 2] = [const { AtomicPtr::new(null_mut()) }; 2];

thread_local! {
    /// True if this thread is the only one of a pool of its own; the pool lives as long as the process.
    static IS_ALONE: bool = {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(1).use_current_thread().build();
        pool.map(std::mem::forget).is_ok()
    };
}

/// Has loops that begin on this thread stay on it.
pub fn stay_on_this_thread() {
    IS_ALONE.with(|_| ());
}

/// Returns whether this thread has been made the only one of a pool.
fn is_alone() -> bool {
    // The count first: looking at IS_ALONE makes a pool of a thread that has none.
    rayon::current_num_threads() == 1 && IS_ALONE.with(|is_alone| *is_alone)
}

fn is_main_thread(py: Python<'_>) -> PyResult<bool> {
    let threading = py.import("threading")?;
    let [main, this] = ["main_thread", "current_thread"].map(|name| threading.call_method0(name));
    Ok(main?.is(&this?))
}

impl Pool {
    /// The pool that does the work of a call; none if the calling thread does it.
    ///
    /// # Errors
    /// `ValueError` if the system has no more threads.
    pub fn of_call(py: Python<'_>) -> PyResult<Option<&'static Self>> {
        // A loop of the program's own, such as one that evaluates a representation of Python.
        if rayon::current_thread_index().is_some() && !is_alone() {
            return Ok(None);
        }
        let is_main = is_main_thread(py)?;
        let pool = Self::of_process(is_main)?;
        // Where there is one thread for all work (`RAYON_NUM_THREADS=1`), calls from several threads of Python, such as
        // those of dask or joblib, would wait for one another.
        let is_for_all = is_main || pool.threads.current_num_threads() > 1;
        if !is_for_all {
            stay_on_this_thread();
        }
        Ok(is_for_all.then_some(pool))
    }

    /// The pool of this process.
    fn of_process(is_main: bool) -> PyResult<&'static Self> {
        let place = &POOLS[usize::from(is_main)];
        // `Acquire`, since another thread may have made the pool behind the pointer.
        let found = place.load(Ordering::Acquire);
        // SAFETY: what is stored comes from a box that is never freed.
        match unsafe { found.as_ref() } {
            Some(pool) if pool.process == process::id() => Ok(pool),
            _ => {
                let new = Box::into_raw(Box::new(Self::new()?));
                let _ = place.compare_exchange(found, new, Ordering::AcqRel, Ordering::Acquire);
                // SAFETY: as above; of two threads that make a pool, both take the first one, and
                // the other pool stays idle.
                Ok(unsafe { &*place.load(Ordering::Acquire) })
            }
        }
    }

    fn new() -> PyResult<Self> {
        let stop: &'static AtomicBool = Box::leak(Box::new(AtomicBool::new(false)));
        let begin = move |_| interrupt::obey(stop);
        let threads = threads::pool(None, begin).map_err(refused)?;
        Ok(Pool { process: process::id(), threads, stop })
    }

    /// Does work on these threads while `wait` is called on the calling one, and returns when both have ended.
    pub fn work<T: Send>(&self, work: impl FnOnce() -> T + Send, wait: impl FnOnce()) -> Option<T> {
        let mut done = None;
        self.threads.in_place_scope(|scope| {
            scope.spawn(|_| done = Some(work()));
            wait();
        });
        done
    }

    /// Tells all work to stop, or that it may go on.
    pub fn stop(&self, stop: bool) {
        self.stop.store(stop, Ordering::Relaxed);
    }
}
