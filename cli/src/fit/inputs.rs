//! Files that a run has read: one that is resumed reads the same, or is refused.

use crate::checksum::Sum;
use crate::file_sums::FileSums;
use crate::output;
use anyhow::{Context, bail};
use serde::{Deserialize, Serialize};
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

/// The settings in the folder of a run.
pub const SETTINGS: &str = "fit.toml";

/// Its own name there.
pub const FILE: &str = "inputs.json";

/// Reads the data of a run again: nothing but the files that it was begun with.
pub fn read_again<R>(run: &Path, read: impl FnOnce() -> anyhow::Result<R>) -> anyhow::Result<R> {
    let (found, all) = output::with_reads(read);
    let (found, inputs) = (found?, Inputs::load(run)?);
    // The same data may lie elsewhere now, as many files as before.
    let paths: BTreeSet<&PathBuf> = all.iter().map(|(path, _)| path).collect();
    let is_moved = paths.len() <= inputs.files.len();
    let is_known = |(path, sum): &&(PathBuf, Sum)| {
        inputs.holds(path) || is_moved && inputs.files.iter().any(|known| known.sum == *sum)
    };
    if let Some((other, _)) = all.iter().find(|read| !is_known(read)) {
        bail!(
            "{} is none of the files that {} was begun with: take it away, or start a new run with -o",
            other.display(),
            run.display()
        );
    }
    Ok(found)
}

/// Inputs that decide a run beside its seed: the version of the program, settings and files.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Inputs {
    /// Version of the program.
    pub version: String,
    /// Checksum of the settings in the run's folder.
    settings: Sum,
    /// All that was read.
    pub files: Vec<InputFile>,
}

/// A file that was read.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct InputFile {
    /// Path.
    path: PathBuf,
    #[serde(flatten)]
    sum: Sum,
}

impl Inputs {
    /// Takes a new run with these settings, which has read these files.
    pub fn new(settings: &str, read: Vec<(PathBuf, Sum)>) -> Self {
        let file = |(path, sum): (PathBuf, Sum)| {
            let path = std::path::absolute(&path).unwrap_or(path);
            InputFile { path, sum }
        };
        // The first image of a sequence is read once more for its size.
        let mut files: Vec<InputFile> = Vec::new();
        for file in read.into_iter().map(file) {
            if !files.contains(&file) {
                files.push(file);
            }
        }
        Inputs {
            version: env!("CARGO_PKG_VERSION").to_owned(),
            settings: Sum::of(settings.as_bytes()),
            files,
        }
    }

    /// Returns whether a file is among those that were read.
    pub fn holds(&self, file: &Path) -> bool {
        std::path::absolute(file).is_ok_and(|file| self.files.iter().any(|of| of.path == file))
    }

    /// Reads those of the run in a folder.
    pub fn load(run: &Path) -> anyhow::Result<Self> {
        let path = run.join(FILE);
        let name = || format!("{}: it is damaged; start a new run with -o", path.display());
        serde_json::from_str(&output::read_text(&path)?).with_context(name)
    }

    /// Refuses what would make another run of it.
    pub fn check(&self, run: &Path, sums: &mut FileSums) -> anyhow::Result<()> {
        let (shown, version) = (run.display(), env!("CARGO_PKG_VERSION"));
        if self.version != version {
            bail!(
                "{shown} was begun by kerrlight {}, and this is {version}: resume it with that, or start a new run with -o",
                self.version
            );
        }
        self.check_files(run, sums)?;
        if sums.of(&run.join(SETTINGS))? != self.settings {
            bail!(
                "{shown}/{SETTINGS} was changed or damaged since the run began: restore it, or start a new run with -o"
            );
        }
        Ok(())
    }

    /// Refuses files that are not what they were.
    pub fn check_files(&self, run: &Path, sums: &mut FileSums) -> anyhow::Result<()> {
        for InputFile { path, sum } in &self.files {
            let shown = path.display();
            let run = run.display();
            let now = sums.of(path).with_context(|| format!("{run} has read {shown}"))?;
            if now != *sum {
                bail!(
                    "{shown} has changed since {run} was begun ({} bytes, CRC-32 {}; now {} bytes, CRC-32 {}): restore it, or start a new run with -o",
                    sum.bytes,
                    sum.crc32,
                    now.bytes,
                    now.crc32
                );
            }
        }
        Ok(())
    }
}
