//! How bright the scene is, from a small picture of it.

use super::subject::Subject;
use crate::interrupt::Keeper;
use anyhow::Context;
use kerrlight_render::picture::Raster;
use kerrlight_render::scene::{Rings, Scene};
use kerrlight_render::transport::Assets;

/// Pixels of the longer side.
const SIDE: u32 = 64;

/// The largest intensity in scene units, or the largest light of a sky without anything in front of it.
pub fn white(subject: &Subject) -> anyhow::Result<f64> {
    let scene = small(&subject.scene);
    let Assets { sky, stars, meshes, volumes } = &subject.assets;
    let assets = Assets {
        sky: sky.clone(),
        stars: stars.clone(),
        meshes: meshes.clone(),
        volumes: volumes.clone(),
    };
    let raster = Raster::new(&scene, assets).context("the scene")?;
    let keeper = Keeper::brief("stopped; nothing is written");
    let picture = raster.render(&|_| !keeper.stopped())?.picture;
    let largest =
        |name: &str| picture.channel(name).into_iter().flatten().copied().fold(0.0, f32::max);
    let found = ["intensity", "R", "G", "B"].map(largest).into_iter().find(|x| *x > 0.0);
    Ok(f64::from(found.unwrap_or(1.0)))
}

/// The same scene with few pixels, in scene units.
fn small(scene: &Scene) -> Scene {
    let mut small = scene.clone();
    let (width, height) = (scene.screen.width, scene.screen.rows());
    let scaled = |x: u32| (x * SIDE / width.max(height)).clamp(1, SIDE);
    small.screen.height = Some(scaled(height));
    small.screen.width = scaled(width);
    small.screen.samples_per_pixel = 1;
    small.screen.rings = Rings::RegularGrid;
    (small.screen.image_error, small.screen.total_flux_jy, small.screen.channels) =
        (None, None, None);
    small
}
