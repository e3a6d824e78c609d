//! `kerrlight render`: from a scene to EXR and PNG.

use crate::assets;
use crate::output::{self, Output};
use crate::progress;
use anyhow::Context;
use clap::{Args, ValueEnum};
use kerrlight_tomo::image::colormap::Colormap;
use kerrlight_tomo::image::exr;
use kerrlight_tomo::image::preview::{self, Look, Stretch};
use kerrlight_tomo::render::{Rendered, render};
use kerrlight_tomo::scene::{Scene, SceneError, apply_override};
use std::path::{Path, PathBuf};
use std::time::Instant;

/// The scene that is rendered when none is given.
const BUILT_IN: &str = include_str!("built_in_scene.toml");

/// Arguments of `kerrlight render`.
#[derive(Debug, Args)]
pub struct Render {
    /// Scene file (TOML), or an EXR that kerrlight rendered, to render it again; without it
    /// a built-in scene: Sgr A* with a flare and a disc
    scene: Option<PathBuf>,
    /// Where to write the EXR [default, without --preview either: both, in the current folder
    /// and named after the scene]
    #[arg(short, long, value_name = "FILE.exr")]
    output: Option<PathBuf>,
    /// Where to write a tone-mapped PNG
    #[arg(long, value_name = "FILE.png")]
    preview: Option<PathBuf>,
    /// Change a value of the scene, e.g. hole.spin=0.5 or spot.0.phase_deg=90
    #[arg(long = "set", value_name = "KEY.PATH=VALUE")]
    overrides: Vec<String>,
    /// Colours of the PNG: a map of the intensity, or `color` for the R, G, B channels
    /// [default: afmhot-us, color where the scene has a sky or a mesh]
    #[arg(long, value_name = "MAP")]
    colormap: Option<Colors>,
    /// How intensity is stretched over the colour map
    #[arg(long, default_value = "linear")]
    stretch: StretchName,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
enum Colors {
    AfmhotUs,
    Afmhot,
    Inferno,
    Magma,
    Viridis,
    Gray,
    Color,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
enum StretchName {
    Linear,
    Sqrt,
    Log,
}

/// A scene with where it came from.
struct Source {
    text: String,
    name: String,
    /// What relative paths in it are relative to.
    folder: PathBuf,
}

impl Render {
    /// Renders.
    pub fn run(&self) -> anyhow::Result<()> {
        let source = self.source()?;
        let (text, scene) = self.scene(&source)?;
        let (exr, png) = self.outputs(&source)?;
        let outputs: Vec<&Output> = [&exr, &png].into_iter().flatten().collect();
        if let Some(input) = &self.scene {
            outputs.iter().try_for_each(|output| output.spares(input))?;
        }
        let assets = assets::load(&scene, &source.folder, &outputs)?;
        let start = Instant::now();
        let bar = progress::bar(u64::from(scene.screen.height));
        let rendered = render(&scene, assets, &|rows| {
            bar.inc(rows as u64);
            true
        })
        .with_context(|| source.name.clone())?;
        bar.finish_and_clear();
        if let Some(exr) = &exr {
            let bytes = exr::encode(&rendered.picture, &attributes(&scene, &text, &rendered));
            exr.write(&bytes.context("cannot encode the EXR")?)?;
            output::print(&format!("{}\n", exr.shown().display()))?;
        }
        if let Some(png) = &png {
            let bytes = preview::encode_png(&rendered.picture, self.look(&scene));
            png.write(&bytes.context("cannot encode the PNG")?)?;
            output::print(&format!("{}\n", png.shown().display()))?;
        }
        report(&scene, &rendered, start.elapsed().as_secs_f64());
        Ok(())
    }

    fn source(&self) -> anyhow::Result<Source> {
        let Some(path) = &self.scene else {
            eprintln!("rendering the built-in scene: Sgr A* with a flare and a disc");
            let name = "built-in scene".to_owned();
            return Ok(Source { text: BUILT_IN.to_owned(), name, folder: PathBuf::from(".") });
        };
        let name = path.display().to_string();
        let folder = path.parent().unwrap_or(Path::new(".")).to_owned();
        let is_exr = path.extension().is_some_and(|e| e.eq_ignore_ascii_case("exr"));
        let text = if is_exr { scene_of_exr(path)? } else { output::read_text(path)? };
        Ok(Source { text, name, folder })
    }

