//! `kerrlight movie`: numbered EXR frames of a scene, and animations of them.

mod frames;
mod rendering;
mod times;
mod viewing;

use crate::answer::{self, Answer};
use crate::assets::{self, Reach};
use crate::devices::{self, DeviceOption};
use crate::output::Output;
use crate::render::exr_options::ExrOptions;
use crate::render::preview::PreviewOptions;
use crate::render::report;
use crate::render::source::Source;
use anyhow::{Context, bail};
use clap::Args;
use frames::{FrameStyle, Origin, Sequence};
use kerrlight_common::memory;
use kerrlight_geodesic::RayDevice;
use kerrlight_render::picture::Raster;
use kerrlight_render::scene::Scene;
use rendering::Rendering;
use std::iter;
use std::path::PathBuf;
use std::time::Instant;
use times::{Frames, Span};

/// Arguments of `kerrlight movie`.
#[derive(Debug, Args)]
pub struct Movie {
    /// Scene file (TOML)
    scene: PathBuf,
    /// Number of frames; A..B/N renders the frames A to B of N alone
    #[arg(long, value_name = "N")]
    frames: Frames,
    #[command(flatten)]
    span: Span,
    /// Folder for the frames frame_0000.exr, frame_0001.exr, …; the same command resumes an
    /// interrupted run
    #[arg(short, long, value_name = "FOLDER")]
    output: PathBuf,
    /// Change a value of the scene, e.g. hole.spin=0.5 or spot.0.phase_deg=90
    #[arg(long = "set", value_name = "KEY.PATH=VALUE")]
    overrides: Vec<String>,
    #[command(flatten)]
    exr: ExrOptions,
    #[command(flatten)]
    device: DeviceOption,
    #[command(flatten)]
    reach: Reach,
    #[command(flatten)]
    viewing: viewing::Viewing,
    #[command(flatten)]
    look: PreviewOptions,
}

/// Refuses frames that there is no memory for.
fn afford(film: &Raster, scene: &Scene) -> anyhow::Result<()> {
    let (width, height) = (scene.screen.width, scene.screen.rows());
    let (count, channels) = (film.batch(), film.names().len());
    let what = || format!("{count} frames at once of {width} x {height} pixels");
    let pixels = f64::from(width) * f64::from(height);
    Ok(memory::afford(what, memory::frames(count as f64, pixels, channels as f64))?)
}

impl Movie {
    /// Renders what is missing, then makes the animations.
    pub fn run(&self) -> anyhow::Result<Answer> {
        let source = Source::new(Some(&self.scene))?;
        let (text, scene) = source.scene(&self.overrides)?;
        // Each frame has a scene and a text of its own, made before any is rendered: a million of
        // them may not fit into memory.
        let plans = f64::from(self.frames.all) * (2 * text.len() + 4096) as f64;
        memory::afford(|| format!("the settings of {} frames", self.frames.all), plans)?;
        let times = self.span.times(self.frames.all, &scene)?;
        let gif = self.viewing.gif()?;
        let outputs: Vec<&Output> = gif.iter().collect();
        let files = assets::load(&scene, &source.folder, &outputs, self.reach)?;
        outputs.iter().try_for_each(|output| output.must_differ_from(&self.scene))?;
        let mut film = Raster::new(&scene, files.decoded).with_context(|| source.name.clone())?;
        if self.viewing.any() && !self.frames.are_all() {
            bail!(
                "--gif and --png show the whole film: give them with --frames {}",
                self.frames.all
            );
        }
        // A missing channel is told before the frames are rendered.
        if self.viewing.any() {
            self.look.channels(&scene, &film.names())?;
        }
        if let Some(device) = self.device.open()? {
            film = film.with_device(device);
        }
        afford(&film, &scene)?;
        let device = film.device().map_or("", RayDevice::name);
        let style = FrameStyle { exr: self.exr, per_second: self.viewing.fps };
        let of = Origin { name: &source.name, text: &text, files: &files.identity, device, style };
        let mut sequence = Sequence::new(&self.output, &of, &times, &self.frames.part)?;
        for input in iter::once(&self.scene).chain(&files.paths) {
            sequence.spare(input)?;
        }
        if !film.changes() && self.frames.all > 1 {
            eprintln!("warning: nothing in this scene moves: all frames are the same");
        }
        sequence.find()?;
        if let Some(device) = film.device() {
            devices::announce(device, &film.beside_device());
        }
        let start = Instant::now();
        let rendering = Rendering::new(&mut film, &mut sequence, &self.output);
        let rendered = rendering.run().with_context(|| source.name.clone())?;
        self.viewing.write(&sequence, self.look.look(&scene), gif.as_ref())?;
        Ok(self.answer(&sequence, rendered, start.elapsed().as_secs_f64(), &outputs))
    }

    /// Describes the frames: their number, brightness and place.
    fn answer(
        &self,
        sequence: &Sequence,
        rendered: usize,
        seconds: f64,
        animations: &[&Output],
    ) -> Answer {
        let fluxes = sequence.fluxes();
        let flux = fluxes.map_or(String::new(), |(least, most, unit)| {
            format!("; flux {} to {} {unit}", report::shown(least), report::shown(most))
        });
        let worth = format!(
            "{} frames, {rendered} of them rendered in {seconds:.2} s{flux}",
            sequence.wanted().len()
        );
        let files = answer::written(animations.iter().copied());
        let places = iter::once(self.output.as_path()).chain(files.iter().copied());
        let answer = Answer::lines(&worth, &answer::listed(places)).files(files);
        let answer = match fluxes {
            Some((least, most, unit)) => {
                answer.with("flux", vec![least, most]).with("flux_unit", unit)
            }
            None => answer,
        };
        answer
            .with("folder", self.output.display().to_string())
            .with("frames", sequence.wanted().len())
            .with("rendered", rendered)
            .with("seconds", seconds)
    }
}
