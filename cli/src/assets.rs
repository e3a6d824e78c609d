//! The files that a scene names.

use crate::output::{self, Output};
use crate::volume_files;
use anyhow::Context;
use kerrlight_render::emission::mesh::MeshFile;
use kerrlight_render::emission::sky::{Catalogue, Panorama};
use kerrlight_render::scene::{Scene, Sky};
use kerrlight_render::transport::Assets;
use std::cell::RefCell;
use std::fmt::Write;
use std::path::{Path, PathBuf};

/// The files of a scene.
pub struct Files {
    /// What they hold.
    pub decoded: Assets,
    /// What tells them from others: a line for each, with its length and checksum.
    pub identity: String,
    /// Where they and what they refer to lie.
    pub paths: Vec<PathBuf>,
}

/// Reads and decodes the files of a scene, whose names are relative to `folder`. None of them,
/// nor what they refer to, may be one of `outputs`.
pub fn load(scene: &Scene, folder: &Path, outputs: &[&Output]) -> anyhow::Result<Files> {
    let identity = RefCell::new(String::new());
    let paths = RefCell::new(Vec::new());
    let read = |path: &Path| {
        paths.borrow_mut().push(path.to_owned());
        outputs.iter().try_for_each(|output| output.spares(path))?;
        let bytes = output::read(path)?;
        let checksum = crc32fast::hash(&bytes);
        // Writing to a string never fails.
        let _ = writeln!(identity.borrow_mut(), "{} bytes, CRC-32 {checksum:08x}", bytes.len());
        anyhow::Ok(bytes)
    };
    let sky = sky_path(scene, folder).map(|path| load_sky(&path, &read)).transpose()?;
    let meshes = scene.mesh.iter().enumerate().map(|(k, mesh)| {
        let path = folder.join(&mesh.path);
        let name = || format!("`mesh.{k}.path` {}", path.display());
        let bytes = read(&path).with_context(|| format!("`mesh.{k}.path`"))?;
        // What a mesh refers to lies beside it.
        let beside = path.parent().unwrap_or(Path::new("."));
        let resources = |name: &str| read(&beside.join(name)).map_err(|error| format!("{error:#}"));
        MeshFile::decode(&bytes, &resources).with_context(name)
    });
    let meshes = meshes.collect::<anyhow::Result<_>>()?;
    let volumes = scene.volume.iter().enumerate().map(|(k, volume)| {
        let path = folder.join(&volume.path);
        volume_files::read(&path, volume, read).with_context(|| format!("`volume.{k}.path`"))
    });
    let volumes = volumes.collect::<anyhow::Result<_>>()?;
    let stars = match &scene.sky {
        Some(Sky::Catalogue(stars)) => Some(load_stars(&folder.join(&stars.path), &read)?),
        _ => None,
    };
    let decoded = Assets { sky, stars, meshes, volumes };
    Ok(Files { decoded, identity: identity.into_inner(), paths: paths.into_inner() })
}

/// Where the picture of a `[sky.image]` lies.
fn sky_path(scene: &Scene, folder: &Path) -> Option<PathBuf> {
    match &scene.sky {
        Some(Sky::Image(image)) => Some(folder.join(&image.path)),
        _ => None,
    }
}

fn load_stars(
    path: &Path,
    read: &dyn Fn(&Path) -> anyhow::Result<Vec<u8>>,
) -> anyhow::Result<Catalogue> {
    let bytes = read(path).context("`sky.catalogue.path`")?;
    Catalogue::decode(&bytes).with_context(|| format!("`sky.catalogue.path` {}", path.display()))
}

fn load_sky(
    path: &Path,
    read: &dyn Fn(&Path) -> anyhow::Result<Vec<u8>>,
) -> anyhow::Result<Panorama> {
    let bytes = read(path).context("`sky.image.path`")?;
    Panorama::decode(&bytes).with_context(|| format!("`sky.image.path` {}", path.display()))
}
