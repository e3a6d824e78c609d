//! Whether other workers live.

use super::record::{EXTENSION, Record};
use super::{CLAIMS, WORKERS};
use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

/// A record that has not changed for so many of its intervals is of a dead worker.
const INTERVALS: f64 = 6.0;
/// The interval of a worker whose record cannot be read, seconds.
const UNKNOWN_S: f64 = 10.0;

/// What was seen of other workers, and since when by the clock of this process.
pub struct Watch {
    folder: PathBuf,
    seen: HashMap<String, Seen>,
    /// Owners of claims, which do not change.
    owners: HashMap<(String, u32), String>,
}

struct Seen {
    record: Option<Record>,
    since: Instant,
}

impl Watch {
    /// Of those who work on a folder.
    pub fn new(folder: &Path) -> Self {
        Self { folder: folder.to_owned(), seen: HashMap::new(), owners: HashMap::new() }
    }

    /// Whether whoever took a piece for the time `turn` is dead, as far as is known yet.
    pub fn is_abandoned(&mut self, piece: &str, turn: u32) -> bool {
        let key = (piece.to_owned(), turn);
        let owner = match self.owners.get(&key) {
            Some(owner) => owner.clone(),
            None => {
                let claim = self.folder.join(CLAIMS).join(format!("{piece}.{turn}"));
                match Record::load(&claim) {
                    Some(record) => {
                        self.owners.insert(key, record.worker.clone());
                        record.worker
                    }
                    // Without hard links a claim is empty for a moment, or for ever if its worker died in it.
                    None => format!("{piece}.{turn}"),
                }
            }
        };
        self.is_dead(&owner)
    }

    /// Whether a worker is dead, as far as is known yet.
    pub fn is_dead(&mut self, worker: &str) -> bool {
        let path = self.folder.join(WORKERS).join(format!("{worker}.{EXTENSION}"));
        let record = Record::load(&path);
        if let Some(ended) = record.as_ref().and_then(|record| record.process.has_ended()) {
            return ended;
        }
        let new = || Seen { record: record.clone(), since: Instant::now() };
        let seen = self.seen.entry(worker.to_owned()).or_insert_with(new);
        if seen.record != record {
            *seen = new();
        }
        seen.since.elapsed() > patience(seen.record.as_ref())
    }
}

/// For how long a record may stay as it is.
fn patience(record: Option<&Record>) -> Duration {
    let every = record.map_or(UNKNOWN_S, |record| record.every_s);
    Duration::from_secs_f64(INTERVALS * every.clamp(0.01, 3600.0))
}
