//! Brightness of the scene, from a small picture of it.

use super::subject::Subject;
use crate::interrupt::SignalGuard;
use anyhow::Context;
use kerrlight_render::picture::{Raster, own_unit};
use kerrlight_render::scene::{Rings, Scene};

/// Pixels of the longer side.
const SIDE: u32 = 64;

/// The largest intensity in scene units, or of a sky without anything in front of it the light that one in a hundred of
/// its lit pixels exceeds: a sun would leave the rest black.
pub fn white(subject: &Subject) -> anyhow::Result<f64> {
    let scene = small(&subject.scene);
    let raster = Raster::new(&scene, subject.assets.clone()).context("the scene")?;
    // Pictures of gas are in physical units, the page in those of the scene.
    let unit = own_unit(&scene);
    let keeper = SignalGuard::brief("stopped; nothing is written");
    let picture = raster.render(&|_| !keeper.stopped())?.picture;
    let lit = |name: &str| {
        let values = picture.channel(name).into_iter().flatten().copied();
        let mut lit: Vec<f32> = values.filter(|x| *x > 0.0).collect();
        lit.sort_unstable_by(f32::total_cmp);
        lit
    };
    if let Some(most) = lit("intensity").last() {
        return Ok(f64::from(*most) / unit);
    }
    let sky = ["R", "G", "B"].map(lit).into_iter().find(|values| !values.is_empty());
    Ok(sky.map_or(1.0, |values| f64::from(values[(values.len() - 1) * 99 / 100])))
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
