//! Films to look at: 8-bit pictures of the frames with one common exposure.

use super::frames::Sequence;
use crate::output::Output;
use crate::progress;
use anyhow::{Context, bail};
use clap::Args;
use image::RgbImage;
use kerrlight_render::image::animation::{Gif, Palette};
use kerrlight_render::image::preview::{self, Look};
use std::path::PathBuf;

/// Options of images and animations for viewing.
#[derive(Debug, Args)]
pub struct Viewing {
    /// Output GIF: 256 colours, shown everywhere
    #[arg(long, value_name = "FILE.gif")]
    gif: Option<PathBuf>,
    /// Write a PNG beside each EXR
    #[arg(long)]
    png: bool,
    /// Frames per second of the GIF, and in the headers of the EXR files
    #[arg(long, value_name = "N", default_value = "25", value_parser = clap::value_parser!(u16).range(1..=50))]
    pub fps: u16,
    /// Intensity shown as white [default: 99.8th percentile of the lit pixels of all frames]
    #[arg(long, value_name = "X")]
    white: Option<f32>,
}

/// A palette is made from at most this many frames.
const PALETTE_FRAMES: usize = 12;

impl Viewing {
    /// Checks the exposure, and where the GIF is to go.
    pub fn gif(&self) -> anyhow::Result<Option<Output>> {
        if let Some(white) = self.white.filter(|white| !(white.is_finite() && *white > 0.0)) {
            bail!("--white {white} is not allowed: a finite number above 0");
        }
        self.gif.as_deref().map(|path| Output::new(path, "gif")).transpose()
    }

    /// Returns whether any image or animation is to be made.
    pub fn any(&self) -> bool {
        self.gif.is_some() || self.png
    }

    /// Draws all frames and writes the requested files, the GIF to `output`.
    pub fn write(
        &self,
        sequence: &Sequence,
        look: Look,
        output: Option<&Output>,
    ) -> anyhow::Result<()> {
        if !self.any() {
            return Ok(());
        }
        let white = match self.white {
            Some(white) => white,
            None => common_white(sequence, look)?,
        };
        // Frames are read again one by one: a film need not fit into memory.
        let draw = |k: usize| {
            preview::draw(&sequence.read(k)?, look, white).context("cannot draw the frames")
        };
        let first = draw(0)?;
        let size = [first.width(), first.height()];
        let mut bytes = Vec::new();
        let mut gif = match output {
            Some(_) => {
                let palette = palette(sequence.len(), draw)?;
                Some(Gif::new(&mut bytes, size, palette, self.fps)?)
            }
            None => None,
        };
        let bar = progress::counting(sequence.len() as u64, "frame");
        for k in 0..sequence.len() {
            let drawn = draw(k)?;
            gif.as_mut().map(|film| film.push(&drawn)).transpose()?;
            if self.png {
                let bytes = preview::encode(&drawn).context("cannot encode the PNG")?;
                Output::new(&sequence.path(k, "png"), "png")?.write(&bytes)?;
            }
            bar.inc(1);
        }
        bar.finish_and_clear();
        // The encoder writes the end of the file as it goes.
        drop(gif);
        output.map_or(Ok(()), |output| output.write(&bytes))
    }
}

/// One exposure for all frames: that of the brightest.
fn common_white(sequence: &Sequence, look: Look) -> anyhow::Result<f32> {
    let mut white = 0.0f32;
    for k in 0..sequence.len() {
        let picture = sequence.read(k)?;
        let shown: &[&str] = match look {
            Look::Intensity(..) => &["intensity"],
            Look::Color => &["R", "G", "B"],
        };
        let seen = picture.channels.iter().filter(|c| shown.contains(&c.name.as_str()));
        let lit = seen.flat_map(|c| &c.values).any(|v| *v > 0.0);
        // A dark frame has no exposure of its own.
        if lit {
            white = white.max(preview::white(&picture, look).context("cannot draw the frames")?);
        }
    }
    Ok(if white > 0.0 { white } else { 1.0 })
}

fn palette(
    frames: usize,
    draw: impl Fn(usize) -> anyhow::Result<RgbImage>,
) -> anyhow::Result<Palette> {
    let step = frames.div_ceil(PALETTE_FRAMES).max(1);
    let some: Vec<RgbImage> = (0..frames).step_by(step).map(draw).collect::<Result<_, _>>()?;
    Ok(Palette::of(&some))
}
