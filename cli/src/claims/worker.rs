//! This process as a worker: a record that a thread renews for as long as the process works.

use super::record::{EXTENSION, Process, Record, host};
use crate::threads;
use anyhow::{Context, bail};
use std::hash::{BuildHasher, Hasher, RandomState};
use std::path::{Path, PathBuf};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;
use std::time::Duration;

/// Seconds between renewals, unless the environment says something else.
const EVERY_S: f64 = 10.0;
/// The variable that does, for file systems whose caches are slow.
const VARIABLE: &str = "KERRLIGHT_RENEW_SECONDS";

/// A worker; its record is removed when it leaves.
pub struct Worker {
    path: PathBuf,
    record: Arc<Mutex<Record>>,
    /// A word has the record renewed at once; when this is dropped, it no longer is.
    now: Option<Sender<()>>,
    thread: Option<JoinHandle<()>>,
}

impl Worker {
    /// Writes the first record and starts to renew it.
    pub fn start(folder: &Path) -> anyhow::Result<Self> {
        let every_s = interval(std::env::var(VARIABLE).ok().as_deref())?;
        let (host, process) = (host(), Process::this());
        let word = RandomState::new().build_hasher().finish() as u32;
        let worker = format!("{host}_{}_{word:08x}", process.id);
        let path = folder.join(format!("{worker}.{EXTENSION}"));
        let (piece, beat, done, failed, seconds) = (None, 0, 0, 0, 0.0);
        let record = Record { worker, host, process, every_s, beat, piece, done, failed, seconds };
        write(&path, &record).with_context(|| format!("cannot write {}", path.display()))?;
        let record = Arc::new(Mutex::new(record));
        let (now, wanted) = channel();
        let thread = {
            let (path, record) = (path.clone(), Arc::clone(&record));
            threads::spawn(move || renew(&path, &record, every_s, &wanted))
        };
        // Its record goes with it if it cannot be renewed.
        let mut worker = Self { path, record, now: Some(now), thread: None };
        worker.thread = Some(thread?);
        Ok(worker)
    }

    /// Its name.
    pub fn name(&self) -> &str {
        self.path.file_stem().and_then(|stem| stem.to_str()).unwrap_or_default()
    }

    /// Where its record is.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Its record as text.
    pub fn text(&self) -> String {
        serde_json::to_string(&*locked(&self.record)).unwrap_or_default()
    }

    /// What it works on, which others see at once.
    pub fn works_on(&self, piece: Option<&str>) {
        let before = std::mem::replace(&mut locked(&self.record).piece, piece.map(str::to_owned));
        if before.as_deref() != piece
            && let Some(now) = &self.now
        {
            let _ = now.send(());
        }
    }

    /// A piece more has come to its end.
    pub fn ended(&self, seconds: f64, has_failed: bool) {
        let mut record = locked(&self.record);
        record.done += u64::from(!has_failed);
        record.failed += u64::from(has_failed);
        record.seconds += seconds;
    }
}

impl Drop for Worker {
    fn drop(&mut self) {
        drop(self.now.take());
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
        let _ = std::fs::remove_file(&self.path);
    }
}

fn locked(record: &Mutex<Record>) -> MutexGuard<'_, Record> {
    record.lock().unwrap_or_else(PoisonError::into_inner)
}

/// The interval that the environment gives, or the usual one.
fn interval(given: Option<&str>) -> anyhow::Result<f64> {
    let Some(text) = given else { return Ok(EVERY_S) };
    match text.trim().parse::<f64>() {
        Ok(seconds) if (0.01..=3600.0).contains(&seconds) => Ok(seconds),
        _ => bail!("{VARIABLE}={text} is not allowed: 0.01 to 3600"),
    }
}

/// Renews a record until its worker leaves. What cannot be written now is written the next time: others wait for
/// several times the interval.
fn renew(path: &Path, record: &Mutex<Record>, every_s: f64, wanted: &Receiver<()>) {
    let every = Duration::from_secs_f64(every_s);
    while wanted.recv_timeout(every) != Err(RecvTimeoutError::Disconnected) {
        let now = {
            let mut record = locked(record);
            record.beat += 1;
            record.clone()
        };
        let _ = write(path, &now);
    }
}

/// Beside its place and then there: claims are links to the first record and keep it.
fn write(path: &Path, record: &Record) -> std::io::Result<()> {
    let beside = path.with_extension("new");
    std::fs::write(&beside, serde_json::to_string(record)?)?;
    std::fs::rename(&beside, path)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exact_intervals_have_a_range() {
        assert_eq!(interval(None).unwrap(), EVERY_S);
        assert_eq!(interval(Some(" 0.5")).unwrap(), 0.5);
        for wrong in ["0", "-1", "nan", "ten", "1e9"] {
            let error = interval(Some(wrong)).unwrap_err().to_string();
            assert!(error.contains(VARIABLE) && error.contains("0.01 to 3600"), "{error}");
        }
    }
}
