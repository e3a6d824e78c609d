//! Pictures on surfaces.

use super::MeshError;
use crate::image::decode::{Colors, bilinear, dimensions, linear_colors};
use kerrlight_common::memory;

/// A picture in linear colour.
#[derive(Debug, Clone)]
pub struct Texture {
    width: usize,
    height: usize,
    pixels: Vec<[f32; 3]>,
    placement: Placement,
}

/// Colour of a picture outside of its edges, along one coordinate.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Wrap {
    /// The same again.
    #[default]
    Repeat,
    /// Its mirror image.
    Mirror,
    /// The pixels of its edge.
    Clamp,
}

/// Map from coordinates of a mesh to those of a picture.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Placement {
    /// Rows of a matrix on (u, v, 1); none where nothing is changed.
    affine: Option<[[f64; 3]; 2]>,
    /// Wrapping along u and v.
    pub wrap: [Wrap; 2],
}

impl Placement {
    /// Coordinates through a matrix on (u, v, 1), and a picture that repeats.
    pub fn affine(rows: [[f64; 3]; 2]) -> Self {
        let same = rows == [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
        Placement { affine: (!same).then_some(rows), wrap: [Wrap::Repeat; 2] }
    }
}

/// Largest value of a picture's colour, as of a material's.
const BRIGHTEST: f32 = 1e6;

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
        let is_color = |c: &f32| (0.0..=BRIGHTEST).contains(c);
        if let Some(k) = pixels.iter().position(|pixel| !pixel.iter().all(is_color)) {
            let (row, column, pixel) = (k / width + 1, k % width + 1, pixels[k]);
            return Err(MeshError::Content(format!(
                "a texture, row {row}, column {column}: R, G, B = {pixel:?} are not allowed: [0, {BRIGHTEST:e}]"
            )));
        }
        Ok(Texture { width, height, pixels, placement: Placement::default() })
    }

    /// The same with coordinates of its own.
    pub fn placed(self, placement: Placement) -> Self {
        Texture { placement, ..self }
    }

    /// Bilinear look-up at texture coordinates, v growing downwards.
    pub fn color_at(&self, place: [f32; 2]) -> [f32; 3] {
        let [u, v] = match self.placement.affine {
            None => place.map(f64::from),
            Some(rows) => {
                let [u, v] = place.map(f64::from);
                rows.map(|[a, b, c]| a * u + b * v + c)
            }
        };
        let [across, down] = self.placement.wrap;
        let columns = across.neighbours(u, self.width);
        let rows = down.neighbours(v, self.height);
        bilinear(&self.pixels, self.width, columns, rows)
    }
}

impl Wrap {
    /// The pixels on both sides of a coordinate, and the weight of the second.
    fn neighbours(self, x: f64, size: usize) -> (usize, usize, f32) {
        let inside = match self {
            Wrap::Repeat => x.rem_euclid(1.0),
            Wrap::Mirror => 1.0 - (x.rem_euclid(2.0) - 1.0).abs(),
            Wrap::Clamp => x.clamp(0.0, 1.0),
        };
        let at = inside * size as f64 - 0.5;
        let cell = at.floor();
        let pixel = |k: f64| match self {
            Wrap::Repeat => k.rem_euclid(size as f64) as usize % size,
            // Beyond the edge there is the edge again.
            Wrap::Mirror | Wrap::Clamp => (k.max(0.0) as usize).min(size - 1),
        };
        (pixel(cell), pixel(cell + 1.0), (at - cell) as f32)
    }
}
