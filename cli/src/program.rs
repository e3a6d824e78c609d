//! The program with what others add to it.

use super::{Arguments, compare, fit, help, interrupt, output, plain, run};
use anyhow::Context;
use clap::FromArgMatches;
use kerrlight_tomo::representation::{BuildRepresentation, FindRepresentation, Registry};
use std::ffi::OsString;
use std::process::{Command, ExitCode};

/// The exit code of a case that another process runs: EX_TEMPFAIL of sysexits.h, to try again.
const BUSY: u8 = 75;

/// `kerrlight` with representations of one's own.
#[derive(Default)]
pub struct Program {
    pub(crate) registry: Registry,
    launcher: Vec<OsString>,
}

impl Program {
    /// `kerrlight` as it is.
    pub fn new() -> Self {
        Self::default()
    }

    /// With a representation more: `representation.kind = \"name\"` in fits and experiments.
    #[must_use]
    pub fn representation(mut self, name: &'static str, build: BuildRepresentation) -> Self {
        self.registry.add(name, build);
        self
    }

    /// With the representations that `find` knows by name, loaded when a fit names one.
    #[must_use]
    pub fn other_representations(mut self, find: FindRepresentation) -> Self {
        self.registry.find_others(find);
        self
    }

    /// Started by this command and its first arguments, where the executable of the process is something else: an
    /// interpreter that has the program as a module. Comparisons start their fits with it.
    #[must_use]
    pub fn launched_by(mut self, command: Vec<OsString>) -> Self {
        self.launcher = command;
        self
    }

    /// A command that starts the program once more.
    pub(crate) fn again(&self) -> anyhow::Result<Command> {
        Ok(match self.launcher.split_first() {
            Some((program, first)) => {
                let mut command = Command::new(program);
                command.args(first);
                command
            }
            None => {
                Command::new(std::env::current_exe().context("cannot find the program itself")?)
            }
        })
    }

    /// Does what the command line says; 0 is success, 2 an error, 1 a fit that failed while it ran or a comparison of which
    /// a part did, 75 a case that another process runs, 128 and the number of the signal what a signal has stopped: 130 after Ctrl-C, 143 after SIGTERM.
    pub fn run(self) -> ExitCode {
        ExitCode::from(self.run_with(std::env::args_os()))
    }

    /// The same for a command line of the caller's, whose first word is the program's name; returns the exit code.
    /// Help, and what is wrong with the words themselves, end the process.
    pub fn run_with(self, words: impl IntoIterator<Item = OsString>) -> u8 {
        let words: Vec<OsString> = words.into_iter().collect();
        if let Err(error) = plain::check_words(&words) {
            eprintln!("error: {}", plain::reasons(&error));
            return 2;
        }
        let matches = help::command().try_get_matches_from(words);
        let arguments = matches.and_then(|matches| Arguments::from_arg_matches(&matches));
        let arguments = arguments.unwrap_or_else(|error| output::exit(&error));
        match interrupt::listen().and_then(|()| run(&arguments, &self)) {
            Ok(()) => 0,
            Err(error) if error.is::<interrupt::Interrupted>() => {
                eprintln!("{}", plain::reasons(&error));
                interrupt::code()
            }
            Err(error) => {
                eprintln!("error: {}", plain::reasons(&error));
                if error.is::<compare::Busy>() {
                    return BUSY;
                }
                let failed = error.downcast_ref::<compare::Failed>().is_some()
                    || error.downcast_ref::<fit::Failed>().is_some();
                if failed { 1 } else { 2 }
            }
        }
    }
}
