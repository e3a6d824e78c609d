//! Grid of pixels on the sky, and their shape.

use crate::Error;
use core::f64::consts::PI;
use kerrlight_common::units::MICROARCSECOND;

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
#[derive(Debug, Clone, Copy, Default, PartialEq)]
#[non_exhaustive]
pub enum Pulse {
    /// A point.
    Delta,
    /// A square as wide as the pixel.
    Rectangle,
    /// A pyramid twice as wide as the pixel, of linear interpolation: eht-imaging's default.
    #[default]
    Triangle,
    /// The pyramid of pixels with this side, radians: images of other pixels that such data are compared with.
    TriangleOf(f64),
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

    /// Angles of the centre of pixel `k` to the east and to the north, µas.
    pub fn place_uas(&self, k: usize) -> [f64; 2] {
        [self.east(k % self.width), self.north(k / self.width)].map(|x| x / MICROARCSECOND)
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
        let side = if let Pulse::TriangleOf(side) = self { side } else { pixel_rad };
        let product = sinc(uv[0] * side) * sinc(uv[1] * side);
        match self {
            Pulse::Delta => 1.0,
            Pulse::Rectangle => product,
            Pulse::Triangle | Pulse::TriangleOf(_) => product * product,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::operator::{Dtft, Operator};

    /// A Gaussian with a standard deviation of 8 µas on n × n pixels over 128 µas, 1 Jy: its visibilities.
    fn seen(n: usize, pulse: Pulse, uv: &[[f64; 2]]) -> Vec<f64> {
        let grid = ImageGrid::new(n, n, 128.0 * MICROARCSECOND).unwrap();
        let sigma = 8.0 * MICROARCSECOND;
        let at = |k: usize| (grid.east(k % n).powi(2) + grid.north(k / n).powi(2)) / sigma.powi(2);
        let scale = (grid.pixel_rad / sigma).powi(2) / (2.0 * PI);
        let image: Vec<f64> = (0..n * n).map(|k| scale * (-0.5 * at(k)).exp()).collect();
        let operator = Dtft::<f64>::new(grid, pulse, &[uv.to_vec()], usize::MAX);
        let mut model = vec![Default::default(); operator.data()];
        operator.forward(&image, &mut model);
        model.iter().map(|v| v.re).collect()
    }

    /// Wider pixels see what finer ones do, if they keep their pulse; without one, samples of a smooth image are its Fourier
    /// integral, exp(−2 π² σ² (u² + v²)).
    #[test]
    fn exact_wider_pixels_with_the_pulse_of_finer_ones() {
        let uv = [[0.0, 0.0], [3e9, -2e9], [8e9, 1e9]];
        let side = 128.0 / 64.0 * MICROARCSECOND;
        let fine = seen(64, Pulse::Triangle, &uv);
        let kept = seen(32, Pulse::TriangleOf(side), &uv);
        let own = seen(32, Pulse::Triangle, &uv);
        for (k, place) in uv.iter().enumerate() {
            assert!((kept[k] - fine[k]).abs() < 1e-9, "{place:?}");
        }
        assert!((own[2] / fine[2] - 1.0).abs() > 0.02, "{}", own[2] / fine[2]);
        assert_eq!(seen(64, Pulse::TriangleOf(side), &uv), fine);
        let sigma = 8.0 * MICROARCSECOND;
        for ([u, v], found) in uv.iter().zip(seen(32, Pulse::Delta, &uv)) {
            let exact = (-2.0 * (PI * sigma).powi(2) * (u * u + v * v)).exp();
            assert!((found - exact).abs() < 1e-9, "{found} {exact}");
        }
    }
}
