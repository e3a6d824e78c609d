//! The sky of a scene as a picture: azimuth from 0 to 360 degrees from left to right, +z along the upper edge.

use super::subject::Subject;
use crate::report::encode;
use anyhow::Context;
use image::RgbImage;
use kerrlight_render::emission::sky::{Beam, SkyModel};
use rayon::prelude::*;

const WIDTH: usize = 2048;
const HEIGHT: usize = 1024;

/// The sky as a PNG, and its light where a pixel has 1; none without a sky. Pixels are those of the texture format
/// rgb9e5ufloat, whose range is that of light: three bytes of each as the colours of the upper half, the last as red of
/// the lower half.
pub fn panorama(subject: &Subject) -> anyhow::Result<Option<(Vec<u8>, f64)>> {
    let (sky, assets) = (subject.scene.sky.as_ref(), &subject.assets);
    let model = sky.and_then(|sky| SkyModel::new(sky, assets.sky.clone(), assets.stars.clone()));
    let Some(model) = model.map(SkyModel::for_beams) else { return Ok(None) };
    let light: Vec<[f32; 3]> =
        (0..WIDTH * HEIGHT).into_par_iter().map(|k| mean(&model, k)).collect();
    let most = light.iter().flatten().copied().fold(0.0, f32::max);
    let unit = if most > 0.0 { most / LARGEST } else { 1.0 };
    let pixels: Vec<[u8; 4]> =
        light.iter().map(|color| shared_exponent(color.map(|x| x / unit)).to_le_bytes()).collect();
    let upper = pixels.iter().flat_map(|[a, b, c, _]| [*a, *b, *c]);
    let bytes: Vec<u8> = upper.chain(pixels.iter().flat_map(|[.., last]| [*last, 0, 0])).collect();
    let picture = RgbImage::from_raw(WIDTH as u32, 2 * HEIGHT as u32, bytes);
    Ok(Some((encode(picture).context("the sky")?, f64::from(unit))))
}

/// The largest number of [`shared_exponent`].
const LARGEST: f32 = 65408.0;

/// The bits of a colour as rgb9e5ufloat: nine bits of each component from the lowest, and the exponent that they share.
fn shared_exponent(color: [f32; 3]) -> u32 {
    let most = color.into_iter().fold(0.0, f32::max).min(LARGEST);
    // The exponent of the largest component, which has to stay below 512 when it is rounded.
    let floor = |x: f32| if x > 0.0 { x.log2().floor() as i32 } else { i32::MIN };
    let mut exponent = floor(most).max(-16) + 16;
    if (most * 2f32.powi(24 - exponent)).round() > 511.0 {
        exponent += 1;
    }
    // The bias of exponents, 15, and nine bits of a mantissa below the point.
    let scale = 2f32.powi(24 - exponent);
    let bits = color.map(|x| (x.clamp(0.0, most) * scale).round() as u32);
    bits[0] | bits[1] << 9 | bits[2] << 18 | (exponent as u32) << 27
}

/// The mean light of a pixel.
fn mean(model: &SkyModel, k: usize) -> [f32; 3] {
    let polar = (0.5 + (k / WIDTH) as f64) / HEIGHT as f64 * core::f64::consts::PI;
    let azimuth = (0.5 + (k % WIDTH) as f64) / WIDTH as f64 * core::f64::consts::TAU;
    let ((s, c), (y, x)) = (polar.sin_cos(), azimuth.sin_cos());
    let side = core::f64::consts::PI / HEIGHT as f64;
    model.mean_color(&Beam::of_circle([s * x, s * y, c], 0.4 * side))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// As WebGPU reads them: within half of the last of nine bits of the largest component, over 12 orders of magnitude.
    #[test]
    fn exact_shared_exponents() {
        let read = |bits: u32| {
            let scale = 2f32.powi((bits >> 27) as i32 - 24);
            [0, 9, 18].map(|shift: u32| (bits >> shift & 511) as f32 * scale)
        };
        assert_eq!(read(shared_exponent([LARGEST, 1.0, 0.0])), [LARGEST, 0.0, 0.0]);
        assert_eq!(shared_exponent([0.0; 3]) & 0x7ff_ffff, 0);
        for k in 0..3000 {
            let x = LARGEST * 0.99f32.powi(k);
            let color = [x, 0.3 * x, 0.7 * x];
            let error = (x / 511.0).max(2f32.powi(-24));
            for (found, given) in read(shared_exponent(color)).iter().zip(color) {
                assert!((found - given).abs() <= 0.51 * error * 2.0, "{found} {given}");
            }
        }
    }
}
