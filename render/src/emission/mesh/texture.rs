//! Pictures on surfaces.

use super::MeshError;
use crate::image::decode::{Colors, dimensions, linear_colors};
use kerrlight_common::memory;

/// A picture in linear colour that repeats in both directions.
#[derive(Debug, Clone)]
pub struct Texture {
    width: usize,
    height: usize,
    pixels: Vec<[f32; 3]>,
}

impl Texture {
    /// Decodes a PNG or JPEG picture in sRGB.
    pub fn decode(bytes: &[u8]) -> Result<Self, MeshError> {
        let unreadable = |why: image::ImageError| {
            MeshError::Content(format!("a texture is no readable picture: {why}"))
        };
        let (width, height) = dimensions(bytes).map_err(unreadable)?;
        let what = || format!("a texture of {width} x {height} pixels");
        memory::afford(what, memory::colours(width.into(), height.into()))
            .map_err(|error| MeshError::Content(error.to_string()))?;
        let Colors { width, height, pixels } = linear_colors(bytes).map_err(unreadable)?;
        if width == 0 || height == 0 {
            return Err(MeshError::Content("a texture has no pixels".to_owned()));
        }
        Ok(Texture { width, height, pixels })
    }

    /// Bilinear look-up at texture coordinates, v growing downwards.
    pub fn color_at(&self, [u, v]: [f32; 2]) -> [f32; 3] {
        let split = |x: f32, size: usize| {
            let at = f64::from(x).rem_euclid(1.0) * size as f64 - 0.5;
            let cell = at.floor();
            let wrap = |k: f64| k.rem_euclid(size as f64) as usize % size;
            (wrap(cell), wrap(cell + 1.0), (at - cell) as f32)
        };
        let ((x0, x1, tx), (y0, y1, ty)) = (split(u, self.width), split(v, self.height));
        let at = |x: usize, y: usize| self.pixels[y * self.width + x];
        let (a, b, c, d) = (at(x0, y0), at(x1, y0), at(x0, y1), at(x1, y1));
        core::array::from_fn(|k| {
            (1.0 - ty) * ((1.0 - tx) * a[k] + tx * b[k]) + ty * ((1.0 - tx) * c[k] + tx * d[k])
        })
    }
}
