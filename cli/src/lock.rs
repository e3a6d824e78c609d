//! A folder that one process at a time works in.

use anyhow::{Context, bail, ensure};
use std::fs::{File, OpenOptions, TryLockError};
use std::path::Path;
use std::time::{Duration, Instant};

/// The name of the file that is locked. It stays behind: the lock is the system's, and ends with its process.
pub const NAME: &str = "lock";

/// A folder's lock, for as long as this lives.
pub struct Lock(#[expect(dead_code, reason = "it is held, not read")] File);

impl Lock {
    /// Shares a folder with others who do the same, and with nobody else, as far as the file system has locks.
    pub fn share(folder: &Path, busy: &str, patience: Duration) -> anyhow::Result<Self> {
        Self::by(File::try_lock_shared, folder, busy, patience)
    }

    /// Takes the lock of a folder that is new or empty but for what `is_own` knows; it is made if there is none. Of
    /// several processes that want the same one, a single one gets it. What can be resumed holds a file `begun`.
    pub fn of_new(
        folder: &Path,
        busy: &str,
        begun: &str,
        is_own: impl Fn(&Path) -> bool,
    ) -> anyhow::Result<Self> {
        let is_free = || {
            let is_begun = folder.join(begun).exists();
            let resume = if is_begun { "resume it with --resume, or " } else { "" };
            ensure!(
                is_free(folder, &is_own),
                "{} exists and is not an empty folder: {resume}give another with -o",
                folder.display()
            );
            Ok(())
        };
        is_free()?;
        std::fs::create_dir_all(folder)
            .with_context(|| format!("cannot make the folder {}", folder.display()))?;
        let lock = Self::take(folder, busy, Duration::ZERO)?;
        // Another process may have worked in it, and ended, since it was found empty.
        is_free()?;
        Ok(lock)
    }

    /// Takes the lock of a folder, within `patience`; `busy` is what another process does there.
    pub fn take(folder: &Path, busy: &str, patience: Duration) -> anyhow::Result<Self> {
        Self::by(File::try_lock, folder, busy, patience)
    }

    /// Takes the lock of a file, which is made if there is none; nothing if another process has it.
    pub fn of_file(path: &Path) -> anyhow::Result<Option<Self>> {
        Ok(of_file(path)?.map(Lock))
    }

    /// Returns whether a process has the lock of a file.
    pub fn is_held(path: &Path) -> bool {
        // Shared, so that two who look at once do not take each other for the owner.
        let file = File::open(path);
        file.is_ok_and(|file| matches!(file.try_lock_shared(), Err(TryLockError::WouldBlock)))
    }

    fn by(
        lock: fn(&File) -> Result<(), TryLockError>,
        folder: &Path,
        busy: &str,
        patience: Duration,
    ) -> anyhow::Result<Self> {
        let file = open(&folder.join(NAME))?;
        let clock = Instant::now();
        loop {
            match lock(&file) {
                // Not every file system has locks.
                Ok(()) | Err(TryLockError::Error(_)) => return Ok(Lock(file)),
                Err(TryLockError::WouldBlock) if clock.elapsed() < patience => {
                    std::thread::sleep(Duration::from_millis(20));
                }
                Err(TryLockError::WouldBlock) => {
                    bail!("{} is in use: another kerrlight {busy} it", folder.display())
                }
            }
        }
    }
}

/// A file that is locked and made if there is none, to be read and written; nothing if another process has its lock.
pub fn of_file(path: &Path) -> anyhow::Result<Option<File>> {
    let file = open(path)?;
    // Not every file system has locks.
    let is_held = matches!(file.try_lock(), Err(TryLockError::WouldBlock));
    Ok((!is_held).then_some(file))
}

fn open(path: &Path) -> anyhow::Result<File> {
    let mut options = OpenOptions::new();
    let file = options.read(true).write(true).create(true).truncate(false).open(path);
    file.with_context(|| format!("cannot open {}", path.display()))
}

/// Returns whether there is nothing else in a folder but its lock; so it is if there is no folder.
fn is_free(folder: &Path, is_own: impl Fn(&Path) -> bool) -> bool {
    let Ok(mut entries) = std::fs::read_dir(folder) else { return !folder.exists() };
    let is_fine = |entry: std::fs::DirEntry| entry.file_name() == NAME || is_own(&entry.path());
    entries.all(|entry| entry.is_ok_and(is_fine))
}
