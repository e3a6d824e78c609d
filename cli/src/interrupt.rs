//! Ctrl-C, and the system's requests to end. Work that keeps what it has is told to stop; anything else ends at once.

use crate::{output, threads};
use std::io::Read;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::Duration;

/// The signal of Ctrl-C.
const INTERRUPT: u8 = 2;
/// The signal that asks a program to end.
const TERMINATE: u8 = 15;

/// What a signal does depends on what is under way.
struct Now {
    /// The keeper, if there is one.
    keeper: Option<Kept>,
    /// The first signal.
    signal: Option<u8>,
}

/// How work that is under way wants to be stopped.
#[derive(Clone)]
enum Kept {
    /// In its own time; the words go to the terminal.
    Waits(&'static str),
    /// Within moments, or the program ends with these words: nothing is lost that is kept at all.
    Ends(String),
}

static NOW: Mutex<Now> = Mutex::new(Now { keeper: None, signal: None });
/// Whether there was one: read in inner loops.
static STOP: AtomicBool = AtomicBool::new(false);

/// Work was stopped by a signal; the words say what is kept and how to resume.
#[derive(Debug, thiserror::Error)]
#[error("{0}")]
pub struct Interrupted(pub String);

fn now() -> MutexGuard<'static, Now> {
    NOW.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Work that looks whether there was a signal, of which there is one at a time. Without it, and at a second signal,
/// the program ends at once.
pub struct Keeper(());

/// For how long the end waits for work that keeps nothing more.
const MOMENT: Duration = Duration::from_millis(800);

impl Keeper {
    /// Work that saves its state when it stops, and says `words` to the first signal.
    pub fn saving(words: &'static str) -> Self {
        Self::of(Kept::Waits(words))
    }

    /// Work that may be cut off at any moment; `words` say what is kept.
    pub fn brief(words: impl Into<String>) -> Self {
        Self::of(Kept::Ends(words.into()))
    }

    fn of(kept: Kept) -> Self {
        now().keeper = Some(kept);
        Keeper(())
    }

    /// Whether there was a signal.
    pub fn stopped(&self) -> bool {
        STOP.load(Ordering::Relaxed)
    }
}

impl Drop for Keeper {
    fn drop(&mut self) {
        now().keeper = None;
    }
}

/// The exit code of a program that a signal has stopped: 128 and its number, as shells have it.
pub fn code() -> u8 {
    128 + now().signal.unwrap_or(INTERRUPT)
}

/// A signal: the first is told to the keeper, if there is one; a second one ends the program.
fn raise(signal: u8) {
    let mut now = now();
    let is_first = now.signal.is_none();
    now.signal.get_or_insert(signal);
    STOP.store(true, Ordering::Relaxed);
    let keeper = now.keeper.clone();
    drop(now);
    match keeper {
        Some(Kept::Waits(words)) if is_first => tell(words),
        Some(Kept::Ends(words)) if is_first => {
            let said = words.clone();
            let late = threads::spawn(move || {
                std::thread::sleep(MOMENT);
                if self::now().keeper.is_some() {
                    end(signal, &said);
                }
            });
            if late.is_err() {
                end(signal, &words);
            }
        }
        _ => end(signal, "interrupted"),
    }
}

fn end(signal: u8, words: &str) -> ! {
    output::remove_unfinished();
    tell(words);
    std::process::exit(i32::from(128 + signal))
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
    if !is_hangup_ignored() {
        signals.add(Signal::SIGHUP);
    }
    // If signals cannot be blocked, they end the program as usual.
    if signals.thread_block().is_ok() {
        threads::spawn(move || {
            while let Ok(signal) = signals.wait() {
                raise(signal as u8);
            }
        })?;
    }
    Ok(())
}

/// Whether the program was started by `nohup`.
#[cfg(unix)]
fn is_hangup_ignored() -> bool {
    use nix::sys::signal::{SaFlags, SigAction, SigHandler, SigSet, Signal, sigaction};
    let set = |handler| {
        let action = SigAction::new(handler, SaFlags::empty(), SigSet::empty());
        // SAFETY: neither the default nor ignoring runs any code of ours.
        unsafe { sigaction(Signal::SIGHUP, &action) }
    };
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
    let _ = ctrlc::set_handler(|| raise(INTERRUPT));
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
        if !STOP.load(Ordering::Relaxed) {
            raise(TERMINATE);
        }
    })?;
    Ok(())
}
