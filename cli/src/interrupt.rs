//! Ctrl-C, and the system's requests to end. Work that keeps what it has is told to stop; anything else ends at once.

use crate::{output, threads};
use kerrlight_geodesic::interrupt as geodesic;
use std::cell::Cell;
use std::io::Read;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::Duration;

/// The signal of Ctrl-C.
pub const INTERRUPT: u8 = 2;
/// The signal that asks a program to end.
const TERMINATE: u8 = 15;

/// Current work, which decides what a signal does.
struct Now {
    /// The keeper, if there is one.
    keeper: Option<Kept>,
    /// The first signal.
    signal: Option<u8>,
}

/// Way in which work that is under way wants to be stopped.
#[derive(Clone)]
enum Kept {
    /// Stops in its own time; the words go to the terminal.
    Waits(&'static str),
    /// Within moments, or it is cut off with these words: nothing is lost that is kept at all.
    Ends(String),
}

/// Requests to stop work: signals to the process, or the caller of a [`Call`](crate::Call).
pub struct Requests {
    now: Mutex<Now>,
    /// True if there was one: read in inner loops.
    stop: AtomicBool,
    /// Loops that look at it unwind where work is cut off. Without it the process ends.
    at_once: Option<&'static AtomicBool>,
}

static OF_PROCESS: Requests = Requests::new(None);

thread_local! {
    /// Those that work on this thread obeys, where they are not those of the process.
    static OF_THREAD: Cell<Option<&'static Requests>> = const { Cell::new(None) };
}

fn here() -> &'static Requests {
    OF_THREAD.get().unwrap_or(&OF_PROCESS)
}

impl Requests {
    const fn new(at_once: Option<&'static AtomicBool>) -> Self {
        let now = Mutex::new(Now { keeper: None, signal: None });
        Self { now, stop: AtomicBool::new(false), at_once }
    }

    /// Those of a call. They live as long as the process, as threads of a pool outlive their work.
    pub fn of_call() -> &'static Self {
        let at_once = Box::leak(Box::new(AtomicBool::new(false)));
        Box::leak(Box::new(Self::new(Some(at_once))))
    }

    /// Has work on this thread obey them.
    pub fn obey(&'static self) {
        OF_THREAD.set(Some(self));
        self.at_once.into_iter().for_each(geodesic::obey);
    }

    fn now(&self) -> MutexGuard<'_, Now> {
        self.now.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// A signal: the first is told to the keeper, if there is one; a second one cuts the work off.
    pub fn raise(&'static self, signal: u8) {
        let mut now = self.now();
        let is_first = now.signal.is_none();
        now.signal.get_or_insert(signal);
        // A flag by itself: it publishes no other data.
        self.stop.store(true, Ordering::Relaxed);
        let keeper = now.keeper.clone();
        drop(now);
        match keeper {
            Some(Kept::Waits(words)) if is_first => self.tell(words),
            Some(Kept::Ends(words)) if is_first => {
                let said = words.clone();
                let late = threads::spawn(move || {
                    std::thread::sleep(MOMENT);
                    // Work that has ended in the meantime has dropped its guard.
                    if self.now().keeper.is_some() {
                        self.cut_off(signal, &said);
                    }
                });
                // Without a thread that waits, nobody would end the work later.
                if late.is_err() {
                    self.cut_off(signal, &words);
                }
            }
            _ => self.cut_off(signal, "interrupted"),
        }
    }

    fn cut_off(&self, signal: u8, words: &str) {
        self.tell(words);
        match self.at_once {
            Some(flag) => flag.store(true, Ordering::Relaxed),
            None => {
                output::remove_unfinished();
                std::process::exit(i32::from(128 + signal))
            }
        }
    }

    /// A call has no terminal.
    fn tell(&self, words: &str) {
        if self.at_once.is_none() {
            tell(words);
        }
    }
}

/// Work was stopped by a signal; the words say what is kept and how to resume.
#[derive(Debug, thiserror::Error)]
#[error("{0}")]
pub struct Interrupted(pub String);

