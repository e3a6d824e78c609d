//! The files that a scene names.

use crate::output;
use anyhow::Context;
use kerrlight_tomo::emission::mesh::MeshFile;
use kerrlight_tomo::emission::sky::Panorama;
use kerrlight_tomo::scene::{Scene, Sky};
use kerrlight_tomo::transport::Assets;
use std::path::{Path, PathBuf};

/// Where the files of a scene lie; relative names are relative to `folder`. Nothing must be
/// written over them.
pub fn paths(scene: &Scene, folder: &Path) -> Vec<PathBuf> {
    let meshes = scene.mesh.iter().map(|mesh| folder.join(&mesh.path));
    sky_path(scene, folder).into_iter().chain(meshes).collect()
}

/// Reads and decodes the files of a scene.
pub fn load(scene: &Scene, folder: &Path) -> anyhow::Result<Assets> {
    let sky = sky_path(scene, folder).map(|path| load_sky(&path)).transpose()?;
    let meshes = scene.mesh.iter().enumerate().map(|(k, mesh)| {
        let path = folder.join(&mesh.path);
        let name = || format!("`mesh.{k}.path` {}", path.display());
        let bytes = output::read(&path).with_context(|| format!("`mesh.{k}.path`"))?;
        // What a mesh refers to lies beside it.
        let beside = path.parent().unwrap_or(Path::new(".")).to_owned();
        let resources =
            |name: &str| output::read(&beside.join(name)).map_err(|error| format!("{error:#}"));
        MeshFile::decode(&bytes, &resources).with_context(name)
    });
    Ok(Assets { sky, meshes: meshes.collect::<anyhow::Result<_>>()? })
}

/// Where the picture of a `[sky.image]` lies.
fn sky_path(scene: &Scene, folder: &Path) -> Option<PathBuf> {
    match &scene.sky {
        Some(Sky::Image(image)) => Some(folder.join(&image.path)),
        _ => None,
    }
}

fn load_sky(path: &Path) -> anyhow::Result<Panorama> {
    let bytes = output::read(path).context("`sky.image.path`")?;
    Panorama::decode(&bytes).with_context(|| format!("`sky.image.path` {}", path.display()))
}
