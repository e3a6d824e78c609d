//! What a worker tells of itself.

use serde::{Deserialize, Serialize};
use std::path::Path;

/// How records end.
pub const EXTENSION: &str = "json";

/// A worker's record, which it renews.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Record {
    /// Its name: host, process and a random word.
    pub worker: String,
    /// The machine it runs on.
    pub host: String,
    /// Its process.
    pub process: Process,
    /// It renews the record at least so often, seconds.
    pub every_s: f64,
    /// How often it has done so.
    pub beat: u64,
    /// The piece that it works on.
    pub piece: Option<String>,
    /// Pieces that it has done, and those that failed.
    pub done: u64,
    /// See `done`.
    pub failed: u64,
    /// Seconds that the pieces it has done took.
    pub seconds: f64,
}

/// A process among all that run on any machine, where the system tells so much.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Process {
    /// Its number.
    pub id: u32,
    /// When it started, in ticks since the machine did.
    started: Option<u64>,
    /// The run of the machine, and the name space of its numbers.
    machine: Option<String>,
}

impl Record {
    /// Of a file; nothing if there is none, or something else in it.
    pub fn load(path: &Path) -> Option<Self> {
        serde_json::from_str(&std::fs::read_to_string(path).ok()?).ok()
    }
}

impl Process {
    /// This one.
    pub fn this() -> Self {
        let id = std::process::id();
        Self { id, started: started(id), machine: machine() }
    }

    /// Whether it has ended; nothing where that cannot be seen from here.
    pub fn has_ended(&self) -> Option<bool> {
        let known = self.machine.is_some() && self.started.is_some() && self.machine == machine();
        if !known {
            return None;
        }
        match started(self.id) {
            None if is_hidden(self.id) => None,
            now => Some(now != self.started),
        }
    }
}

/// Whether there is such a process of another user, of whom the system tells nothing more.
#[cfg(unix)]
fn is_hidden(id: u32) -> bool {
    use nix::errno::Errno;
    use nix::sys::signal::kill;
    use nix::unistd::Pid;
    kill(Pid::from_raw(id as i32), None) == Err(Errno::EPERM)
}

#[cfg(not(unix))]
fn is_hidden(_: u32) -> bool {
    true
}

/// When a process started; nothing if there is none, or if only its exit code is left of it.
fn started(id: u32) -> Option<u64> {
    let text = std::fs::read_to_string(format!("/proc/{id}/stat")).ok()?;
    // The name of the program, in brackets, may have blanks and brackets in it.
    let mut fields = text.get(text.rfind(')')? + 1..)?.split_whitespace();
    let state = fields.next()?;
    if matches!(state, "Z" | "X") {
        return None;
    }
    fields.nth(18)?.parse().ok()
}

/// What numbers of processes belong to: the present run of this machine, and their name space.
fn machine() -> Option<String> {
    let boot = std::fs::read_to_string("/proc/sys/kernel/random/boot_id").ok()?;
    let space = std::fs::read_link("/proc/self/ns/pid").ok()?;
    Some(format!("{} {}", boot.trim(), space.display()))
}

/// The name of this machine.
pub fn host() -> String {
    let name = std::fs::read_to_string("/proc/sys/kernel/hostname").ok();
    let name = name.or_else(|| std::env::var("HOSTNAME").ok()).unwrap_or_default();
    let plain = |c: char| if c.is_ascii_alphanumeric() || c == '-' { c } else { '-' };
    let name: String = name.trim().chars().take(40).map(plain).collect();
    if name.is_empty() { "host".to_owned() } else { name }
}
