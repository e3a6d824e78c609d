//! `kerrlight render`: from a scene to EXR and PNG.

mod explain;
pub mod exr_options;
mod partial;
pub mod preview;
pub mod report;
pub mod source;
mod work;

use crate::answer::{self, Answer};
use crate::assets::{self, Reach};
use crate::devices::{self, DeviceOption};
use crate::output::Output;
use anyhow::Context;
use clap::Args;
use exr_options::ExrOptions;
use kerrlight_common::memory;
use kerrlight_render::image::Picture;
use kerrlight_render::image::preview::encode_png;
use kerrlight_render::image::reduce::Reduction;
use kerrlight_render::picture::{Raster, Summary};
use kerrlight_render::scene::Scene;
use preview::PreviewOptions;
use source::Source;
use std::path::PathBuf;
use std::time::Instant;
use work::Work;

/// Arguments of `kerrlight render`.
#[derive(Debug, Args)]
pub struct Render {
    /// Scene file (TOML), or an EXR that kerrlight rendered, to render it again; without it
    /// a built-in scene: Sgr A* with a flare and a disc
    scene: Option<PathBuf>,
    /// Output EXR, `-` for standard output [default, without --preview either: EXR and PNG in the current folder,
    /// named after the scene]
    #[arg(short, long, value_name = "FILE.exr")]
    pub output: Option<PathBuf>,
    /// Output tone-mapped PNG, `-` for standard output
    #[arg(long, value_name = "FILE.png")]
    pub preview: Option<PathBuf>,
    /// Change a value of the scene, e.g. hole.spin=0.5 or spot.0.phase_deg=90
    #[arg(long = "set", value_name = "KEY.PATH=VALUE")]
    overrides: Vec<String>,
    /// Refine pixels until the estimated relative error of the intensity image (sum of the
    /// pixels' absolute errors by the sum of the pixels) is below this, in place of
    /// screen.samples_per_pixel
    #[arg(long, value_name = "ERROR")]
    image_error: Option<f64>,
    /// Print what is computed for this scene and what is not, with the estimated cost of each
    /// part, and render nothing
    #[arg(long, visible_alias = "dry-run")]
    explain: bool,
    #[command(flatten)]
    look: PreviewOptions,
    #[command(flatten)]
    exr: ExrOptions,
    #[command(flatten)]
    device: DeviceOption,
    #[command(flatten)]
    reach: Reach,
    /// Columns of pixels that are traced together; the picture does not depend on it
    #[arg(long, value_name = "N", default_value = "64", hide_short_help = true)]
    #[arg(value_parser = clap::value_parser!(u16).range(1..))]
    tile: u16,
}

impl Render {
    /// Renders.
    pub fn run(&self) -> anyhow::Result<Answer> {
        let source = Source::new(self.scene.as_deref())?;
        let (text, scene) = source.scene(&self.all_overrides())?;
        // Before the scene's files are read: none of them may be written over.
        let outputs = self.checked_outputs(&source)?;
        let files = assets::load(&scene, &source.folder, &outputs.all(), self.reach)?;
        source.compare(&files.identity);
        afford(&scene)?;
        let device = self.device.open()?;
        let start = Instant::now();
        let raster = Raster::new(&scene, files.decoded);
        let mut raster = raster.with_context(|| source.name.clone())?.with_tile(self.tile.into());
        if let Some(device) = device {
            raster = raster.with_device(device);
        }
        let look = self.reduction(&scene, &raster, &outputs)?;
        if self.explain {
            return explain::before(&scene, &raster);
        }
        if let Some(device) = raster.device() {
            devices::announce(device, &raster.beside_device());
        }
        let (name, files) = (source.name.as_str(), files.identity.as_str());
        let work =
            Work { raster: &raster, scene: &scene, text: &text, name, files, style: &self.exr };
        let summary = self.render(&work, look, &outputs)?;
        let seconds = start.elapsed().as_secs_f64();
        report::warn(&scene, &summary);
        let worth = report::worth(&scene, &summary, seconds);
        let files = answer::written(outputs.all());
        Ok(Answer::lines(&worth, &answer::listed(files.iter().copied()))
            .files(files)
            .with_all(report::figures(&scene, &summary, seconds)))
    }

