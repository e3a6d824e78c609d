//! Records: what made some files, from which, by which command, where and when. They lie beside what they describe, so
//! that outputs stay the same bytes on any machine and day.

use crate::checksum::{Sum, sealed};
use crate::output::{self, Output};
use crate::session;
use anyhow::{Context, bail};
use serde::{Deserialize, Serialize};
use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::time::{Instant, SystemTime, UNIX_EPOCH};

/// Its name in the folder of a run or of a comparison.
pub const FILE: &str = "record.json";

/// One run of the program.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Record {
    /// Version of the program.
    pub version: String,
    /// The command line, with the program's name.
    pub command: Vec<String>,
    /// The folder that it was given in.
    pub folder: PathBuf,
    /// The machine.
    host: String,
    /// Its kind.
    system: String,
    /// Threads of the pool.
    threads: usize,
    /// Seconds since 1970, UTC.
    started: f64,
    /// Until the record was written.
    seconds: f64,
    /// Files that were read.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub inputs: Vec<Entry>,
    /// Files that were written.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub outputs: Vec<Entry>,
}

/// A file, and what tells it from others.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Entry {
    /// Where it lies.
    pub path: PathBuf,
    /// Of its bytes.
    #[serde(flatten)]
    pub sum: Sum,
}

/// The record of this process, which began a moment ago.
pub struct Recorder {
    begun: Instant,
    started: f64,
    words: Vec<OsString>,
}

impl Recorder {
    /// Of the command line `words`.
    pub fn new(words: Vec<OsString>) -> Self {
        let since = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
        Self { begun: Instant::now(), started: since.as_secs_f64(), words }
    }

    /// Of this process, or of the call that it has.
    pub fn of_process() -> Self {
        Self::new(session::words())
    }

    /// Writes the record into the folder of what was made, which knows its inputs itself.
    pub fn write_into(&self, folder: &Path) -> anyhow::Result<()> {
        self.record(Vec::new(), Vec::new())?.write(&Output::new(&folder.join(FILE), "json")?)
    }

    /// Writes the record, with all files that were read and written since [`output::follow`].
    pub fn write(&self, to: &Output) -> anyhow::Result<()> {
        let (read, written) = output::followed();
        let inputs = read.into_iter().filter(|path| !written.contains(path)).collect();
        self.record(entries(inputs)?, entries(written)?)?.write(to)
    }

    /// With the name of the program, wherever it lies.
    fn command(&self) -> Vec<String> {
        let words = self.words.iter().skip(1).map(|word| word.to_string_lossy().into_owned());
        std::iter::once("kerrlight".to_owned()).chain(words).collect()
    }

    fn record(&self, inputs: Vec<Entry>, outputs: Vec<Entry>) -> anyhow::Result<Record> {
        Ok(Record {
            version: env!("CARGO_PKG_VERSION").to_owned(),
            command: self.command(),
            folder: std::path::absolute(".").context("the current folder")?,
            host: host(),
            system: format!("{} {}", std::env::consts::OS, std::env::consts::ARCH),
            threads: rayon::current_num_threads(),
            started: self.started,
            seconds: self.begun.elapsed().as_secs_f64(),
            inputs,
            outputs,
        })
    }
}

/// The name of this machine.
fn host() -> String {
    let name = std::fs::read_to_string("/proc/sys/kernel/hostname").ok();
    let name = name.or_else(|| std::env::var("HOSTNAME").ok()).unwrap_or_default();
    let plain = |c: char| if c.is_ascii_alphanumeric() || c == '-' { c } else { '-' };
    let name: String = name.trim().chars().take(40).map(plain).collect();
    if name.is_empty() { "host".to_owned() } else { name }
}

/// Files that are still there.
fn entries(paths: Vec<PathBuf>) -> anyhow::Result<Vec<Entry>> {
    let there = paths.into_iter().filter(|path| path.is_file());
    there.map(|path| Ok(Entry { sum: sum_of(&path)?, path })).collect()
}

/// The sum of a file of any size, empty ones included.
fn sum_of(path: &Path) -> anyhow::Result<Sum> {
    use std::io::Read;
    let name = || format!("cannot read {}", path.display());
    let mut file = std::fs::File::open(path).with_context(name)?;
    let (mut hasher, mut buffer, mut bytes) = (crc32fast::Hasher::new(), vec![0; 1 << 16], 0);
    loop {
        match file.read(&mut buffer).with_context(name)? {
            0 => break,
            read => {
                hasher.update(&buffer[..read]);
                bytes += read as u64;
            }
        }
    }
    Ok(Sum { bytes, crc32: format!("{:08x}", hasher.finalize()) })
}

impl Record {
    /// Of a file.
    ///
    /// # Errors
    /// If it is none, or damaged.
    pub fn load(path: &Path) -> anyhow::Result<Self> {
        let text = output::read_text(path)?;
        let shown = path.display();
        let record = serde_json::from_str(&text);
        let record = record.with_context(|| format!("{shown} is no record of kerrlight"))?;
        if !crate::checksum::is_whole(&text) {
            bail!("{shown} is damaged: its checksum is not that of its text");
        }
        Ok(record)
    }

    fn write(&self, to: &Output) -> anyhow::Result<()> {
        to.write(sealed(serde_json::to_value(self)?).as_bytes())
    }
}

impl Entry {
    /// What is wrong with the file now.
    pub fn fault(&self) -> Option<String> {
        let shown = self.path.display();
        match sum_of(&self.path) {
            Err(_) => Some(format!("{shown} is gone")),
            Ok(now) if now == self.sum => None,
            Ok(now) => {
                let Sum { bytes, crc32 } = &self.sum;
                Some(format!(
                    "{shown} has changed ({bytes} bytes, CRC-32 {crc32}; now {} bytes, CRC-32 {})",
                    now.bytes, now.crc32
                ))
            }
        }
    }
}
