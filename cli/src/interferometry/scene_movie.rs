//! A scene, rendered at the times of scans.

use crate::assets::{self, Reach};
use crate::output;
use crate::progress;
use anyhow::{Context, bail};
use kerrlight_common::memory;
use kerrlight_common::units::MICROARCSECOND;
use kerrlight_render::picture::render;
use kerrlight_render::scene::Scene;
use kerrlight_vlbi::operator::ImageGrid;
use kerrlight_vlbi::simulate::{Movie, StokesMovie};
use std::path::Path;

/// Renders a scene at `times_h` (hours), the first being the scene's own time of observation.
/// The factor to Jy is that of the first frame, in which the flux is `screen.total_flux_jy`.
pub fn read(path: &Path, times_h: &[f64], reach: Reach) -> anyhow::Result<StokesMovie> {
    let name = || path.display().to_string();
    let mut scene = Scene::parse(&output::read_text(path)?).with_context(name)?;
    if scene.screen.total_flux_jy.is_none() {
        bail!(
            "{}: `screen.total_flux_jy` is missing: what is observed is in Jy; give `total_flux_jy = …`, the flux \
             density of the first scan, in [screen]",
            name()
        );
    }
    if scene.sky.is_some() {
        bail!("{}: a sky has no flux in Jy: remove `sky`", name());
    }
    // Visibilities need all Stokes parameters, whatever pictures of the scene hold.
    scene.screen.channels = None;
    let folder = path.parent().unwrap_or(Path::new("."));
    let assets = assets::load(&scene, folder, &[], reach).with_context(name)?.decoded;
    // A scene with a flux in Jy has both.
    let seconds = scene.hole.seconds().context("`hole.mass_msun` is missing")?;
    let angle = scene.hole.angle_uas().context("`hole.distance_kpc` is missing")?;
    let pixel_uas = scene.pixel_size() * angle;
    let (width, height) = (scene.screen.width as usize, scene.screen.rows() as usize);
    let field_rad = pixel_uas * width as f64 * MICROARCSECOND;
    let grid = ImageGrid::new(width, height, field_rad).with_context(name)?;
    let frames = if scene.changes() { times_h } else { &times_h[..1] };
    let movie = || format!("{}: {} frames of {width} x {height} pixels", name(), frames.len());
    memory::afford(movie, memory::movie(frames.len() as f64, grid.pixels() as f64))?;
    let start = scene.observer.time;
    let bar = progress::counting(frames.len() as u64, "frame");
    let mut pixels = Vec::with_capacity(frames.len() * grid.pixels());
    let mut polarized = [None, None, None];
    let mut first_factor = None;
    for time in frames {
        scene.observer.time = start + (time - times_h[0]) * 3600.0 / seconds;
        let rendered = render(&scene, assets.clone(), &|_| true).with_context(name)?;
        let factor = *first_factor.get_or_insert(rendered.summary.unit_factor);
        let channel = rendered.picture.channel("intensity").context("no intensity")?;
        // Every picture has been scaled to the same flux: only the first is to be. Intensities
        // are in Jy/µas², pixels of a movie in Jy.
        let scale = factor / rendered.summary.unit_factor * pixel_uas * pixel_uas;
        pixels.extend(channel.iter().map(|value| f64::from(*value) * scale));
        for (all, name) in polarized.iter_mut().zip(["Q", "U", "V"]) {
            // Every frame has the channels of the first.
            if let Some(channel) = rendered.picture.channel(name) {
                let all = all.get_or_insert_with(Vec::new);
                all.extend(channel.iter().map(|value| f64::from(*value) * scale));
            }
        }
        bar.inc(1);
    }
    bar.finish_and_clear();
    Ok(StokesMovie { i: Movie { grid, pixels }, polarized })
}
