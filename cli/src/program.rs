//! The program with what others add to it.

use super::{Arguments, compare, fit, help, interrupt, run};
use clap::FromArgMatches;
use kerrlight_tomo::representation::{BuildRepresentation, Registry};
use std::process::ExitCode;

/// `kerrlight` with representations of one's own.
#[derive(Default)]
pub struct Program {
    registry: Registry,
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

    /// Does what the command line says; 0 is success, 2 an error, 1 a fit that failed while it ran or a comparison of which
    /// a part did, 128 and the number of the signal what a signal has stopped: 130 after Ctrl-C, 143 after SIGTERM.
    pub fn run(self) -> ExitCode {
        let matches = help::command().get_matches();
        let arguments = Arguments::from_arg_matches(&matches).unwrap_or_else(|error| error.exit());
        interrupt::listen();
        match run(&arguments, &self.registry) {
            Ok(()) => ExitCode::SUCCESS,
            Err(error) if error.is::<interrupt::Interrupted>() => {
                eprintln!("{error:#}");
                ExitCode::from(interrupt::code())
            }
            Err(error) => {
                eprintln!("error: {error:#}");
                let failed = error.downcast_ref::<compare::Failed>().is_some()
                    || error.downcast_ref::<fit::Failed>().is_some();
                ExitCode::from(if failed { 1 } else { 2 })
            }
        }
    }
}