    /// The scene with all overrides, and its text.
    fn scene(&self, source: &Source) -> anyhow::Result<(String, Scene)> {
        let mut text = source.text.clone();
        if self.overrides.is_empty() {
            let scene = Scene::parse(&text).with_context(|| source.name.clone())?;
            return Ok((text, scene));
        }
        for assignment in &self.overrides {
            text = apply_override(&text, assignment).map_err(|error| match error {
                // Not the override's fault.
                SceneError::Syntax(_) => anyhow::Error::new(error).context(source.name.clone()),
                _ => anyhow::Error::new(error).context("--set"),
            })?;
        }
        // Lines of the changed text are nobody's.
        let scene = Scene::parse(&text).map_err(SceneError::without_line).with_context(|| {
            format!("{} with --set {}", source.name, self.overrides.join(" --set "))
        })?;
        Ok((text, scene))
    }

    fn outputs(&self, source: &Source) -> anyhow::Result<(Option<Output>, Option<Output>)> {
        let check = |path: &Option<PathBuf>, extension| {
            path.as_deref().map(|path| Output::new(path, extension)).transpose()
        };
        if self.output.is_some() || self.preview.is_some() {
            return Ok((check(&self.output, "exr")?, check(&self.preview, "png")?));
        }
        let stem = match &self.scene {
            Some(path) => path.file_stem().map(|s| s.to_string_lossy().into_owned()),
            None => Some("kerrlight".to_owned()),
        };
        let stem = stem.unwrap_or_else(|| source.name.clone());
        let exr = PathBuf::from(format!("{stem}.exr"));
        let png = PathBuf::from(format!("{stem}.png"));
        Ok((check(&Some(exr), "exr")?, check(&Some(png), "png")?))
    }

    fn look(&self, scene: &Scene) -> Look {
        let stretch = match self.stretch {
            StretchName::Linear => Stretch::Linear,
            StretchName::Sqrt => Stretch::Sqrt,
            StretchName::Log => Stretch::Log,
        };
        let colored = scene.sky.is_some() || !scene.mesh.is_empty();
        let default = if colored { Colors::Color } else { Colors::AfmhotUs };
        let map = match self.colormap.unwrap_or(default) {
            Colors::Color => return Look::Color,
            Colors::AfmhotUs => Colormap::AfmhotUs,
            Colors::Afmhot => Colormap::Afmhot,
            Colors::Inferno => Colormap::Inferno,
            Colors::Magma => Colormap::Magma,
            Colors::Viridis => Colormap::Viridis,
            Colors::Gray => Colormap::Gray,
        };
        Look::Intensity(map, stretch)
    }
}

fn scene_of_exr(path: &Path) -> anyhow::Result<String> {
    let name = || path.display().to_string();
    let (_, attributes) = exr::decode(&output::read(path)?).with_context(name)?;
    let scene = attributes.get("scene").cloned();
    scene.with_context(|| format!("{} holds no scene of kerrlight", name()))
}

/// What decided the picture.
fn attributes(scene: &Scene, text: &str, rendered: &Rendered) -> exr::Attributes {
    let entry = |name: &str, value: String| (name.to_owned(), value);
    [
        entry("version", env!("CARGO_PKG_VERSION").to_owned()),
        entry("scene", text.to_owned()),
        entry("scene_resolved", scene.to_toml()),
        entry("intensity_unit", rendered.intensity_unit.to_owned()),
        entry("intensity_per_scene_unit", rendered.unit_factor.to_string()),
        entry("pixel_size_m", scene.pixel_size().to_string()),
        entry("unresolved_rays", rendered.unresolved.to_string()),
        entry("channels", CHANNELS.to_owned()),
    ]
    .into()
}

/// The legend of the channels, for whoever opens the file.
const CHANNELS: &str = "R, G, B: linear light, emission in scene units and sky. \
intensity: mean over the pixel, without the sky. \
Of the pixel's central ray: redshift: intensity-weighted g = nu_obs/nu_em (0: no emission); \
crossings: of the equatorial plane outside the horizon; \
radius (M), azimuth (rad), delay (M): of the brightest contribution (radius 0: none); \
outcome: 0 captured, 1 escaped, 2 opaque surface, 3 unresolved.";

fn report(scene: &Scene, rendered: &Rendered, seconds: f64) {
    let screen = &scene.screen;
    let rays =
        f64::from(screen.width) * f64::from(screen.height) * f64::from(screen.samples_per_pixel);
    eprintln!(
        "{} x {} pixels, {rays} rays in {seconds:.2} s ({:.0} rays/s)",
        screen.width,
        screen.height,
        rays / seconds.max(1e-9)
    );
    if rendered.unresolved > 0 {
        eprintln!(
            "warning: {} rays unresolved (on the critical curve within rounding), shown as dark",
            rendered.unresolved
        );
    }
}
