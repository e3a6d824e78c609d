//! Pictures and films for programs that keep them in memory: what `kerrlight render` and `kerrlight movie` do, without
//! their files.

use crate::assets::{self, Reach};
use crate::render::preview::PreviewOptions;
use crate::render::report;
use crate::render::source::{BUILT_IN, Source, at_time};
use anyhow::Context;
use kerrlight_common::memory;
use kerrlight_render::image::exr::{self, Attributes, CameraMatrices, Style};
use kerrlight_render::image::preview::{Look, encode_png};
use kerrlight_render::picture::{Progress, Raster, Rendered};
use kerrlight_render::scene::Scene;
use std::path::Path;

/// A scene to be rendered.
#[derive(Debug)]
pub struct Shot {
    scene: Scene,
    source: Source,
    text: String,
}

/// A picture with everything that decided it.
#[derive(Debug)]
pub struct Shown {
    /// The picture and its summary.
    pub rendered: Rendered,
    /// Attributes in its EXR file.
    pub attributes: Attributes,
    camera: CameraMatrices,
    look: Look,
}

/// The text of the scene that an EXR of this program holds.
///
/// # Errors
/// If the file cannot be read, or holds no scene.
pub fn scene_of_exr(path: &Path) -> anyhow::Result<String> {
    Ok(Source::new(Some(path))?.text)
}

impl Shot {
    /// The scene in a text (TOML), or the built-in one, whose relative paths start from `folder`, with `overrides`
    /// (`key.path=value`).
    ///
    /// # Errors
    /// As `kerrlight render` has them.
    pub fn new(text: Option<&str>, folder: &Path, overrides: &[String]) -> anyhow::Result<Self> {
        let name = if text.is_some() { "scene" } else { "built-in scene" }.to_owned();
        let text = text.unwrap_or(BUILT_IN).to_owned();
        let source = Source { text, name, folder: folder.to_owned(), files: None };
        let (text, scene) = source.scene(overrides)?;
        Ok(Shot { scene, source, text })
    }

    /// Its picture. `progress` is told of finished rows and returns whether to go on.
    ///
    /// # Errors
    /// If a file or a value is at fault, there is no memory for it, or `progress` returned false.
    pub fn render(&self, progress: &Progress<'_>) -> anyhow::Result<Shown> {
        self.afford(1)?;
        let files = assets::load(&self.scene, &self.source.folder, &[], Reach::default())?;
        let raster = Raster::new(&self.scene, files.decoded);
        let raster = raster.with_context(|| self.source.name.clone())?;
        let rendered = raster.render(progress)?;
        let own = (self.scene.clone(), self.text.clone());
        Ok(shown_at(&own, rendered, raster.camera(), &raster, &files.identity))
    }

    /// Pictures at `times` (of observation, M) that share the first one's unit of intensity.
    ///
    /// # Errors
    /// As for [`Self::render`].
    pub fn film(&self, times: &[f64], progress: &Progress<'_>) -> anyhow::Result<Vec<Shown>> {
        self.afford(times.len())?;
        let of = |time: &f64| at_time(&self.source.name, &self.text, *time);
        let mut scenes = times.iter().map(of).collect::<anyhow::Result<Vec<_>>>()?.into_iter();
        let files = assets::load(&self.scene, &self.source.folder, &[], Reach::default())?;
        let film = Raster::new(&self.scene, files.decoded);
        let mut film = film.with_context(|| self.source.name.clone())?;
        let (mut shown, mut factor) = (Vec::with_capacity(times.len()), None);
        for batch in times.chunks(film.batch()) {
            let frames = film.frames(batch, progress)?;
            if let (None, Some(first)) = (factor, frames.first()) {
                factor = Some(film.unit_factor(first)?);
            }
            for frame in frames {
                let camera = film.camera_of(&frame)?;
                let rendered = film.rendered(frame, factor.unwrap_or(1.0))?;
                let scene = scenes.next().context("a frame has no time")?;
                shown.push(shown_at(&scene, rendered, camera, &film, &files.identity));
            }
        }
        Ok(shown)
    }

    /// Refuses pictures that there is no memory for.
    fn afford(&self, frames: usize) -> anyhow::Result<()> {
        let (width, rows) = (self.scene.screen.width, self.scene.screen.rows());
        let pixels = f64::from(width) * f64::from(rows) * frames as f64;
        let what = || format!("{frames} picture(s) of {width} x {rows} pixels");
        Ok(memory::afford(what, memory::table(pixels, 40.0))?)
    }
}

/// A picture with the scene and the text that it can be rendered of again.
fn shown_at(
    (scene, text): &(Scene, String),
    rendered: Rendered,
    camera: CameraMatrices,
    raster: &Raster,
    files: &str,
) -> Shown {
    let attributes = report::attributes(scene, text, files, raster, &rendered.summary);
    Shown { rendered, attributes, camera, look: PreviewOptions::default().look(scene) }
}

impl Shown {
    /// The bytes of its EXR file.
    ///
    /// # Errors
    /// On a failure of the encoder.
    pub fn exr(&self) -> anyhow::Result<Vec<u8>> {
        let style = Style { camera: Some(self.camera), ..Style::default() };
        Ok(exr::encode(&self.rendered.picture, &self.attributes, style)?)
    }

    /// The bytes of a PNG.
    ///
    /// # Errors
    /// If the channels that it shows were left out, or on a failure of the encoder.
    pub fn png(&self) -> anyhow::Result<Vec<u8>> {
        encode_png(&self.rendered.picture, self.look).context("cannot draw the picture")
    }
}
