//! Whole folders, which appear at once.

use super::{Unfinished, leftovers, lock, note, prefix_of};
use anyhow::Context;
use std::fs::File;
use std::path::Path;

/// Makes a whole folder beside its place, into which `write` puts files, and moves it there; one that is there is replaced.
pub fn write_folder(
    path: &Path,
    write: impl FnOnce(&Path) -> anyhow::Result<()>,
) -> anyhow::Result<()> {
    let name = || format!("cannot write {}", path.display());
    let parent = path.parent().filter(|parent| *parent != Path::new(""));
    let parent = parent.unwrap_or(Path::new("."));
    let beside = tempfile::Builder::new().prefix(&prefix_of(path)).tempdir_in(parent);
    let beside = beside.with_context(name)?;
    // It tells others that somebody writes here.
    let _lock = File::open(beside.path()).ok().filter(lock);
    let _unfinished = Unfinished::new(beside.path());
    let (new, old) = (beside.path().join("new"), beside.path().join("old"));
    std::fs::create_dir(&new).with_context(name)?;
    write(&new).with_context(name)?;
    sync(&new).with_context(name)?;
    if path.exists() {
        std::fs::rename(path, &old).with_context(name)?;
    }
    std::fs::rename(&new, path).with_context(name)?;
    note_folder(path);
    if let Some(name) = path.file_name() {
        leftovers::sweep_once(parent, &name.to_string_lossy());
    }
    beside.close().with_context(name)
}

/// Puts the files of a folder, and of those in it, on the disk.
fn sync(folder: &Path) -> std::io::Result<()> {
    for entry in std::fs::read_dir(folder)? {
        let path = entry?.path();
        if path.is_dir() { sync(&path)? } else { File::open(&path)?.sync_all()? }
    }
    Ok(())
}

/// Notes that the files of a folder were written.
fn note_folder(folder: &Path) {
    for entry in std::fs::read_dir(folder).into_iter().flatten().flatten() {
        let path = entry.path();
        if path.is_dir() { note_folder(&path) } else { note(&path, |followed| &mut followed.1) }
    }
}
