//! Long work that somebody else may want to end: a thread is given a flag, and all that traces rays on it looks at the
//! flag between rays. Without one nothing changes.
//!
//! ```
//! use kerrlight_geodesic::{Inclination, Integrator, Kerr, Observer, Request, interrupt};
//! use std::panic::{AssertUnwindSafe, catch_unwind};
//! use std::sync::atomic::AtomicBool;
//!
//! static STOP: AtomicBool = AtomicBool::new(true);
//! interrupt::obey(&STOP);
//! let hole = Kerr::new(0.5)?;
//! let observer = Observer::at_infinity(Inclination::from_degrees(60.0)?);
//! let work = || Integrator::TaylorMino.trace(&hole, &observer, &[5.0], &[1.0], 1e-8, &Request::default());
//! let payload = catch_unwind(AssertUnwindSafe(work)).unwrap_err();
//! assert!(payload.is::<interrupt::Stopped>());
//! # Ok::<(), kerrlight_geodesic::Error>(())
//! ```

use core::cell::Cell;
use core::sync::atomic::{AtomicBool, Ordering};

std::thread_local! {
    static FLAG: Cell<Option<&'static AtomicBool>> = const { Cell::new(None) };
}

/// The payload with which work unwinds that was told to stop.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Stopped;

/// Has work on this thread obey a flag from now on: when it is raised, the work unwinds with [`Stopped`]. A pool of threads
/// does this when each of them starts.
pub fn obey(flag: &'static AtomicBool) {
    FLAG.set(Some(flag));
}

/// Returns whether work on this thread is told to stop.
#[inline]
pub fn is_wanted() -> bool {
    FLAG.get().is_some_and(|flag| flag.load(Ordering::Relaxed))
}

/// Unwinds if work on this thread is told to stop; no panic is reported.
#[inline]
pub fn check() {
    if is_wanted() {
        std::panic::resume_unwind(Box::new(Stopped));
    }
}
