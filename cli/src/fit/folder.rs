//! The folder of a run: settings, log, checkpoint, results.

use super::inputs::{self, Inputs, SETTINGS};
use crate::answer::Answer;
use crate::checksum::{Sealed, is_whole, sealed};
use crate::file_sums::FileSums;
use crate::lock::Lock;
use crate::output::{self, Output};
use crate::plain;
use crate::session;
use anyhow::{Context, bail};
use serde::Serialize;
use serde::de::DeserializeOwned;
use serde_json::Value;
use std::fs::OpenOptions;
use std::io::{ErrorKind, Write};
use std::path::{Path, PathBuf};
use std::time::Duration;

/// A run's folder, which no other process may work in.
pub struct Folder {
    path: PathBuf,
    /// The text of its settings.
    pub settings: String,
    /// Files that the run has read.
    pub inputs: Inputs,
    /// True if the run was begun before.
    pub is_resumed: bool,
    _lock: Option<Lock>,
}

/// Names in it.
pub const LOG: &str = "log.jsonl";
pub const CHECKPOINT: &str = "checkpoint.safetensors";

/// Files that a run writes in the formats of data.
const RESULTS: [&str; 14] = [
    "movie.npz",
    "volume.npz",
    "truth.npz",
    "quiescent.npz",
    "scene.npz",
    "image.npz",
    "image.fits",
    "draws.npz",
    "light_curve.csv",
    "emission.csv",
    "axis_scan.csv",
    "gains.csv",
    "leakage.csv",
    "quiescent.exr",
];

/// Words for another process in a folder.
const BUSY: &str = "fits in";

impl Folder {
    /// A new folder, in which the data may lie.
    pub fn create(path: &Path, settings: &str, inputs: Inputs) -> anyhow::Result<Self> {
        let is_data = |file: &Path| inputs.holds(file);
        // Those of further files have numbers.
        let of_files = (2..=inputs.files.len())
            .flat_map(|k| ["gains", "leakage"].map(|name| format!("{name}_{k}.csv")));
        let names = RESULTS.iter().map(|name| (*name).to_owned()).chain(of_files);
        if let Some(name) = names.into_iter().find(|name| is_data(&path.join(name))) {
            bail!(
                "{} is read, and the run writes a file of that name: give another folder with -o",
                path.join(name).display()
            );
        }
        // What a run has left that was cut off before it had settings is nothing.
        let is_begun = path.join(SETTINGS).exists();
        let is_left = |file: &Path| {
            let name = file.file_name().unwrap_or_default().to_string_lossy();
            !is_begun && (name == inputs::FILE || name.starts_with(output::BESIDE))
        };
        let lock = Lock::of_new(path, BUSY, SETTINGS, |file| is_data(file) || is_left(file))?;
        let (path, settings) = (path.to_owned(), settings.to_owned());
        let folder = Self { path, settings, inputs, is_resumed: false, _lock: Some(lock) };
        let inputs = serde_json::to_string_pretty(&folder.inputs)?;
        folder.file(inputs::FILE)?.write(format!("{inputs}\n").as_bytes())?;
        // Last: with them it is a run.
        folder.file(SETTINGS)?.write(folder.settings.as_bytes())?;
        Ok(folder)
    }

    /// A new folder that nobody has named: kerrlight-fit, or the first of kerrlight-fit-2, -3 … that does not exist.
    /// Fits that start at once get one each, for the system lets only one of them make it.
    pub fn unnamed() -> anyhow::Result<PathBuf> {
        for k in 1u32.. {
            let path = PathBuf::from(match k {
                1 => "kerrlight-fit".to_owned(),
                k => format!("kerrlight-fit-{k}"),
            });
            match std::fs::create_dir(&path) {
                Ok(()) => return Ok(path),
                Err(error) if error.kind() == ErrorKind::AlreadyExists => {}
                Err(error) => {
                    return Err(error)
                        .with_context(|| format!("cannot make the folder {}", path.display()));
                }
            }
        }
        bail!("every folder kerrlight-fit-N exists: name one with -o")
    }

    /// A folder that holds a run, within `patience` if another process works in it; all that the run has read must be
    /// what it was.
    pub fn open(path: &Path, patience: Duration) -> anyhow::Result<Self> {
        is_run(path)?;
        let lock = Lock::take(path, BUSY, patience)?;
        // With the lock held nobody else writes here: every hidden file is a leftover.
        output::sweep(path, |_| true);
        Self::held(path, Some(lock))
    }

