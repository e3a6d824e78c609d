//! What a program without Zarr says of stores.

use anyhow::bail;
use kerrlight_render::volume::VolumeArrays;
use kerrlight_vlbi::files::images::WithSize;
use std::path::Path;

/// Refuses to read a volume.
pub fn volume(path: &Path) -> anyhow::Result<VolumeArrays> {
    refuse(path)
}

/// Refuses to read a movie.
pub fn movie(path: &Path) -> anyhow::Result<WithSize> {
    refuse(path)
}

/// Says what a program without Zarr does not read.
pub fn refuse<T>(path: &Path) -> anyhow::Result<T> {
    bail!(
        "{} is a store of Zarr, which this program does not read: build it with `--features zarr`",
        path.display()
    )
}
