//! `kerrlight completions`: completion scripts for shells.

use crate::Arguments;
use crate::answer::Answer;
use clap::{Args, CommandFactory};
use clap_complete::Shell;

/// Arguments of `kerrlight completions`.
#[derive(Debug, Args)]
pub struct Completions {
    /// The shell that reads the script
    shell: Shell,
}

impl Completions {
    /// The script.
    pub fn run(&self) -> anyhow::Result<Answer> {
        let mut script = Vec::new();
        clap_complete::generate(self.shell, &mut Arguments::command(), "kerrlight", &mut script);
        let script = String::from_utf8(script)?;
        Ok(Answer::text(script.as_str())
            .with("shell", self.shell.to_string())
            .with("script", script))
    }
}
