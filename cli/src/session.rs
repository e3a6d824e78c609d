//! Session of a call: the program that has called, if one has, hears of the progress in place of a terminal.

use crate::plain;
use indicatif::ProgressBar;
use serde_json::Value;
use std::cell::RefCell;
use std::ffi::OsString;
use std::io::Write;
use std::path::PathBuf;
use std::sync::Arc;

/// A message to the caller while a call runs.
#[derive(Debug)]
pub enum Said<'a> {
    /// Words that the program writes to standard error.
    Words(&'a str),
    /// A line of a run's log.
    Line(&'a Value),
    /// Progress: so much of so much is done.
    Done(u64, u64),
    /// The call has ended.
    End,
}

/// Session of the threads of a call.
pub struct Session {
    /// Is told of all.
    pub hear: Box<dyn Fn(Said<'_>) + Send + Sync>,
    /// Settings as text, and where paths in them start from.
    pub settings: Option<(String, PathBuf)>,
    /// The words of the command line.
    pub words: Vec<OsString>,
    /// Processor time that the process had used before.
    pub cpu_seconds: f64,
}

thread_local! {
    /// Session of this thread.
    static HERE: RefCell<Option<Arc<Session>>> = const { RefCell::new(None) };
}

fn here() -> Option<Arc<Session>> {
    HERE.with_borrow(Clone::clone)
}

/// Returns whether another program has called this work.
pub fn is_here() -> bool {
    HERE.with_borrow(Option::is_some)
}

impl Session {
    /// Has work on this thread be of this session.
    pub fn begin(self: Arc<Self>) {
        HERE.set(Some(self));
    }
}

/// Tells the caller, if there is one; no panic if standard error is closed or on a full disk.
pub fn say(words: &str) {
    let words = plain::lines(words);
    match here() {
        Some(session) => (session.hear)(Said::Words(&words)),
        None => drop(std::io::stderr().write_all(words.as_bytes())),
    }
}

/// Tells the caller, if there is one, of a line of the log.
pub fn log(line: &Value) {
    if let Some(session) = here() {
        (session.hear)(Said::Line(line));
    }
}

/// Tells the caller, if there is one, how far a bar is.
pub fn reached(bar: &ProgressBar) {
    if let Some(session) = here() {
        (session.hear)(Said::Done(bar.position(), bar.length().unwrap_or(0)));
    }
}

/// Settings that the caller gives as text, and where paths in them start from.
pub fn settings() -> Option<(String, PathBuf)> {
    here().and_then(|session| session.settings.clone())
}

/// The words of the command line.
pub fn words() -> Vec<OsString> {
    here().map_or_else(|| std::env::args_os().collect(), |session| session.words.clone())
}

/// Processor time that was used before the call.
pub fn cpu_seconds_before() -> f64 {
    here().map_or(0.0, |session| session.cpu_seconds)
}
