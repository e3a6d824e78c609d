//! The files that a scene names.

use crate::output::{self, Output};
use anyhow::Context;
use kerrlight_tomo::emission::mesh::MeshFile;
use kerrlight_tomo::emission::sky::Panorama;
use kerrlight_tomo::scene::{Scene, Sky};
use kerrlight_tomo::transport::Assets;
use std::cell::RefCell;
use std::path::{Path, PathBuf};

/// Reads and decodes the files of a scene, whose names are relative to `folder`. None of them,
/// nor what they refer to, may be one of `outputs`.
pub fn load(scene: &Scene, folder: &Path, outputs: &[&Output]) -> anyhow::Result<Assets> {
    let spare = |input: &Path| outputs.iter().try_for_each(|output| output.spares(input));
    let sky = sky_path(scene, folder);
    sky.as_deref().map_or(Ok(()), spare)?;
    let sky = sky.map(|path| load_sky(&path)).transpose()?;
    let mut meshes = Vec::new();
    for (k, mesh) in scene.mesh.iter().enumerate() {
        let path = folder.join(&mesh.path);
        spare(&path)?;
        let bytes = output::read(&path).with_context(|| format!("`mesh.{k}.path`"))?;
        // What a mesh refers to lies beside it.
        let beside = path.parent().unwrap_or(Path::new("."));
        let referred = RefCell::new(Vec::new());
        let resources = |name: &str| {
            let path = beside.join(name);
            let bytes = output::read(&path).map_err(|error| format!("{error:#}"))?;
            referred.borrow_mut().push(path);
            Ok(bytes)
        };
        let file = MeshFile::decode(&bytes, &resources)
            .with_context(|| format!("`mesh.{k}.path` {}", path.display()))?;
        referred.into_inner().iter().try_for_each(|path| spare(path))?;
        meshes.push(file);
    }
    Ok(Assets { sky, meshes })
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