/// Work that looks whether there was a signal, of which there is one at a time. Without it, and at a second signal, the
/// program ends at once.
pub struct SignalGuard(&'static Requests);

/// Time for which the end waits for work that keeps nothing more.
const MOMENT: Duration = Duration::from_millis(800);

impl SignalGuard {
    /// Work that saves its state when it stops, and says `words` to the first signal.
    pub fn saving(words: &'static str) -> Self {
        Self::of(Kept::Waits(words))
    }

    /// Work that may be cut off at any moment; `words` say what is kept.
    pub fn brief(words: impl Into<String>) -> Self {
        Self::of(Kept::Ends(words.into()))
    }

    fn of(kept: Kept) -> Self {
        let requests = here();
        requests.now().keeper = Some(kept);
        SignalGuard(requests)
    }

    /// Returns whether there was a signal.
    pub fn stopped(&self) -> bool {
        self.0.stop.load(Ordering::Relaxed)
    }
}

impl Drop for SignalGuard {
    fn drop(&mut self) {
        self.0.now().keeper = None;
    }
}

/// The exit code of a program that a signal has stopped: 128 and its number, as shells have it.
pub fn code() -> u8 {
    128 + here().now().signal.unwrap_or(INTERRUPT)
}

/// Past the lock of standard error, which the interrupted thread may hold.
#[cfg(unix)]
fn tell(text: &str) {
    let _ = nix::unistd::write(std::io::stderr(), format!("{text}\n").as_bytes());
}

#[cfg(not(unix))]
fn tell(text: &str) {
    eprintln!("{text}");
}

/// Listens to signals: before any other thread starts, as all of them must leave signals to this one.
///
/// # Errors
/// If the system has no more threads.
#[cfg(unix)]
pub fn listen() -> anyhow::Result<()> {
    use nix::sys::signal::{SigSet, Signal};
    let mut signals = SigSet::empty();
    signals.add(Signal::SIGINT);
    signals.add(Signal::SIGTERM);
    // Batch systems announce a limit of time by it.
    signals.add(Signal::SIGXCPU);
    if !is_hangup_ignored() {
        signals.add(Signal::SIGHUP);
    }
    // A file that is too large is an error of writing, as a full disk is.
    let mut blocked = signals;
    blocked.add(Signal::SIGXFSZ);
    // If signals cannot be blocked, they end the program as usual.
    if blocked.thread_block().is_ok() {
        threads::spawn(move || {
            while let Ok(signal) = signals.wait() {
                // The system repeats it each second: one is one request.
                let is_repeated = OF_PROCESS.stop.load(Ordering::Relaxed);
                if signal == Signal::SIGXCPU && is_repeated {
                    continue;
                }
                OF_PROCESS.raise(signal as u8);
            }
        })?;
    }
    Ok(())
}

/// Returns whether the program was started by `nohup`.
#[cfg(unix)]
fn is_hangup_ignored() -> bool {
    use nix::sys::signal::{SaFlags, SigAction, SigHandler, SigSet, Signal, sigaction};
    let set = |handler| {
        let action = SigAction::new(handler, SaFlags::empty(), SigSet::empty());
        // SAFETY: neither the default nor ignoring runs any code of ours.
        unsafe { sigaction(Signal::SIGHUP, &action) }
    };
    // The present action is told only in exchange for another one.
    let ignored =
        set(SigHandler::SigIgn).is_ok_and(|old| matches!(old.handler(), SigHandler::SigIgn));
    if !ignored {
        let _ = set(SigHandler::SigDfl);
    }
    ignored
}

/// Listens to Ctrl-C.
///
/// # Errors
/// None: without a handler Ctrl-C ends the program, as everywhere.
#[cfg(not(unix))]
pub fn listen() -> anyhow::Result<()> {
    let _ = ctrlc::set_handler(|| OF_PROCESS.raise(INTERRUPT));
    Ok(())
}

/// Takes the end of standard input for a request to end: of a parent that closes it, or is no more.
///
/// # Errors
/// If the system has no more threads.
pub fn follow_parent() -> anyhow::Result<()> {
    threads::spawn(|| {
        let mut bytes = [0; 64];
        let mut input = std::io::stdin();
        while input.read(&mut bytes).is_ok_and(|count| count > 0) {}
        // A terminal's Ctrl-C reaches both processes: it is one request.
        if !OF_PROCESS.stop.load(Ordering::Relaxed) {
            OF_PROCESS.raise(TERMINATE);
        }
    })?;
    Ok(())
}