    /// Renders, and writes all files.
    fn render(
        &self,
        work: &Work<'_>,
        look: Option<Reduction>,
        outputs: &Outputs,
    ) -> anyhow::Result<Summary> {
        let (summary, picture) = match &outputs.exr {
            Some(exr) => work.exr(exr, &(work.raster.identity() + work.files), look)?,
            None => work.preview(look)?,
        };
        if let (Some(picture), Some(png)) = (picture, &outputs.png) {
            self.draw(work.scene, &picture, png)?;
        }
        Ok(summary)
    }

    /// The files to be written: no input and no file twice.
    fn checked_outputs(&self, source: &Source) -> anyhow::Result<Outputs> {
        let outputs = self.outputs(source)?;
        if let Some(input) = &self.scene {
            outputs.all().iter().try_for_each(|output| output.must_differ_from(input))?;
        }
        if let Outputs { exr: Some(exr), png: Some(png) } = &outputs {
            exr.differs(png.shown())?;
        }
        Ok(outputs)
    }

    /// Returns the reduction that keeps the channels of the PNG, if there is one.
    fn reduction(
        &self,
        scene: &Scene,
        raster: &Raster,
        outputs: &Outputs,
    ) -> anyhow::Result<Option<Reduction>> {
        if outputs.png.is_none() {
            return Ok(None);
        }
        let names = raster.names();
        let wanted = self.look.channels(scene, &names)?;
        Ok(Some(preview::reduction(scene, &names, &wanted)))
    }

    /// Writes the PNG.
    fn draw(&self, scene: &Scene, picture: &Picture, png: &Output) -> anyhow::Result<()> {
        let drawn = encode_png(picture, self.look.look(scene));
        png.write(&drawn.context("cannot draw the picture")?)
    }

    fn all_overrides(&self) -> Vec<String> {
        let mut overrides = self.overrides.clone();
        if let Some(error) = self.image_error {
            overrides.push("screen.samples_per_pixel=1".to_owned());
            overrides.push(format!("screen.image_error={error:?}"));
        }
        overrides
    }

    fn outputs(&self, source: &Source) -> anyhow::Result<Outputs> {
        let check = |path: &Option<PathBuf>, extension| {
            path.as_deref().map(|path| Output::or_pipe(path, &[extension])).transpose()
        };
        if self.output.is_some() || self.preview.is_some() {
            return Ok(Outputs {
                exr: check(&self.output, "exr")?,
                png: check(&self.preview, "png")?,
            });
        }
        let stem = match &self.scene {
            Some(path) => path.file_stem().map(|s| s.to_string_lossy().into_owned()),
            None => Some("kerrlight".to_owned()),
        };
        let stem = stem.unwrap_or_else(|| source.name.clone());
        let exr = PathBuf::from(format!("{stem}.exr"));
        let png = PathBuf::from(format!("{stem}.png"));
        Ok(Outputs { exr: check(&Some(exr), "exr")?, png: check(&Some(png), "png")? })
    }
}

/// Refuses rows that there is no memory for.
fn afford(scene: &Scene) -> anyhow::Result<()> {
    let width = scene.screen.width;
    let bands = memory::bands(width.into(), rayon::current_num_threads() as f64);
    Ok(memory::afford(|| format!("screen.width = {width}: the rows under way"), bands)?)
}

/// The files to be written.
struct Outputs {
    exr: Option<Output>,
    png: Option<Output>,
}

impl Outputs {
    fn all(&self) -> Vec<&Output> {
        [&self.exr, &self.png].into_iter().flatten().collect()
    }
}
