//! Subject of the page: a scene with its files, or the folder of a fit.

use crate::assets::{self, Reach};
use crate::render::source::Source;
use crate::{output, volume_files};
use anyhow::{Context, bail, ensure};
use kerrlight_common::numpy::{Archive, read_array};
use kerrlight_render::scene::Scene;
use kerrlight_render::transport::Assets;
use kerrlight_render::volume::VolumeFile;
use kerrlight_tomo::fit::flight;
use std::path::{Path, PathBuf};

/// A scene with everything that the page needs of it.
pub struct Subject {
    pub scene: Scene,
    /// The text of the scene, with what was changed.
    pub text: String,
    pub assets: Assets,
    /// Words that stand behind `kerrlight render` for this scene.
    pub words: Vec<String>,
    /// Title of the page.
    pub title: String,
    /// The volume that a fit should have recovered, if it is known.
    pub truth: Option<VolumeFile>,
    /// The pictures that a fit was made of, if it was made of pictures.
    pub measured: Option<Measured>,
}

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

impl Subject {
    /// The scene of a file or of the folder of a fit, or the built-in one, with changes.
    pub fn open(path: Option<&Path>, overrides: &[String], reach: Reach) -> anyhow::Result<Self> {
        let run = path.filter(|path| path.is_dir());
        let within = run.map(scene_of).transpose()?;
        let file = within.as_deref().or(path);
        let source = match file {
            Some(_) => Source::new(file)?,
            None => Source::built_in(),
        };
        let (text, scene) = source.scene(overrides)?;
        let assets = assets::load(&scene, &source.folder, &[], reach)?.decoded;
        let mut words: Vec<String> = file.map(shown).transpose()?.into_iter().collect();
        for change in overrides {
            words.extend(["--set".to_owned(), change.clone()]);
        }
        let title =
            path.map_or("Sgr A* with a flare".to_owned(), |path| path.display().to_string());
        let truth = run.map(truth_of).transpose()?.flatten();
        let measured = run.map(|run| measured_of(run, &scene)).transpose()?.flatten();
        Ok(Subject { scene, text, assets, words, title, truth, measured })
    }
}

fn shown(path: &Path) -> anyhow::Result<String> {
    let text = path.to_str().with_context(|| format!("{}: not a name in UTF-8", path.display()))?;
    Ok(text.to_owned())
}

/// The scene of what was recovered.
fn scene_of(folder: &Path) -> anyhow::Result<PathBuf> {
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
fn truth_of(folder: &Path) -> anyhow::Result<Option<VolumeFile>> {
    let path = folder.join("truth.npz");
    path.is_file().then(|| volume_files::load(&path)).transpose()
}

/// The pictures of the data with their times, if the fit had pictures.
fn measured_of(folder: &Path, scene: &Scene) -> anyhow::Result<Option<Measured>> {
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
