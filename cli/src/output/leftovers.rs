//! Leftovers of processes that were killed in the middle of writing: `.kerrlight-NAME-` and six letters or digits.
//! Whoever writes such a file holds its lock.

use std::collections::BTreeMap;
use std::fs::{File, TryLockError};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

/// Prefix of files that are written beside their place.
pub const BESIDE: &str = ".kerrlight-";

/// Letters and digits that `tempfile` adds to a name.
const RANDOM: usize = 6;

/// Returns the prefix of files that are written beside a place.
pub fn prefix_of(path: &Path) -> String {
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    format!("{BESIDE}{name}-")
}

/// The name of the file that something was to become.
fn meant(name: &str) -> Option<&str> {
    let (meant, random) = name.strip_prefix(BESIDE)?.rsplit_once('-')?;
    let is_random = random.len() == RANDOM && random.bytes().all(|b| b.is_ascii_alphanumeric());
    is_random.then_some(meant)
}

/// Lists the leftovers in a folder, by the names that they were to have.
fn all(folder: &Path) -> Vec<(String, PathBuf)> {
    let entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
    let of = |entry: std::fs::DirEntry| {
        Some((meant(entry.file_name().to_str()?)?.to_owned(), entry.path()))
    };
    entries.filter_map(of).collect()
}

/// Removes what killed processes have left in a folder of files and folders with names that are `ours`.
pub fn sweep(folder: &Path, ours: impl Fn(&str) -> bool) {
    let all = all(folder).into_iter().filter(|(name, _)| ours(name));
    all.for_each(|(_, path)| remove(&path));
}

/// Leftovers in each folder when this process first wrote there: later ones are of processes that run.
static HELD: Mutex<BTreeMap<PathBuf, Vec<(String, PathBuf)>>> = Mutex::new(BTreeMap::new());

/// The same for one name; the folder is read the first time only.
pub fn sweep_once(folder: &Path, name: &str) {
    let mut held = HELD.lock().unwrap_or_else(PoisonError::into_inner);
    let held = held.entry(folder.to_owned()).or_insert_with(|| all(folder));
    held.retain(|(meant, path)| {
        if meant == name {
            remove(path);
        }
        meant != name
    });
}

/// Removes it unless somebody writes it. What is left behind does no harm.
fn remove(path: &Path) {
    // No leftover is a link, and the lock of a link would be that of the file it leads to.
    let is_link = std::fs::symlink_metadata(path).is_ok_and(|about| about.is_symlink());
    let lock = File::open(path).ok().filter(|file| !is_link && file.try_lock().is_ok());
    let Some(_lock) = lock else { return };
    let _ = if path.is_dir() { std::fs::remove_dir_all(path) } else { std::fs::remove_file(path) };
}

/// Locks a file that was just made; false if somebody was faster and has taken it for a leftover.
pub fn lock(file: &File) -> bool {
    // Not every file system has locks.
    if let Err(TryLockError::WouldBlock) = file.try_lock() {
        return false;
    }
    is_there(file)
}

#[cfg(unix)]
fn is_there(file: &File) -> bool {
    use std::os::unix::fs::MetadataExt;
    file.metadata().is_ok_and(|about| about.nlink() > 0)
}

/// Elsewhere open files are not removed.
#[cfg(not(unix))]
fn is_there(_: &File) -> bool {
    true
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exact_only_names_of_ours_are_swept() {
        assert_eq!(meant(".kerrlight-m.gif-a1B2c3"), Some("m.gif"));
        assert_eq!(meant(".kerrlight-a-b.png-abcdef"), Some("a-b.png"));
        for foreign in [
            ".kerrlight-m.gif",
            ".kerrlight-m.gif-notes.txt",
            ".kerrlight-m.gif-abcdefg",
            "m.gif-abcdef",
        ] {
            assert_eq!(meant(foreign), None, "{foreign}");
        }
    }

    /// Files that somebody writes stay, and so do those that only look like leftovers.
    #[test]
    fn exact_leftovers_go_and_what_is_written_stays() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        let names =
            [".kerrlight-a.gif-abcdef", ".kerrlight-b.gif-abcdef", ".kerrlight-a.gif-old.txt"];
        names.iter().for_each(|name| std::fs::write(at(name), "x").unwrap());
        std::fs::create_dir(at(".kerrlight-a.gif-folder")).unwrap();
        let busy = File::create(at(".kerrlight-a.gif-123456")).unwrap();
        assert!(lock(&busy));
        sweep_once(folder.path(), "a.gif");
        let left = |name: &str| at(name).exists();
        assert_eq!(names.map(left), [false, true, true]);
        assert!(left(".kerrlight-a.gif-123456") && !left(".kerrlight-a.gif-folder"));
        drop(busy);
        sweep(folder.path(), |name| name == "a.gif");
        assert!(!left(".kerrlight-a.gif-123456") && left(names[1]));
    }
}
