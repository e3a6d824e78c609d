//! The files that a scene names.

use crate::output::{self, Output};
use crate::{paths, volume_files};
use anyhow::Context;
use clap::Args;
use kerrlight_render::emission::mesh::MeshFile;
use kerrlight_render::emission::sky::{Catalogue, Panorama};
use kerrlight_render::scene::{Scene, Sky};
use kerrlight_render::transport::Assets;
use std::cell::RefCell;
use std::fmt::Write;
use std::path::{Path, PathBuf};

/// The files of a scene.
pub struct Files {
    /// Decoded files.
    pub decoded: Assets,
    /// Identity of the files: a line for each, with its length and checksum.
    pub identity: String,
    /// Paths of these files and of those that they refer to.
    pub paths: Vec<PathBuf>,
}

/// Folders in which the files may lie that a mesh of a scene refers to. The scene is the user's own text and names
/// any file; a mesh may come from anywhere.
#[derive(Debug, Clone, Copy, Default, Args)]
pub struct Reach {
    /// Let meshes refer to files outside of their own folders (materials, textures, buffers)
    #[arg(long, hide_short_help = true)]
    pub allow_outside: bool,
}

impl Reach {
    /// Finds a file that a mesh in the folder `beside` refers to; `None` if there is no such file.
    fn find(self, beside: &Path, name: &str) -> Result<Option<PathBuf>, String> {
        let path = beside.join(name);
        // Links are followed: what counts is where the file itself lies.
        let Ok(found) = path.canonicalize() else { return Ok(None) };
        let home = beside.canonicalize().map_err(|error| error.to_string())?;
        if self.allow_outside || found.starts_with(home) {
            return Ok(Some(path));
        }
        Err("it lies outside of the folder of the mesh: if you trust the mesh, give --allow-outside".to_owned())
    }
}

/// Reads and decodes the files of a scene, whose names are relative to `folder`. None of them,
/// nor what they refer to, may be one of `outputs`.
pub fn load(
    scene: &Scene,
    folder: &Path,
    outputs: &[&Output],
    reach: Reach,
) -> anyhow::Result<Files> {
    let identity = RefCell::new(String::new());
    let paths = RefCell::new(Vec::new());
    let read = |path: &Path| {
        paths.borrow_mut().push(path.to_owned());
        outputs.iter().try_for_each(|output| output.must_differ_from(path))?;
        let bytes = output::read(path)?;
        let checksum = crc32fast::hash(&bytes);
        // Writing to a string never fails.
        let _ = writeln!(identity.borrow_mut(), "{} bytes, CRC-32 {checksum:08x}", bytes.len());
        anyhow::Ok(bytes)
    };
    let sky = match &scene.sky {
        Some(Sky::Image(image)) => {
            let (key, path) = ("sky.image.path", folder.join(&image.path));
            Some(loaded(key, &path, &read, Panorama::decode, Panorama::warnings)?)
        }
        _ => None,
    };
    let meshes = scene.mesh.iter().enumerate().map(|(k, mesh)| {
        let path = folder.join(&mesh.path);
        let name = || format!("`mesh.{k}.path` {}", path.display());
        let bytes = read(&path).with_context(|| format!("`mesh.{k}.path`"))?;
        let beside = paths::folder_of(&path);
        let resources = |name: &str| {
            let found = reach.find(beside, name)?;
            found.map(|path| read(&path)).transpose().map_err(|error| crate::plain::reasons(&error))
        };
        let file = MeshFile::decode(&bytes, &resources).with_context(name)?;
        warn(&name(), &file.warnings);
        anyhow::Ok(file)
    });
    let meshes = meshes.collect::<anyhow::Result<_>>()?;
    let volumes = scene.volume.iter().enumerate().map(|(k, volume)| {
        let path = folder.join(&volume.path);
        volume_files::read(&path, volume, read).with_context(|| format!("`volume.{k}.path`"))
    });
    let volumes = volumes.collect::<anyhow::Result<_>>()?;
    let stars = match &scene.sky {
        Some(Sky::Catalogue(stars)) => {
            let (key, path) = ("sky.catalogue.path", folder.join(&stars.path));
            Some(loaded(key, &path, &read, Catalogue::decode, Catalogue::warnings)?)
        }
        _ => None,
    };
    let decoded = Assets { sky, stars, meshes, volumes };
    Ok(Files { decoded, identity: identity.into_inner(), paths: paths.into_inner() })
}

/// Tells what of a file is not shown as it says.
fn warn(name: &str, warnings: &[String]) {
    warnings.iter().for_each(|what| eprintln!("warning: {name}: {what}"));
}

/// Reads and decodes what a key of the scene names, and tells its warnings.
fn loaded<T>(
    key: &str,
    path: &Path,
    read: &dyn Fn(&Path) -> anyhow::Result<Vec<u8>>,
    decode: fn(&[u8]) -> Result<T, kerrlight_render::Error>,
    warnings: fn(&T) -> &[String],
) -> anyhow::Result<T> {
    let bytes = read(path).with_context(|| format!("`{key}`"))?;
    let name = format!("`{key}` {}", path.display());
    let decoded = decode(&bytes).with_context(|| name.clone())?;
    warn(&name, warnings(&decoded));
    Ok(decoded)
}
