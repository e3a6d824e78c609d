//! The program with what others add to it.

use super::{Arguments, compare, fit, help, interrupt, run};
use anyhow::{anyhow, bail};
use clap::FromArgMatches;
use kerrlight_tomo::representation::Representation;
use std::ops::RangeInclusive;
use std::process::ExitCode;
use std::sync::OnceLock;

/// Makes a representation of its settings.
pub type BuildRepresentation = fn(&OwnSettings) -> anyhow::Result<Box<dyn Representation<f32>>>;

/// What a representation of one's own is told.
#[derive(Debug, Clone, PartialEq)]
pub struct OwnSettings {
    /// Least radius of the region of recovery, M.
    pub r_min: f64,
    /// Largest radius, M.
    pub r_max: f64,
    /// Largest |z|, M; infinite without one.
    pub z_width: f64,
    /// `representation.own` of the fit.
    pub table: toml::Table,
}

impl OwnSettings {
    /// A number of the settings: none has a default.
    ///
    /// # Errors
    /// If it is missing, no number, or out of range.
    pub fn number(&self, key: &str, allowed: RangeInclusive<f64>) -> anyhow::Result<f64> {
        let missing = || {
            anyhow!(
                "representation.own.{key} is missing: add `own = {{ {key} = … }}`, a number from {} to {}, to \
                 [representation]",
                allowed.start(),
                allowed.end()
            )
        };
        let value = self.table.get(key).ok_or_else(missing)?;
        let number = value.as_float().or(value.as_integer().map(|n| n as f64));
        let (low, high) = (allowed.start(), allowed.end());
        match number {
            Some(number) if allowed.contains(&number) => Ok(number),
            _ => bail!("representation.own.{key} = {value} is not allowed: {low} to {high}"),
        }
    }
}

/// `kerrlight` with representations of one's own.
#[derive(Default)]
pub struct Program {
    representations: Vec<(&'static str, BuildRepresentation)>,
}

static OWN: OnceLock<Vec<(&'static str, BuildRepresentation)>> = OnceLock::new();

impl Program {
    /// `kerrlight` as it is.
    pub fn new() -> Self {
        Self::default()
    }

    /// With a representation more: `representation.kind = \"name\"` in fits and experiments.
    #[must_use]
    pub fn representation(mut self, name: &'static str, build: BuildRepresentation) -> Self {
        self.representations.push((name, build));
        self
    }

    /// Does what the command line says; 0 is success, 2 an error, 1 a fit that failed while it ran or a comparison of which
    /// a part did, 128 and the number of the signal what a signal has stopped: 130 after Ctrl-C, 143 after SIGTERM.
    pub fn run(self) -> ExitCode {
        let matches = help::command().get_matches();
        let arguments = Arguments::from_arg_matches(&matches).unwrap_or_else(|error| error.exit());
        interrupt::listen();
        // Only the first program of a process counts: there is one command line.
        let _ = OWN.set(self.representations);
        match run(&arguments) {
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

/// A representation that was added.
pub fn own(name: &str, settings: &OwnSettings) -> anyhow::Result<Box<dyn Representation<f32>>> {
    let all = OWN.get().map(Vec::as_slice).unwrap_or_default();
    if let Some((_, build)) = all.iter().find(|(known, _)| *known == name) {
        return build(settings);
    }
    let own: String = all.iter().map(|(name, _)| format!(", {name}")).collect();
    bail!("representation.kind = {name:?} is not allowed: {}{own}", fit::representations())
}
