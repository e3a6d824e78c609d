//! Folder of a fit, for the page.

use crate::output;
use crate::volume_files;
use anyhow::{Context, bail, ensure};
use kerrlight_common::numpy::{Archive, read_array};
use kerrlight_render::scene::Scene;
use kerrlight_render::volume::VolumeFile;
use kerrlight_tomo::fit::flight;
use std::path::{Path, PathBuf};

/// Pictures that a fit was made of.
pub struct Measured {
    /// Times of the data, M.
    pub times: Vec<f64>,
    /// Pixels along each side.
    pub side: usize,
    /// Width of their field, M.
    pub field: f64,
    /// Jy a pixel, row by row from above.
    pub pixels: Vec<f32>,
}

/// The scene of what was recovered.
pub fn scene_of(folder: &Path) -> anyhow::Result<PathBuf> {
    let path = folder.join("scene.toml");
    if !path.is_file() {
        bail!(
            "{}: no scene.toml in this folder: it is not that of a fit that has ended, or what it recovered has no scene",
            folder.display()
        );
    }
    Ok(path)
}

/// The true volume, if the fit knows it.
pub fn truth_of(folder: &Path) -> anyhow::Result<Option<VolumeFile>> {
    let path = folder.join("truth.npz");
    path.is_file().then(|| volume_files::load(&path)).transpose()
}

/// The pictures of the data with their times, if the fit had pictures.
pub fn measured_of(folder: &Path, scene: &Scene) -> anyhow::Result<Option<Measured>> {
    let path = folder.join("movie.npz");
    if !path.is_file() {
        return Ok(None);
    }
    let measured = read(&path, scene.field_of_view_m());
    let mut measured = measured.with_context(|| path.display().to_string())?;
    // Scenes count the way of light to a finite radius, which times of frames leave out.
    let later = if scene.effects.slow_light { flight(1.0 / scene.observer.radius) } else { 0.0 };
    let times = measured.iter_mut().flat_map(|measured| &mut measured.times);
    times.for_each(|time| *time += later);
    Ok(measured)
}

fn read(path: &Path, field: f64) -> anyhow::Result<Option<Measured>> {
    let bytes = output::read(path)?;
    let mut archive = Archive::open(&bytes)?;
    let Some(data) = archive.member("data")? else { return Ok(None) };
    let (shape, pixels) = read_array(&data).context("array data")?;
    let times = archive.member("time")?.context("no array named time")?;
    let (_, times) = read_array(&times).context("array time")?;
    let square = matches!(shape[..], [frames, height, width] if height == width && frames as usize == times.len());
    ensure!(square && !times.is_empty(), "array data: shape {shape:?} with {} times", times.len());
    let pixels = pixels.into_iter().map(|x| x as f32).collect();
    Ok(Some(Measured { times, side: shape[1] as usize, field, pixels }))
}
