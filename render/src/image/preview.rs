//! Tone-mapped previews.

use super::Picture;
use super::colormap::Colormap;
use crate::Error;
use std::io::Cursor;

/// Choice of the values that a preview shows.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Look {
    /// The intensity through a colour map.
    Intensity(Colormap, Stretch),
    /// The R, G, B channels.
    Color,
}

/// Stretch of intensity over the colour map.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum Stretch {
    /// Proportional, as the EHT shows brightness temperature.
    Linear,
    /// Square root: shows faint light beside bright.
    Sqrt,
    /// Logarithm over three decades.
    Log,
}

/// This share of the lit pixels is shown without clipping.
const UNCLIPPED: f64 = 0.998;

/// The bytes of an 8-bit PNG.
///
/// # Errors
/// If a channel that the look needs is missing, or on a failure of the encoder.
pub fn encode_png(picture: &Picture, look: Look) -> Result<Vec<u8>, Error> {
    encode(&draw(picture, look, white(picture, look)?)?)
}

/// The bytes of a drawn picture as PNG.
///
/// # Errors
/// On a failure of the encoder.
pub fn encode(drawn: &image::RgbImage) -> Result<Vec<u8>, Error> {
    let mut bytes = Vec::new();
    drawn.write_to(&mut Cursor::new(&mut bytes), image::ImageFormat::Png)?;
    Ok(bytes)
}

/// The value, in the unit of the channel, that a picture of its own would show as white.
///
/// # Errors
/// If a channel that the look needs is missing.
pub fn white(picture: &Picture, look: Look) -> Result<f32, Error> {
    Ok(match look {
        Look::Intensity(..) => white_point(channel(picture, "intensity")?.iter().copied()),
        Look::Color => {
            let [r, g, b] = ["R", "G", "B"].map(|name| channel(picture, name));
            let (r, g, b) = (r?, g?, b?);
            white_point((0..r.len()).map(|k| r[k].max(g[k]).max(b[k])))
        }
    })
}

/// The picture in 8-bit colours, with `white` as the brightest value: frames of a film share one.
///
/// # Errors
/// If a channel that the look needs is missing.
pub fn draw(picture: &Picture, look: Look, white: f32) -> Result<image::RgbImage, Error> {
    let pixels = match look {
        Look::Intensity(map, stretch) => {
            mapped(channel(picture, "intensity")?, map, stretch, white)
        }
        Look::Color => colored(picture, white)?,
    };
    let (width, height) = (picture.width as u32, picture.height as u32);
    image::RgbImage::from_raw(width, height, pixels).ok_or_else(missing)
}

pub(super) fn missing() -> Error {
    let kind = image::error::ParameterErrorKind::DimensionMismatch;
    image::ImageError::Parameter(image::error::ParameterError::from_kind(kind)).into()
}

fn channel<'a>(picture: &'a Picture, name: &str) -> Result<&'a [f32], Error> {
    picture.channel(name).ok_or_else(missing)
}

/// The value below which `UNCLIPPED` of the values above 0 lie; 1 if there are none.
fn white_point(values: impl Iterator<Item = f32>) -> f32 {
    let mut lit: Vec<f32> = values.filter(|v| *v > 0.0).collect();
    if lit.is_empty() {
        return 1.0;
    }
    let k = ((lit.len() - 1) as f64 * UNCLIPPED) as usize;
    *lit.select_nth_unstable_by(k, f32::total_cmp).1
}

fn mapped(values: &[f32], map: Colormap, stretch: Stretch, white: f32) -> Vec<u8> {
    let table = map.table();
    let white = f64::from(white);
    let shade = |value: &f32| {
        let x = f64::from(*value) / white;
        let x = match stretch {
            Stretch::Linear => x,
            Stretch::Sqrt => x.max(0.0).sqrt(),
            Stretch::Log => 1.0 + x.max(1e-300).log10() / 3.0,
        };
        table[(x.clamp(0.0, 1.0) * 1023.0).round() as usize]
    };
    values.iter().flat_map(shade).collect()
}

/// Linear colour through the sRGB transfer function, the brightest light kept below
/// white by a common factor.
fn colored(picture: &Picture, white: f32) -> Result<Vec<u8>, Error> {
    let [r, g, b] = ["R", "G", "B"].map(|name| channel(picture, name));
    let (r, g, b) = (r?, g?, b?);
    Ok((0..r.len()).flat_map(|k| [r[k], g[k], b[k]].map(|c| srgb_of_linear(c / white))).collect())
}

/// The byte that sRGB has for linear light, 1 being white (IEC 61966-2-1); light outside of 0 to 1 is cut off.
pub fn srgb_of_linear(c: f32) -> u8 {
    let c = c.clamp(0.0, 1.0);
    let c = if c <= 0.003_130_8 { 12.92 * c } else { 1.055 * c.powf(1.0 / 2.4) - 0.055 };
    (c * 255.0).round() as u8
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::Channel;

    fn picture(values: Vec<f32>) -> Picture {
        let channel = |name: &str| Channel { name: name.to_owned(), values: values.clone() };
        let channels = ["R", "G", "B", "intensity"].map(channel).to_vec();
        Picture { width: values.len(), height: 1, channels }
    }

    fn decoded(picture: &Picture, look: Look) -> Vec<[u8; 3]> {
        let bytes = encode_png(picture, look).unwrap();
        image::load_from_memory(&bytes).unwrap().to_rgb8().pixels().map(|p| p.0).collect()
    }

    #[test]
    fn exact_black_and_white_points() {
        let p = picture(vec![0.0, 0.5, 1.0]);
        let look = Look::Intensity(Colormap::Gray, Stretch::Linear);
        let shown = decoded(&p, look);
        assert_eq!((shown[0], shown[1]), ([0; 3], [255; 3]));
        let dark = picture(vec![0.0; 4]);
        for look in [look, Look::Color] {
            assert!(decoded(&dark, look).iter().all(|c| *c == [0; 3]));
        }
    }
}
