//! `kerrlight render`: from a scene to EXR and PNG.

pub mod preview;
pub mod report;
pub mod source;

use crate::output::{self, Output};
use crate::overlay::OverlayOptions;
use crate::progress;
use anyhow::Context;
use clap::Args;
use kerrlight_tomo::image::exr;
use kerrlight_tomo::image::preview as drawing;
use kerrlight_tomo::image::sheet::sheet;
use kerrlight_tomo::render::render;
use preview::PreviewOptions;
use source::Source;
use std::path::PathBuf;
use std::time::Instant;

/// Arguments of `kerrlight render`.
#[derive(Debug, Args)]
pub struct Render {
    /// Scene file (TOML), or an EXR that kerrlight rendered, to render it again; without it
    /// a built-in scene: Sgr A* with a flare and a disc
    scene: Option<PathBuf>,
    /// Where to write the EXR [default, without --preview and --sheet either: EXR and PNG, in the current folder
    /// and named after the scene]
    #[arg(short, long, value_name = "FILE.exr")]
    output: Option<PathBuf>,
    /// Where to write a tone-mapped PNG
    #[arg(long, value_name = "FILE.png")]
    preview: Option<PathBuf>,
    /// Change a value of the scene, e.g. hole.spin=0.5 or spot.0.phase_deg=90
    #[arg(long = "set", value_name = "KEY.PATH=VALUE")]
    overrides: Vec<String>,
    #[command(flatten)]
    look: PreviewOptions,
    #[command(flatten)]
    overlay: OverlayOptions,
    /// Where to write a contact sheet: all channels with colour bars
    #[arg(long, value_name = "FILE.png")]
    sheet: Option<PathBuf>,
}

impl Render {
    /// Renders.
    pub fn run(&self) -> anyhow::Result<()> {
        let source = Source::new(self.scene.as_deref())?;
        let (text, scene) = source.scene(&self.overrides)?;
        let (exr, png) = self.outputs(&source)?;
        let contact = self.sheet.as_deref().map(|path| Output::new(path, "png")).transpose()?;
        self.overlay.check(&scene)?;
        let sky = source::sky_path(&scene, &source.folder);
        for output in [&exr, &png, &contact].into_iter().flatten() {
            for input in self.scene.iter().chain(&sky) {
                output.spares(input)?;
            }
        }
        let picture = sky.as_deref().map(source::load_sky).transpose()?;
        let start = Instant::now();
        let bar = progress::bar(u64::from(scene.screen.height));
        let rendered = render(&scene, picture, &|rows| {
            bar.inc(rows as u64);
            true
        })
        .with_context(|| source.name.clone())?;
        bar.finish_and_clear();
        if let Some(exr) = &exr {
            let bytes =
                exr::encode(&rendered.picture, &report::attributes(&scene, &text, &rendered));
            exr.write(&bytes.context("cannot encode the EXR")?)?;
            output::print(&format!("{}\n", exr.shown().display()))?;
        }
        if let Some(png) = &png {
            let look = self.look.look(&scene);
            let white = drawing::white(&rendered.picture, look)?;
            let drawn = self.overlay.draw(&scene, &rendered.picture, look, white)?;
            let bytes = drawing::encode(&drawn).context("cannot encode the PNG")?;
            png.write(&bytes)?;
            output::print(&format!("{}\n", png.shown().display()))?;
        }
        if let Some(contact) = &contact {
            let drawn = sheet(&rendered.picture).context("cannot draw the sheet")?;
            contact.write(&drawing::encode(&drawn).context("cannot encode the PNG")?)?;
            output::print(&format!("{}\n", contact.shown().display()))?;
        }
        report::print(&scene, &rendered, start.elapsed().as_secs_f64());
        Ok(())
    }

    fn outputs(&self, source: &Source) -> anyhow::Result<(Option<Output>, Option<Output>)> {
        let check = |path: &Option<PathBuf>, extension| {
            path.as_deref().map(|path| Output::new(path, extension)).transpose()
        };
        if self.output.is_some() || self.preview.is_some() || self.sheet.is_some() {
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
