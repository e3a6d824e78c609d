//! Where pixels are on the sky, and what a pixel looks like.

use crate::Error;
use crate::units::MICROARCSECOND;
use core::f64::consts::PI;

/// A regular grid of square pixels.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ImageGrid {
    /// Pixels from east (left) to west.
    pub width: usize,
    /// Pixels from north (top) to south.
    pub height: usize,
    /// Side of a pixel in radians.
    pub pixel_rad: f64,
}

/// The shape of a pixel, normalised to a flux of 1.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum Pulse {
    /// A point.
    Delta,
    /// A square as wide as the pixel.
    Rectangle,
    /// A pyramid twice as wide as the pixel, of linear interpolation: eht-imaging's default.
    Triangle,
}

impl ImageGrid {
    /// A grid whose width spans `field_rad`.
    ///
    /// # Errors
    /// If there are no pixels, too many, or the field is not between 0 and 1 rad.
    pub fn new(width: usize, height: usize, field_rad: f64) -> Result<Self, Error> {
        let range = |name, value, allowed| Err(Error::out_of_range(name, value, allowed));
        for (name, pixels) in [("image width", width), ("image height", height)] {
            if !(1..=65536).contains(&pixels) {
                return range(name, pixels as f64, "1 to 65536 pixels");
            }
        }
        if !(field_rad > 0.0 && field_rad < 1.0) {
            let field_uas = field_rad / MICROARCSECOND;
            return range(
                "field of view",
                field_uas,
                "microarcseconds in (0, 2.06e11), below 1 rad",
            );
        }
        Ok(ImageGrid { width, height, pixel_rad: field_rad / width as f64 })
    }

    /// Angle to the east of a column's centre, in radians.
    pub fn east(&self, column: usize) -> f64 {
        (0.5 * (self.width as f64 - 1.0) - column as f64) * self.pixel_rad
    }

    /// Angle to the north of a row's centre, in radians.
    pub fn north(&self, row: usize) -> f64 {
        (0.5 * (self.height as f64 - 1.0) - row as f64) * self.pixel_rad
    }

    /// Pixels of an image.
    pub fn pixels(&self) -> usize {
        self.width * self.height
    }
}

impl Pulse {
    /// Fourier transform of a pixel of side `pixel_rad` at (u, v).
    pub fn transform(self, uv: [f64; 2], pixel_rad: f64) -> f64 {
        let sinc = |x: f64| if x == 0.0 { 1.0 } else { (PI * x).sin() / (PI * x) };
        let product = sinc(uv[0] * pixel_rad) * sinc(uv[1] * pixel_rad);
        match self {
            Pulse::Delta => 1.0,
            Pulse::Rectangle => product,
            Pulse::Triangle => product * product,
        }
    }
}
