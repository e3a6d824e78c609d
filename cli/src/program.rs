//! The program with what others add to it.

use anyhow::Context;
use kerrlight_tomo::representation::{BuildRepresentation, FindRepresentation, Registry};
use std::ffi::OsString;
use std::process::Command;

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

    /// Adds a representation: `representation.kind = "name"` in fits and experiments.
    #[must_use]
    pub fn representation(mut self, name: &'static str, build: BuildRepresentation) -> Self {
        self.registry.add(name, build);
        self
    }

    /// Adds the representations that `find` knows by name, loaded when a fit names one.
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
}
