//! `kerrlight reproduce`: the command that makes a file or folder once more, and whether its inputs are as they were.

mod origin;

use crate::answer::Answer;
use clap::Args;
use origin::Origin;
use std::path::PathBuf;

/// Arguments of `kerrlight reproduce`.
#[derive(Debug, Args)]
pub struct Reproduce {
    /// Folder of a fit or of a comparison, a file in it, a picture (EXR), a record (.json), or a file whose
    /// record lies beside it
    #[arg(value_name = "FILE")]
    file: PathBuf,
}

/// Inputs are not what they were; the command was printed.
#[derive(Debug, thiserror::Error)]
#[error("it cannot be reproduced: {0}")]
pub struct Changed(String);

impl Reproduce {
    /// Prints the command, and fails if inputs have changed.
    pub fn run(&self) -> anyhow::Result<Answer> {
        let Origin { command, folder, version, inputs, faults } = Origin::of(&self.file)?;
        let is_ours = version == env!("CARGO_PKG_VERSION");
        if !is_ours {
            eprintln!("note: it was made by kerrlight {version}: another version may differ");
        }
        let line = words(&command);
        let text = match &folder {
            Some(folder) => format!("cd {} && {line}\n", quoted(&folder.display().to_string())),
            None => format!("{line}\n"),
        };
        let answer = Answer::text(text)
            .with("command", command)
            .with("folder", folder.map(|folder| folder.display().to_string()))
            .with("version", version)
            .with("inputs", inputs)
            .with("changed", faults.clone());
        if faults.is_empty() {
            eprintln!("{inputs} inputs are as they were");
            return Ok(answer);
        }
        Ok(answer.failing(Changed(faults.join("; "))))
    }
}

/// A command line, as a shell reads it.
fn words(command: &[String]) -> String {
    command.iter().map(|word| quoted(word)).collect::<Vec<_>>().join(" ")
}

fn quoted(word: &str) -> String {
    let plain = |c: char| c.is_ascii_alphanumeric() || "-_./=,:@%+".contains(c);
    if !word.is_empty() && word.chars().all(plain) {
        return word.to_owned();
    }
    format!("'{}'", word.replace('\'', r"'\''"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exact_words_come_back_from_a_shell() {
        let command = ["kerrlight", "--set", "axis={known={}}", "it's", ""].map(str::to_owned);
        assert_eq!(words(&command), r"kerrlight --set 'axis={known={}}' 'it'\''s' ''");
    }
}
