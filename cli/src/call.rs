//! The program inside another one: on threads of its own, without a terminal, stopped by its caller and not by signals.

use crate::answer::Answer;
use crate::interrupt::{INTERRUPT, Requests};
use crate::program::Program;
use crate::session::{Said, Session};
use crate::usage::usage;
use crate::{Arguments, Ended, memory, threads};
use anyhow::anyhow;
use kerrlight_common::memory::set_limit_of_thread;
use rayon::ThreadPool;
use serde_json::Value;
use std::ffi::OsString;
use std::path::PathBuf;
use std::sync::Arc;

/// A command line that another program gives.
///
/// ```
/// use kerrlight_cli::{Call, Program, Said};
/// use std::sync::mpsc::channel;
///
/// let words = ["kerrlight", "fit", "--print"].map(Into::into).to_vec();
/// let (end, ended) = channel();
/// let hear = move |said: Said<'_>| {
///     if let Said::End = said {
///         let _ = end.send(());
///     }
/// };
/// let call = Call::new(words, None, hear)?;
/// let (settings, _) = call.run(&Program::new(), || drop(ended.recv()))?;
/// assert!(settings.contains("[hole]"));
/// # Ok::<(), kerrlight_cli::Ended>(())
/// ```
pub struct Call {
    arguments: Arguments,
    session: Arc<Session>,
    requests: &'static Requests,
    threads: ThreadPool,
    /// Note on its limit on memory.
    note: Option<String>,
}

impl Call {
    /// Takes these words, the first of which is the program's name. A fit without a file is one of `settings`, if there are
    /// any: their text, and the folder that paths in it start from. The call waits for `hear`, which is called on any
    /// thread.
    ///
    /// # Errors
    /// If the words make no sense, or there are no more threads.
    pub fn new(
        words: Vec<OsString>,
        settings: Option<(String, PathBuf)>,
        hear: impl Fn(Said<'_>) + Send + Sync + 'static,
    ) -> Result<Self, Ended> {
        let arguments = Arguments::parsed(words.clone())?;
        let (limit, note) = memory::bytes(arguments.memory)?;
        // Processor time is counted for the process: what the caller used before is not the call's.
        let cpu_seconds = usage().map_or(0.0, |usage| usage.cpu_seconds);
        let session = Arc::new(Session { hear: Box::new(hear), settings, words, cpu_seconds });
        let (of_threads, requests) = (Arc::clone(&session), Requests::of_call());
        let begin = move |_| {
            Arc::clone(&of_threads).begin();
            requests.obey();
            limit.into_iter().for_each(set_limit_of_thread);
        };
        let threads = threads::pool(arguments.threads, begin)?;
        Ok(Self { arguments, session, requests, threads, note })
    }

    /// Does the work on threads of its own while `wait` is called on this one, until it hears of the end. Returns the
    /// answer as text and as an object.
    ///
    /// # Errors
    /// As the program ends otherwise.
    ///
    /// # Panics
    /// With what the work panics, which is [`Stopped`](kerrlight_geodesic::interrupt::Stopped) where it was cut off.
    pub fn run(&self, program: &Program, wait: impl FnOnce()) -> Result<(String, Value), Ended> {
        let mut result = None;
        // In place: `wait` stays on the caller's thread, perhaps the only one to see its signals.
        self.threads.in_place_scope(|scope| {
            scope.spawn(|_| {
                // Dropped last, also when the work panics: `wait` would never return otherwise.
                let _end = End(&self.session);
                self.note.iter().for_each(|note| eprintln!("{note}"));
                let answer = self.arguments.verb.run(&self.arguments, program);
                result = Some(answer.and_then(Answer::told).map_err(Ended::from));
            });
            wait();
        });
        result.unwrap_or_else(|| Err(anyhow!("the work did not begin").into()))
    }

    /// Asks the work to stop, as Ctrl-C does in a terminal.
    pub fn stop(&self) {
        self.requests.raise(INTERRUPT);
    }
}

/// Tells of the end, whatever it is.
struct End<'a>(&'a Session);

impl Drop for End<'_> {
    fn drop(&mut self) {
        (self.0.hear)(Said::End);
    }
}
