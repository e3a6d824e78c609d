//! The folder of a run: settings, log, checkpoint, results.

use crate::output::{self, Output};
use anyhow::{Context, bail};
use serde_json::Value;
use std::fs::OpenOptions;
use std::io::Write;
use std::path::{Path, PathBuf};

/// A run's folder.
pub struct Folder {
    path: PathBuf,
}

/// Names in it.
pub const SETTINGS: &str = "fit.toml";
pub const LOG: &str = "log.jsonl";
const CHECKPOINT: &str = "checkpoint.safetensors";

impl Folder {
    /// A new folder.
    pub fn create(path: &Path, settings: &str) -> anyhow::Result<Self> {
        let shown = path.display();
        if path.exists() && std::fs::read_dir(path).map_or(true, |mut all| all.next().is_some()) {
            bail!(
                "{shown} exists and is not an empty folder: go on with --resume, or give another with -o"
            );
        }
        std::fs::create_dir_all(path).with_context(|| format!("cannot make the folder {shown}"))?;
        let folder = Self { path: path.to_owned() };
        folder.file(SETTINGS)?.write(settings.as_bytes())?;
        Ok(folder)
    }

    /// A folder that holds a run.
    pub fn open(path: &Path) -> anyhow::Result<(Self, String)> {
        let settings = path.join(SETTINGS);
        if !settings.is_file() {
            bail!("{} holds no run: there is no {SETTINGS} in it", path.display());
        }
        Ok((Self { path: path.to_owned() }, output::read_text(&settings)?))
    }

    /// Where it is.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// A file in it, to be written whole.
    pub fn file(&self, name: &str) -> anyhow::Result<Output> {
        Output::new(&self.path.join(name), "")
    }

    /// The last checkpoint, if there is one.
    pub fn checkpoint(&self) -> anyhow::Result<Option<Vec<u8>>> {
        let path = self.path.join(CHECKPOINT);
        if !path.exists() {
            return Ok(None);
        }
        output::read(&path).map(Some)
    }

    /// Writes a checkpoint in place of the last one.
    pub fn save(&self, bytes: &[u8]) -> anyhow::Result<()> {
        self.file(CHECKPOINT)?.write(bytes)
    }

    /// Adds a line to the log.
    pub fn log(&self, line: &Value) -> anyhow::Result<()> {
        let path = self.path.join(LOG);
        let name = || format!("cannot write {}", path.display());
        let file = OpenOptions::new().create(true).append(true).open(&path);
        let mut file = file.with_context(name)?;
        file.write_all(format!("{line}\n").as_bytes()).with_context(name)
    }

    /// The lines of the log.
    pub fn lines(&self) -> anyhow::Result<Vec<Value>> {
        let path = self.path.join(LOG);
        if !path.exists() {
            return Ok(Vec::new());
        }
        // A line that a kill has cut short is none.
        let whole = |line: &str| serde_json::from_str(line).ok();
        Ok(output::read_text(&path)?.lines().filter_map(whole).collect())
    }

    /// Drops what was logged after a step: it will be done again.
    pub fn cut_log(&self, step: u64) -> anyhow::Result<()> {
        let kept = |line: &Value| line["step"].as_u64().is_some_and(|s| s <= step);
        let lines: String =
            self.lines()?.iter().filter(|l| kept(l)).map(|line| format!("{line}\n")).collect();
        self.file(LOG)?.write(lines.as_bytes())
    }
}
