//! Volumes of emission in files: NPZ or NPY, by the name's ending, or a store of Zarr.

use crate::{output, zarr};
use anyhow::{Context, bail};
use kerrlight_render::scene::VolumeSource;
use kerrlight_render::volume::{VolumeArrays, VolumeFile};
use std::path::Path;

fn decode(path: &Path, bytes: &[u8]) -> anyhow::Result<VolumeArrays> {
    let extension = path.extension().and_then(|e| e.to_str()).unwrap_or_default();
    match extension.to_ascii_lowercase().as_str() {
        "npy" => Ok(VolumeArrays::from_npy(bytes)?),
        "npz" => Ok(VolumeArrays::from_npz(bytes)?),
        _ => bail!("a volume ends in .npz, .npy or .zarr"),
    }
}

/// Reads the volume of a scene; `read` gives the content of a file.
pub fn read(
    path: &Path,
    source: &VolumeSource,
    read: impl Fn(&Path) -> anyhow::Result<Vec<u8>>,
) -> anyhow::Result<VolumeFile> {
    if !zarr::is_store(path) {
        let bytes = read(path)?;
        let arrays = decode(path, &bytes).with_context(|| path.display().to_string())?;
        return arrays.placed(source).with_context(|| path.display().to_string());
    }
    // For their sums; chunks are read when they are decoded.
    for file in zarr::files(path)? {
        read(&file)?;
    }
    zarr::volume(path)?.placed(source).with_context(|| path.display().to_string())
}

/// Reads a volume that says itself where it is.
pub fn load(path: &Path) -> anyhow::Result<VolumeFile> {
    let name = || path.display().to_string();
    let found = decode(path, &output::read(path)?).with_context(name)?;
    found.located().with_context(name)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exact_names_tell_the_format() {
        let error = decode(Path::new("v.txt"), &[]).unwrap_err();
        assert_eq!(error.to_string(), "a volume ends in .npz, .npy or .zarr");
        assert!(decode(Path::new("v.NPZ"), b"PK").unwrap_err().to_string().contains("npz archive"));
    }
}
