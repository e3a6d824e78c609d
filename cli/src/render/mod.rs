//! `kerrlight render`: from a scene to EXR and PNG.

mod explain;
mod partial;
mod preview;
mod report;
mod source;
mod work;

use crate::assets;
use crate::output::{self, Output};
use anyhow::Context;
use clap::Args;
use kerrlight_tomo::image::preview::encode_png;
use kerrlight_tomo::render::Raster;
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
    /// Refine pixels until the estimated relative error of the intensity image (sum of the
    /// pixels' absolute errors by the sum of the pixels) is below this, in place of
    /// screen.samples_per_pixel
    #[arg(long, value_name = "ERROR")]
    image_error: Option<f64>,
    /// Print what is computed for this scene and what is not, with the estimated cost of each
    /// part before and the measured cost after
    #[arg(long)]
    explain: bool,
    #[command(flatten)]
    look: PreviewOptions,
    /// Columns of pixels that are traced together; the picture does not depend on it
    #[arg(long, value_name = "N", default_value = "64", hide_short_help = true)]
    #[arg(value_parser = clap::value_parser!(u16).range(1..))]
    tile: u16,
}

impl Render {
    /// Renders.
    pub fn run(&self) -> anyhow::Result<()> {
        let source = Source::new(self.scene.as_deref())?;
        let (text, scene) = source.scene(&self.all_overrides())?;
        let (exr, png) = self.outputs(&source)?;
        let outputs: Vec<&Output> = [&exr, &png].into_iter().flatten().collect();
        if let Some(input) = &self.scene {
            outputs.iter().try_for_each(|output| output.spares(input))?;
        }
        let files = assets::load(&scene, &source.folder, &outputs)?;
        let start = Instant::now();
        let raster = Raster::new(&scene, files.decoded);
        let mut raster = raster.with_context(|| source.name.clone())?.with_tile(self.tile.into());
        if self.explain {
            explain::before(&scene, &raster)?;
            raster = raster.with_meter();
        }
        let look = png.is_some().then(|| self.look.reduction(&scene, &raster)).transpose()?;
        let work = Work { raster: &raster, scene: &scene, text: &text, name: &source.name };
        let (summary, picture) = match &exr {
            Some(exr) => {
                let identity = raster.identity() + &files.identity;
                work.exr(exr, &identity, look)?
            }
            None => work.preview(look)?,
        };
        if let (Some(png), Some(picture)) = (&png, picture) {
            let bytes = encode_png(&picture, self.look.look(&scene));
            png.write(&bytes.context("cannot encode the PNG")?)?;
            output::print(&format!("{}\n", png.shown().display()))?;
        }
        report::print(&scene, &summary, start.elapsed().as_secs_f64());
        if self.explain {
            explain::after(&raster.meter(), summary.rays);
        }
        Ok(())
    }

    fn all_overrides(&self) -> Vec<String> {
        let mut overrides = self.overrides.clone();
        if let Some(error) = self.image_error {
            overrides.push("screen.samples_per_pixel=1".to_owned());
            overrides.push(format!("screen.image_error={error:?}"));
        }
        overrides
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
}
