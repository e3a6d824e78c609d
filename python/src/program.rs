//! The program `kerrlight` inside Python's process.

use crate::call::unwound;
use crate::refusal::refused;
use crate::representation::{self, Raised};
use kerrlight_cli::{BUSY, Call, Ended, Program, Said};
use pyo3::exceptions::PyKeyboardInterrupt;
use pyo3::prelude::*;
use serde_json::Value;
use std::any::Any;
use std::ffi::OsString;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::path::PathBuf;
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::time::Duration;

fn with_ours(launcher: Vec<OsString>) -> Program {
    Program::new().other_representations(representation::find).launched_by(launcher)
}

/// Does what a command line says, whose first word is the program's name; `launcher` starts the program again, for
/// the fits of a comparison. Returns the exit code: 1 where a representation that is written in Python raised.
#[pyfunction]
pub fn program(py: Python<'_>, arguments: Vec<OsString>, launcher: Vec<OsString>) -> u8 {
    let program = with_ours(launcher);
    let run = AssertUnwindSafe(|| program.run_with(arguments));
    // A representation in Python ends a fit by unwinding to here: its trait has no errors.
    py.detach(|| catch_unwind(run)).unwrap_or_else(|panic| match panic.downcast::<Raised>() {
        Ok(raised) => {
            raised.0.display(py);
            eprintln!("error: {raised}");
            1
        }
        Err(panic) => resume_unwind(panic),
    })
}

/// A message to the calling thread, with the sender that waits for its answer.
enum Message {
    Words(String),
    Line(String),
    Done(u64, u64),
    End,
}

/// Hands what is said to the thread that has called, and waits until that has heard it.
fn sent(said: Said<'_>, to: &Sender<(Message, Sender<()>)>) {
    let message = match said {
        Said::Words(words) => Message::Words(words.to_owned()),
        Said::Line(line) => Message::Line(line.to_string()),
        Said::Done(done, of) => Message::Done(done, of),
        Said::End => Message::End,
    };
    let (heard, wait) = channel();
    if to.send((message, heard)).is_ok() {
        let _ = wait.recv();
    }
}

/// Longest time that a signal may wait to be seen.
const MOMENT: Duration = Duration::from_millis(50);

/// Does the same on threads of its own, and calls methods of `listener` on this one: `words(text)`, `line(json)` and
/// `done(count, of)`. Settings are the text of a fit's and the folder that paths in them start from. Returns the answer
/// as text and as JSON.
///
/// Raises what a handler of a signal or the listener raises, after the work has come to where it can be resumed;
/// `ValueError`, `FitError` or `Busy` with the words of the program otherwise.
#[pyfunction]
pub fn call(
    py: Python<'_>,
    arguments: Vec<OsString>,
    launcher: Vec<OsString>,
    settings: Option<(String, PathBuf)>,
    listener: &Bound<'_, PyAny>,
) -> PyResult<(String, String)> {
    let (send, messages) = channel();
    let call = Call::new(arguments, settings, move |said| sent(said, &send));
    let call = call.map_err(|ended| raised(py, ended))?;
    let (program, listener) = (with_ours(launcher), listener.clone().unbind());
    let mut error = None;
    let work =
        AssertUnwindSafe(|| call.run(&program, || error = listen(messages, &call, &listener)));
    let result = py.detach(|| catch_unwind(work));
    // What the listener or a signal raised comes before what became of the work.
    if let Some(error) = error {
        return Err(error);
    }
    let (text, answer): (String, Value) =
        result.map_err(|panic| of_panic(py, &*panic))?.map_err(|ended| raised(py, ended))?;
    Ok((text, answer.to_string()))
}

/// Passes on what is said until the end, and asks the work to stop at every exception, of which it returns the first.
fn listen(
    messages: Receiver<(Message, Sender<()>)>,
    call: &Call,
    listener: &Py<PyAny>,
) -> Option<PyErr> {
    let mut error = None;
    loop {
        // Dropped at the end of each turn, which wakes the thread that waits in `sent`.
        let (message, _heard) = match messages.recv_timeout(MOMENT) {
            Ok((Message::End, _)) | Err(RecvTimeoutError::Disconnected) => return error,
            Ok((message, heard)) if error.is_none() => (Some(message), Some(heard)),
            Ok((_, heard)) => (None, Some(heard)),
            Err(RecvTimeoutError::Timeout) => (None, None),
        };
        let result = Python::attach(|py| {
            py.check_signals()?;
            message.map_or(Ok(()), |message| hear(listener.bind(py), message))
        });
        if let Err(raised) = result {
            call.stop();
            error.get_or_insert(raised);
        }
    }
}

fn hear(listener: &Bound<'_, PyAny>, message: Message) -> PyResult<()> {
    match message {
        Message::Words(text) => listener.call_method1("words", (text,)),
        Message::Line(json) => listener.call_method1("line", (json,)),
        Message::Done(done, of) => listener.call_method1("done", (done, of)),
        Message::End => return Ok(()),
    }?;
    Ok(())
}

/// The exception of a call that has not done what it was told.
fn raised(py: Python<'_>, Ended { code, words }: Ended) -> PyErr {
    let named = |name: &str| match py.import("kerrlight._program").and_then(|m| m.getattr(name)) {
        Ok(kind) => kind.call1((&words,)).map_or_else(|error| error, PyErr::from_value),
        Err(error) => error,
    };
    match code {
        1 => named("FitError"),
        BUSY => named("Busy"),
        128.. => PyKeyboardInterrupt::new_err(words),
        _ => refused(words),
    }
}

/// The exception of work that panicked; that of a representation has what it raised as its cause.
fn of_panic(py: Python<'_>, panic: &(dyn Any + Send)) -> PyErr {
    let Some(of) = panic.downcast_ref::<Raised>() else { return unwound(panic) };
    let error = raised(py, Ended { code: 1, words: of.to_string() });
    error.set_cause(py, Some(of.0.clone_ref(py)));
    error
}
