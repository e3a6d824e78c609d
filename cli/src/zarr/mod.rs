//! Volumes and movies as stores of Zarr: folders of arrays in chunks, of which only those are read that are needed.
//! Reading and writing are in builds with the feature `zarr`; without it a store is refused by its name.

#[cfg(not(feature = "zarr"))]
mod absent;
#[cfg(feature = "zarr")]
mod arrays;
#[cfg(feature = "zarr")]
mod read;
#[cfg(all(test, feature = "zarr"))]
mod tests;
#[cfg(feature = "zarr")]
mod write;

#[cfg(not(feature = "zarr"))]
pub use absent::{movie, refuse, volume};
#[cfg(feature = "zarr")]
pub use arrays::{Reading, Store};
#[cfg(feature = "zarr")]
pub use read::{movie, volume};
#[cfg(feature = "zarr")]
pub use write::{Field, write};

use anyhow::Context;
use std::path::{Path, PathBuf};

/// Metadata of a group or an array of version 3, of a group and of an array of version 2.
const METADATA: [&str; 3] = ["zarr.json", ".zgroup", ".zarray"];

/// Whether a path is a store, a group or an array in one: a folder with their metadata, or one whose name ends in `.zarr`.
pub fn is_store(path: &Path) -> bool {
    let named = || path.extension().is_some_and(|e| e.eq_ignore_ascii_case("zarr"));
    path.is_dir() && (has_metadata(path) || named())
}

fn has_metadata(path: &Path) -> bool {
    METADATA.iter().any(|name| path.join(name).is_file())
}

/// All files of a store, in the order of their names.
pub fn files(store: &Path) -> anyhow::Result<Vec<PathBuf>> {
    let (mut open, mut files) = (vec![store.to_owned()], Vec::new());
    while let Some(folder) = open.pop() {
        let name = || format!("cannot read {}", folder.display());
        for entry in std::fs::read_dir(&folder).with_context(name)? {
            let path = entry.with_context(name)?.path();
            if path.is_dir() { open.push(path) } else { files.push(path) }
        }
    }
    files.sort();
    Ok(files)
}
