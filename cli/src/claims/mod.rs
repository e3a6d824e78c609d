//! Pieces of work in a folder that several processes share: each piece is taken by one of them, and by another if that
//! one dies. Nothing is assumed but a file system on which creating a name either succeeds or finds it taken.
//!
//! A piece is taken by a hard link `PIECE.0` to the worker's own record, so that the claim appears whole, with its
//! owner in it. Claims are never removed or changed. Whoever takes over from a dead worker creates `PIECE.1`: of all
//! claims the highest number counts, and two that see the same death cannot both create it. `PIECE.done` and
//! `PIECE.failed` end a piece, `PIECE.0.free` says that its owner has given it back.
//!
//! Workers renew their records. A worker is dead if its process is gone, where that can be seen, or if its record has
//! not changed for several times the interval that it promises. This is measured by the clock of whoever waits, so
//! that clocks of machines may differ.

mod board;
mod queue;
mod record;
#[cfg(test)]
mod tests;
mod watch;
mod worker;

pub use board::Board;
pub use queue::Queue;
pub use record::{Record, host};
pub use watch::Watch;

use anyhow::Context;
use std::fs::File;
use std::io::{ErrorKind, Write};
use std::path::{Path, PathBuf};
use worker::Worker;

/// The folder of claims and that of records, in the shared one.
const CLAIMS: &str = "claims";
const WORKERS: &str = "workers";

/// A process that takes pieces of a shared folder.
pub struct Claims {
    folder: PathBuf,
    worker: Worker,
}

/// A piece that this process has taken.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Claim {
    /// Name of the piece.
    pub piece: String,
    /// How often it was taken before.
    pub turn: u32,
}

impl Claims {
    /// Joins those who work on a folder, which is made if there is none.
    pub fn join(folder: &Path) -> anyhow::Result<Self> {
        for name in [CLAIMS, WORKERS] {
            let path = folder.join(name);
            std::fs::create_dir_all(&path)
                .with_context(|| format!("cannot make the folder {}", path.display()))?;
        }
        let worker = Worker::start(&folder.join(WORKERS))?;
        Ok(Self { folder: folder.to_owned(), worker })
    }

    /// The name of this process among those that share the folder.
    pub fn name(&self) -> &str {
        self.worker.name()
    }

    /// Takes a piece for the time `turn` (0 is the first), unless another process already has.
    pub fn take(&self, piece: &str, turn: u32) -> anyhow::Result<Option<Claim>> {
        let path = self.at(&format!("{piece}.{turn}"));
        let is_ours = self.create(&path).with_context(|| format!("cannot claim {piece}"))?;
        // It may have been done since this process looked.
        let is_open = is_ours && !self.at(&format!("{piece}.done")).exists();
        Ok(is_open.then(|| Claim { piece: piece.to_owned(), turn }))
    }

    /// Whether nobody has taken a piece over from this process.
    pub fn holds(&self, claim: &Claim) -> bool {
        !self.at(&format!("{}.{}", claim.piece, claim.turn + 1)).exists()
    }

    /// Says that a piece is done.
    pub fn done(&self, claim: &Claim, seconds: f64) -> anyhow::Result<()> {
        self.worker.ended(seconds, false);
        self.mark(&format!("{}.done", claim.piece))
    }

    /// Says that a piece was done before it was shared.
    pub fn done_before(&self, piece: &str) -> anyhow::Result<()> {
        self.mark(&format!("{piece}.done"))
    }

    /// Says that a piece failed, and why.
    pub fn failed(&self, claim: &Claim, why: &str) -> anyhow::Result<()> {
        self.worker.ended(0.0, true);
        let path = self.at(&format!("{}.failed", claim.piece));
        crate::output::Output::new(&path, "")?.write(why.as_bytes())
    }

    /// Gives a piece back: any process may take it.
    pub fn free(&self, claim: &Claim) -> anyhow::Result<()> {
        self.mark(&format!("{}.{}.free", claim.piece, claim.turn))
    }

    /// What others see of this process: the piece it works on.
    pub fn works_on(&self, piece: Option<&str>) {
        self.worker.works_on(piece);
    }

    fn at(&self, name: &str) -> PathBuf {
        self.folder.join(CLAIMS).join(name)
    }

    fn mark(&self, name: &str) -> anyhow::Result<()> {
        self.create(&self.at(name)).map(drop).with_context(|| format!("cannot mark {name}"))
    }

    /// Creates a name with this worker's record in it; false if the name is another's.
    fn create(&self, path: &Path) -> std::io::Result<bool> {
        match std::fs::hard_link(self.worker.path(), path) {
            Ok(()) => Ok(true),
            // A network file system may repeat a request whose answer was lost, and then report what it did itself.
            Err(error) if error.kind() == ErrorKind::AlreadyExists => Ok(self.is_ours(path)),
            // No hard links, or too many of them to one file.
            Err(_) => self.create_without_link(path),
        }
    }

    fn create_without_link(&self, path: &Path) -> std::io::Result<bool> {
        match File::create_new(path) {
            Ok(mut file) => {
                file.write_all(self.worker.text().as_bytes())?;
                Ok(true)
            }
            Err(error) if error.kind() == ErrorKind::AlreadyExists => Ok(self.is_ours(path)),
            Err(error) => Err(error),
        }
    }

    fn is_ours(&self, path: &Path) -> bool {
        Record::load(path).is_some_and(|record| record.worker == self.name())
    }
}

/// Those who have worked on a shared folder and have not left it.
pub fn workers(folder: &Path) -> Vec<Record> {
    let entries = std::fs::read_dir(folder.join(WORKERS)).into_iter().flatten().flatten();
    let is_record = |path: &PathBuf| path.extension().is_some_and(|e| e == record::EXTENSION);
    let paths = entries.map(|entry| entry.path()).filter(is_record);
    let mut all: Vec<Record> = paths.filter_map(|path| Record::load(&path)).collect();
    all.sort_by(|a, b| a.worker.cmp(&b.worker));
    all
}

/// Why a piece failed.
pub fn reason(folder: &Path, piece: &str) -> String {
    let path = folder.join(CLAIMS).join(format!("{piece}.failed"));
    std::fs::read_to_string(path).unwrap_or_else(|error| error.to_string())
}
