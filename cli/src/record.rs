//! Records: what made some files, from which, by which command, where and when. They lie beside what they describe, so
//! that outputs stay the same bytes on any machine and day.

use crate::checksum::sealed;
use crate::output::Output;
use crate::session;
use anyhow::Context;
use serde_json::{Value, json};
use std::ffi::OsString;
use std::path::Path;
use std::time::{Instant, SystemTime, UNIX_EPOCH};

/// Its name in the folder of a run or of a comparison.
pub const FILE: &str = "record.json";

/// The record of this process, which began a moment ago.
pub struct Recorder {
    begun: Instant,
    started: f64,
    words: Vec<OsString>,
}

impl Recorder {
    /// Records the command line `words`.
    pub fn new(words: Vec<OsString>) -> Self {
        let since = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
        Self { begun: Instant::now(), started: since.as_secs_f64(), words }
    }

    /// Records this process, or the call that it has.
    pub fn of_process() -> Self {
        Self::new(session::words())
    }

    /// Writes the record into the folder of what was made, which knows its inputs itself.
    pub fn write_into(&self, folder: &Path) -> anyhow::Result<()> {
        let record = sealed(self.record()?);
        Output::new(&folder.join(FILE), "json")?.write(record.as_bytes())
    }

    /// Returns the command with the name of the program, wherever it lies.
    fn command(&self) -> Vec<String> {
        let words = self.words.iter().skip(1).map(|word| word.to_string_lossy().into_owned());
        std::iter::once("kerrlight".to_owned()).chain(words).collect()
    }

    /// Times are seconds: since 1970, UTC, and from there until now.
    fn record(&self) -> anyhow::Result<Value> {
        let folder = std::path::absolute(".").context("the current folder")?;
        Ok(json!({
            "version": env!("CARGO_PKG_VERSION"),
            "command": self.command(),
            "folder": serde_json::to_value(folder)?,
            "host": host(),
            "system": format!("{} {}", std::env::consts::OS, std::env::consts::ARCH),
            "threads": rayon::current_num_threads(),
            "started": self.started,
            "seconds": self.begun.elapsed().as_secs_f64(),
        }))
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
