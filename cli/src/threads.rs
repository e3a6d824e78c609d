//! Threads: the one place where they are started, and what is said where there are no more of them.

use anyhow::anyhow;
use rayon::{ThreadPool, ThreadPoolBuilder};
use std::error::Error;
use std::io::ErrorKind;
use std::thread::{Builder, JoinHandle, Scope, ScopedJoinHandle};

/// Threads a core that `--threads` starts at most: further ones would only wait for each other.
const MOST_A_CORE: usize = 4;

/// Variable of the environment in place of `--threads`.
const VARIABLE: &str = "RAYON_NUM_THREADS";

/// The largest number of threads that can be asked for.
pub const MOST: i64 = 1024;

/// Starts the threads that loops are shared among. Later nobody could be told that they cannot be started.
///
/// # Errors
/// If the system has no more threads.
pub fn start(wanted: Option<u16>) -> anyhow::Result<()> {
    let count = wanted_count(wanted);
    let built = ThreadPoolBuilder::new().num_threads(count).build_global();
    // Without a source they have been started before, in a process that runs the program twice.
    match built.as_ref().map_err(Error::source) {
        Err(Some(error)) => Err(refused(error, count)),
        _ => Ok(()),
    }
}

/// Threads of their own, as many as are wanted: else one a core or as many as the environment says. `begin` is called on
/// each with its number.
///
/// # Errors
/// If the system has no more threads.
pub fn pool(
    wanted: Option<u16>,
    begin: impl Fn(usize) + Send + Sync + 'static,
) -> anyhow::Result<ThreadPool> {
    let count = wanted_count(wanted);
    let built = ThreadPoolBuilder::new().num_threads(count).start_handler(begin).build();
    built.map_err(|error| refused(error.source().unwrap_or(&error), count))
}

fn wanted_count(wanted: Option<u16>) -> usize {
    count(wanted.map(usize::from), std::env::var(VARIABLE).ok().as_deref(), cores())
}

fn cores() -> usize {
    std::thread::available_parallelism().map_or(1, usize::from)
}

/// Returns the number of threads.
fn count(wanted: Option<usize>, variable: Option<&str>, cores: usize) -> usize {
    let of_environment = || variable.and_then(|text| text.parse().ok()).filter(|count| *count > 0);
    match wanted {
        Some(wanted) => wanted.min(MOST_A_CORE * cores),
        None => of_environment().unwrap_or(cores).min(MOST as usize),
    }
}

/// Starts a thread.
///
/// # Errors
/// If the system has no more threads.
pub fn spawn<T: Send + 'static>(
    work: impl FnOnce() -> T + Send + 'static,
) -> anyhow::Result<JoinHandle<T>> {
    Builder::new().spawn(work).map_err(|error| refused(&error, 1))
}

/// Starts a thread that may borrow.
///
/// # Errors
/// If the system has no more threads; the work is dropped.
pub fn spawn_in<'scope, T: Send + 'scope>(
    scope: &'scope Scope<'scope, '_>,
    work: impl FnOnce() -> T + Send + 'scope,
) -> anyhow::Result<ScopedJoinHandle<'scope, T>> {
    Builder::new().spawn_scoped(scope, work).map_err(|error| refused(&error, 1))
}

/// Returns the error where so many threads cannot be started.
fn refused(error: &dyn Error, count: usize) -> anyhow::Error {
    let threads = if count == 1 { "a thread".to_owned() } else { format!("{count} threads") };
    no_more(&threads, error)
}

/// Returns the error where another process cannot be started.
pub fn no_process(what: &str, error: &std::io::Error) -> anyhow::Error {
    match error.kind() {
        ErrorKind::WouldBlock => no_more(what, error),
        _ => anyhow!("cannot start {what}: {error}"),
    }
}

fn no_more(what: &str, error: &dyn Error) -> anyhow::Error {
    anyhow!(
        "cannot start {what} ({error}): raise the limit of processes and threads (`ulimit -u`, or pids.max of the \
         control group) or of memory (`ulimit -v`), end other processes, or ask for fewer threads with \
         --threads or {VARIABLE}"
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exact_threads_that_do_not_help_are_not_started() {
        assert_eq!(count(None, None, 6), 6);
        assert_eq!(count(Some(3), Some("128"), 6), 3);
        assert_eq!(count(Some(1024), None, 2), 8);
        // The environment stands for the cores of a machine.
        assert_eq!(count(None, Some("128"), 2), 128);
        assert_eq!(count(None, Some("1000000000"), 2), 1024);
        assert_eq!([count(None, Some("0"), 2), count(None, Some("x"), 2)], [2, 2]);
    }
}