    /// The same while another process works in it, by whose leave this one reads.
    pub fn look(path: &Path) -> anyhow::Result<Self> {
        is_run(path)?;
        Self::held(path, None)
    }

    fn held(path: &Path, lock: Option<Lock>) -> anyhow::Result<Self> {
        let inputs = Inputs::load(path)?;
        inputs.check(path, &mut FileSums::default())?;
        let settings = output::read_text(&path.join(SETTINGS))?;
        Ok(Self { path: path.to_owned(), settings, inputs, is_resumed: true, _lock: lock })
    }

    /// Returns its path.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// The last lines of a run: a figure of merit, and the first of these files; all of them and the results for a script.
    pub fn answer(&self, worth: &str, results: Value, names: &[&str]) -> Answer {
        let files: Vec<PathBuf> = names.iter().map(|name| self.path.join(name)).collect();
        Answer::lines(worth, &files[0].display().to_string())
            .with_all(results)
            .with("folder", self.path.display().to_string())
            .files(files.iter().map(PathBuf::as_path))
    }

    /// A file in it, to be written whole, that is none of those which the run has read.
    pub fn file(&self, name: &str) -> anyhow::Result<Output> {
        let path = self.path.join(name);
        if self.inputs.holds(&path) {
            bail!(
                "{} was read by this run and would be lost: begin again with -o in another folder",
                path.display()
            );
        }
        Output::new(&path, "")
    }

    /// The last checkpoint, if there is one.
    pub fn checkpoint(&self) -> anyhow::Result<Option<Vec<u8>>> {
        let path = self.path.join(CHECKPOINT);
        if !path.exists() {
            return Ok(None);
        }
        output::read(&path).map(Some)
    }

    /// Keeps what a search has found in a file.
    pub fn keep(&self, name: &str, found: &impl Serialize) -> anyhow::Result<()> {
        self.file(name)?.write(sealed(serde_json::to_value(found)?).as_bytes())
    }

    /// Reads the results of a search from a file; none if it has not looked.
    pub fn found<T: DeserializeOwned>(&self, name: &str) -> anyhow::Result<Option<Sealed<T>>> {
        let path = self.path.join(name);
        if !path.exists() {
            return Ok(None);
        }
        let text = output::read_text(&path)?;
        if !is_whole(&text) {
            bail!(self.damaged(name));
        }
        serde_json::from_str(&text).map(Some).with_context(|| self.damaged(name))
    }

    /// Says of such a file that it is not what a search keeps.
    pub fn damaged(&self, name: &str) -> String {
        format!("{} is damaged: remove it to look again", self.path.join(name).display())
    }

    /// Adds a line to the log.
    pub fn log(&self, line: &Value) -> anyhow::Result<()> {
        let path = self.path.join(LOG);
        let name = || format!("cannot write {}", path.display());
        let file = OpenOptions::new().create(true).append(true).open(&path);
        let mut file = file.with_context(name)?;
        file.write_all(format!("{line}\n").as_bytes()).with_context(name)?;
        session::log(line);
        Ok(())
    }

    /// Explains what to do about work that was interrupted and is kept.
    pub fn stopped(&self) -> String {
        let folder = plain::word(&self.path);
        format!("stopped; resume with: kerrlight fit --resume {folder}")
    }

    /// The lines of the log.
    pub fn lines(&self) -> anyhow::Result<Vec<Value>> {
        let path = self.path.join(LOG);
        if !path.exists() {
            return Ok(Vec::new());
        }
        // A line that a kill has cut short is none.
        let whole = |line: &str| serde_json::from_str(line).ok();
        Ok(output::read_log(&path)?.lines().filter_map(whole).collect())
    }

    /// Drops what was logged after a step: it will be done again.
    pub fn cut_log(&self, step: u64) -> anyhow::Result<()> {
        let kept = |line: &Value| line["step"].as_u64().is_some_and(|s| s <= step);
        let lines: String =
            self.lines()?.iter().filter(|l| kept(l)).map(|line| format!("{line}\n")).collect();
        self.file(LOG)?.write(lines.as_bytes())
    }
}

fn is_run(path: &Path) -> anyhow::Result<()> {
    if !path.join(SETTINGS).is_file() {
        bail!("{} holds no run: there is no {SETTINGS} in it", path.display());
    }
    Ok(())
}
