//! The sky of a scene as a picture: azimuth from 0 to 360 degrees from left to right, +z along the upper edge.

use super::subject::Subject;
use anyhow::Context;
use image::codecs::png::PngEncoder;
use image::{ExtendedColorType, ImageEncoder};
use kerrlight_render::emission::sky::{Beam, SkyModel};
use kerrlight_render::image::preview::srgb_of_linear;
use rayon::prelude::*;

const WIDTH: usize = 2048;
const HEIGHT: usize = 1024;

/// The sky as a PNG in sRGB, and the linear light of its brightest value; none without a sky.
pub fn panorama(subject: &Subject) -> anyhow::Result<Option<(Vec<u8>, f64)>> {
    let (sky, assets) = (subject.scene.sky.as_ref(), &subject.assets);
    let model = sky.and_then(|sky| SkyModel::new(sky, assets.sky.clone(), assets.stars.clone()));
    let Some(model) = model.map(SkyModel::for_beams) else { return Ok(None) };
    let light: Vec<[f32; 3]> =
        (0..WIDTH * HEIGHT).into_par_iter().map(|k| mean(&model, k)).collect();
    let most = light.iter().flatten().copied().fold(0.0, f32::max);
    let most = if most > 0.0 { most } else { 1.0 };
    let bytes: Vec<u8> = light.iter().flatten().map(|x| srgb_of_linear(x / most)).collect();
    let mut png = Vec::new();
    let encoder = PngEncoder::new(&mut png);
    let size = (WIDTH as u32, HEIGHT as u32);
    encoder.write_image(&bytes, size.0, size.1, ExtendedColorType::Rgb8).context("the sky")?;
    Ok(Some((png, f64::from(most))))
}

/// The mean light of a pixel.
fn mean(model: &SkyModel, k: usize) -> [f32; 3] {
    let polar = (0.5 + (k / WIDTH) as f64) / HEIGHT as f64 * core::f64::consts::PI;
    let azimuth = (0.5 + (k % WIDTH) as f64) / WIDTH as f64 * core::f64::consts::TAU;
    let ((s, c), (y, x)) = (polar.sin_cos(), azimuth.sin_cos());
    let side = core::f64::consts::PI / HEIGHT as f64;
    model.mean_color(&Beam::of_circle([s * x, s * y, c], 0.4 * side))
}
