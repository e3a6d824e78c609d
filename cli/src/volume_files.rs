//! Volumes of emission in files: NPZ or NPY, by the name's ending.

use crate::{output, paths};
use anyhow::{Context, bail};
use kerrlight_render::scene::VolumeSource;
use kerrlight_render::volume::{VolumeArrays, VolumeFile};
use std::path::Path;

fn decode(path: &Path, bytes: &[u8]) -> anyhow::Result<VolumeArrays> {
    match paths::ending(path).as_str() {
        "npy" => Ok(VolumeArrays::from_npy(bytes)?),
        "npz" => Ok(VolumeArrays::from_npz(bytes)?),
        _ => bail!("a volume ends in .npz or .npy"),
    }
}

/// Reads the volume of a scene; `read` gives the content of a file.
pub fn read(
    path: &Path,
    source: &VolumeSource,
    read: impl Fn(&Path) -> anyhow::Result<Vec<u8>>,
) -> anyhow::Result<VolumeFile> {
    let name = || path.display().to_string();
    decode(path, &read(path)?).with_context(name)?.placed(source).with_context(name)
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
        assert_eq!(error.to_string(), "a volume ends in .npz or .npy");
        assert!(decode(Path::new("v.NPZ"), b"PK").unwrap_err().to_string().contains("npz archive"));
    }
}
