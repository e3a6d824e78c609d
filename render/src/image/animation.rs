//! Animations for a quick look: GIF.

use crate::Error;
use color_quant::NeuQuant;
use image::RgbImage;
use std::collections::{BTreeSet, HashMap};

/// Reason why there is no animation.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum AnimationError {
    /// The GIF encoder failed.
    #[error(transparent)]
    Gif(#[from] gif::EncodingError),
    /// A GIF has at most 65535 pixels a side.
    #[error("a GIF has at most 65535 pixels a side, these frames have {0} x {1}")]
    TooLarge(u32, u32),
}

/// 256 colours for all frames of a GIF: a palette for each frame would flicker.
pub struct Palette {
    /// R, G, B of each colour.
    colors: Vec<u8>,
    /// Index of the nearest of many colours; few are all there.
    quantizer: Option<NeuQuant>,
    known: HashMap<[u8; 3], u8>,
}

impl Palette {
    /// Colours that suit these frames (Dekker 1994).
    pub fn of(frames: &[RgbImage]) -> Self {
        const MOST: usize = 1 << 20;
        let all: usize = frames.iter().map(|frame| frame.as_raw().len() / 3).sum();
        // An odd step does not follow columns.
        let step = (all / MOST) | 1;
        let pixels = frames.iter().flat_map(|frame| frame.pixels()).step_by(step);
        let samples: Vec<u8> = pixels.flat_map(|p| [p.0[0], p.0[1], p.0[2], 255]).collect();
        let all: BTreeSet<[u8; 3]> = samples.chunks_exact(4).map(|c| [c[0], c[1], c[2]]).collect();
        if all.len() <= 256 {
            let colors = all.into_iter().flatten().collect();
            return Palette { colors, quantizer: None, known: HashMap::new() };
        }
        let quantizer = NeuQuant::new(3, 256, &samples);
        let colors = quantizer.color_map_rgb();
        Palette { colors, quantizer: Some(quantizer), known: HashMap::new() }
    }

    fn index(&mut self, color: [u8; 3]) -> u8 {
        let Palette { colors, quantizer, known } = self;
        let distance = |c: &[u8]| -> u32 {
            c.iter().zip(color).map(|(a, b)| u32::from(a.abs_diff(b)).pow(2)).sum()
        };
        let nearest = || match quantizer {
            Some(quantizer) => quantizer.index_of(&[color[0], color[1], color[2], 255]) as u8,
            None => {
                let all = colors.chunks_exact(3).enumerate();
                all.min_by_key(|(_, c)| distance(c)).map_or(0, |(k, _)| k as u8)
            }
        };
        *known.entry(color).or_insert_with(nearest)
    }
}

/// A GIF in memory: 256 colours, shown everywhere.
pub struct Gif<'a> {
    encoder: gif::Encoder<&'a mut Vec<u8>>,
    palette: Palette,
    per_second: u32,
    /// Frames so far.
    count: u32,
}

impl<'a> Gif<'a> {
    /// An animation that repeats for ever. GIF counts in hundredths of a second: frames start at the nearest ones.
    ///
    /// # Errors
    /// If the size is none of a GIF.
    pub fn new(
        bytes: &'a mut Vec<u8>,
        [width, height]: [u32; 2],
        palette: Palette,
        per_second: u16,
    ) -> Result<Self, Error> {
        let too_large = |_| AnimationError::TooLarge(width, height);
        let size = [width, height].map(u16::try_from);
        let [width, height] = [size[0].map_err(too_large)?, size[1].map_err(too_large)?];
        let colors = palette.colors.clone();
        let mut encoder =
            gif::Encoder::new(bytes, width, height, &colors).map_err(AnimationError::from)?;
        encoder.set_repeat(gif::Repeat::Infinite).map_err(AnimationError::from)?;
        // Browsers take a tenth of a second for anything below two hundredths.
        Ok(Gif { encoder, palette, per_second: u32::from(per_second).clamp(1, 50), count: 0 })
    }

    /// Appends a frame.
    ///
    /// # Errors
    /// If the encoder fails.
    pub fn push(&mut self, frame: &RgbImage) -> Result<(), Error> {
        let pixels: Vec<u8> = frame.pixels().map(|p| self.palette.index(p.0)).collect();
        // The size was checked when the animation began.
        let (width, height) = (frame.width() as u16, frame.height() as u16);
        let start = |count: u32| (100.0 * f64::from(count) / f64::from(self.per_second)).round();
        let delay = (start(self.count + 1) - start(self.count)) as u16;
        self.count += 1;
        let frame =
            gif::Frame { delay, ..gif::Frame::from_indexed_pixels(width, height, pixels, None) };
        Ok(self.encoder.write_frame(&frame).map_err(AnimationError::from)?)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn frames() -> Vec<RgbImage> {
        let color = |x: u32, k: u8| image::Rgb([if x < 4 { 250 } else { 0 }, 10 * k, 7]);
        (0..3).map(|k| RgbImage::from_fn(8, 5, |x, _| color(x, k))).collect()
    }

    #[test]
    fn exact_gif_frames_with_one_palette() {
        let frames = frames();
        let mut bytes = Vec::new();
        let mut film = Gif::new(&mut bytes, [8, 5], Palette::of(&frames), 30).unwrap();
        for frame in &frames {
            film.push(frame).unwrap();
        }
        drop(film);
        let mut options = gif::DecodeOptions::new();
        options.set_color_output(gif::ColorOutput::RGBA);
        let mut reader = options.read_info(bytes.as_slice()).unwrap();
        for (frame, delay) in frames.iter().zip([3, 4, 3]) {
            let read = reader.read_next_frame().unwrap().unwrap();
            assert_eq!((read.delay, read.palette.is_none()), (delay, true));
            for (a, b) in read.buffer.chunks(4).zip(frame.pixels()) {
                assert_eq!(a[..3], b.0);
            }
        }
        assert!(reader.read_next_frame().unwrap().is_none());
    }
}
