//! Sums over a picture, and what they say about it.

use super::RenderError;
use super::pixels::Pixel;
use crate::Error;
use crate::scene::Scene;
use kerrlight_common::units::{JY_PER_SQUARE_UAS, MICROARCSECOND};

/// Sums over pixels; intensities in the scene's unit.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(super) struct Tally {
    pub rays: u64,
    pub unresolved: u64,
    /// Sum of the pixels' intensities.
    pub intensity: f64,
    /// Sum of the estimated absolute errors of the pixels' intensities.
    pub error: f64,
    /// Largest intensity of a pixel.
    pub largest: f64,
}

impl Tally {
    pub const BYTES: usize = 40;

    pub fn plus(self, other: Self) -> Self {
        Tally {
            rays: self.rays + other.rays,
            unresolved: self.unresolved + other.unresolved,
            intensity: self.intensity + other.intensity,
            error: self.error + other.error,
            largest: self.largest.max(other.largest),
        }
    }

    /// Adds up the pixels of a band, row by row; `side`² rays a pixel on a regular grid, or none where
    /// every pixel knows its error.
    pub fn of_band(pixels: &[Pixel], width: usize, side: Option<usize>) -> Self {
        let mut tally = Tally::default();
        for pixel in pixels {
            tally.rays += u64::from(pixel.rays);
            tally.unresolved += u64::from(pixel.unresolved);
            tally.intensity += pixel.intensity;
            tally.largest = tally.largest.max(pixel.intensity);
        }
        tally.error = match side {
            Some(side) => sampling_error(pixels, width, side),
            None => pixels.iter().map(|pixel| pixel.error).sum(),
        };
        tally
    }

    pub fn to_bytes(self) -> [u8; Self::BYTES] {
        let words = [
            self.rays,
            self.unresolved,
            self.intensity.to_bits(),
            self.error.to_bits(),
            self.largest.to_bits(),
        ];
        let mut bytes = [0; Self::BYTES];
        for (place, word) in bytes.chunks_exact_mut(8).zip(words) {
            place.copy_from_slice(&word.to_le_bytes());
        }
        bytes
    }

    pub fn from_bytes(bytes: &[u8; Self::BYTES]) -> Self {
        let (words, _) = bytes.as_chunks::<8>();
        let mut words = words.iter().map(|word| u64::from_le_bytes(*word));
        let mut next = || words.next().unwrap_or_default();
        Tally {
            rays: next(),
            unresolved: next(),
            intensity: f64::from_bits(next()),
            error: f64::from_bits(next()),
            largest: f64::from_bits(next()),
        }
    }
}

/// Sum over pixels of the error of their means, estimated from second differences D between
/// neighbours (one-sided at the edges of the band).
///
/// Returns the sampling error. With one ray at its centre a pixel of a smooth picture is off by (D_xx +
/// D_yy)/24; one with an edge somewhere in it by up to half the edge's height, a quarter on average, where
/// |D_xx| + |D_yy| is one to two heights. Hence (|D_xx| + |D_yy|)/8. `side`² rays see edges in `side` of
/// their cells, whose errors are independent: a factor `side`^(−3/2). Where photon rings are resolved the
/// rays along them know the error.
fn sampling_error(pixels: &[Pixel], width: usize, side: usize) -> f64 {
    let rows = pixels.len() / width.max(1);
    let second = |k: usize, count: usize, at: &dyn Fn(usize) -> f64| {
        if count < 3 {
            return None;
        }
        let middle = k.clamp(1, count - 2);
        Some((at(middle - 1) - 2.0 * at(middle) + at(middle + 1)).abs())
    };
    let (mut sum, mut known) = (0.0, 0.0);
    for row in 0..rows {
        for column in 0..width {
            let across = second(column, width, &|k| pixels[row * width + k].intensity);
            let down = second(row, rows, &|k| pixels[k * width + column].intensity);
            let pixel = &pixels[row * width + column];
            let unknown = match (across, down) {
                (Some(x), Some(y)) => x + y,
                // A picture or band this narrow says nothing across it.
                (Some(x), None) | (None, Some(x)) => 2.0 * x,
                (None, None) => pixel.intensity,
            };
            sum += (1.0 - pixel.known) * unknown / 8.0 / (side as f64).powf(1.5);
            known += pixel.error;
        }
    }
    sum + known
}

/// Summary of a picture.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Summary {
    /// Rays that were traced for it.
    pub rays: u64,
    /// Rays that were given up.
    pub unresolved: u64,
    /// Factor from the scene's intensity unit to that of the `intensity` channel.
    pub unit_factor: f64,
    /// Unit of the `intensity` channel.
    pub intensity_unit: &'static str,
    /// Sum of the `intensity` channel times the pixels' area in µas², for a camera that of the
    /// pixel in the middle.
    pub flux: f64,
    /// Estimated bound of its error: of the means over pixels from so many rays, of the tracer's
    /// tolerance, and of rays that were given up. What lies outside the field is not in it.
    pub flux_error: f64,
    /// Unit of the flux.
    pub flux_unit: &'static str,
    /// Estimated error of the `intensity` image: sum of its pixels' absolute errors by the sum
    /// of the pixels; infinite for a dark one in which a disc may have been missed.
    pub image_error: f64,
}

impl Summary {
    /// Factor from the scene's unit of intensity to that of the file, for a picture with these
    /// sums; refused where there is no light to scale.
    pub(super) fn factor(scene: &Scene, tally: &Tally) -> Result<f64, Error> {
        let own = own_unit(scene);
        let asked = |jy: f64| jy / (tally.intensity * pixel_area(scene));
        let factor = scene.screen.total_flux_jy.map_or(own, asked);
        if factor.is_normal() {
            Ok(factor)
        } else {
            Err(RenderError::NoFlux(tally.intensity).into())
        }
    }

    /// Takes the sums over all pixels of a scene's picture that is scaled by `factor`.
    pub(super) fn new(scene: &Scene, tally: &Tally, factor: f64) -> Result<Self, Error> {
        let largest = tally.largest * factor;
        if !(largest as f32).is_finite() {
            return Err(RenderError::NotFinite { channel: "intensity" }.into());
        }
        let area = pixel_area(scene);
        let pixels = f64::from(scene.screen.width) * f64::from(scene.screen.rows());
        // A ray that was given up may hide the brightest light in its share of a pixel.
        let dark = tally.unresolved as f64 * pixels / (tally.rays as f64).max(1.0) * tally.largest;
        // The file has 32-bit floats.
        let relative = scene.tracer.tolerance + f64::from(f32::EPSILON);
        let error = tally.error + dark + relative * tally.intensity;
        let jansky = scene.screen.total_flux_jy.is_some() || scene.gas.is_some();
        Ok(Summary {
            rays: tally.rays,
            unresolved: tally.unresolved,
            unit_factor: factor,
            intensity_unit: if jansky { "Jy/uas^2" } else { "scene unit" },
            flux: tally.intensity * area * factor,
            flux_error: error * area * factor,
            flux_unit: match (jansky, pixel_angle(scene)) {
                (true, _) => "Jy",
                (false, Some(_)) => "scene unit uas^2",
                (false, None) => "scene unit M^2",
            },
            image_error: if error > 0.0 { error / tally.intensity } else { 0.0 },
        })
    }
}

/// Factor from the scene's unit of intensity to that of a file whose flux is not requested: gas
/// shines in physical units.
pub fn own_unit(scene: &Scene) -> f64 {
    if scene.gas.is_some() { JY_PER_SQUARE_UAS } else { 1.0 }
}

/// The angle in µas of 1 M, or of 1 on a camera's picture plane; `None` where it is not known.
fn pixel_angle(scene: &Scene) -> Option<f64> {
    scene.camera.as_ref().map_or_else(|| scene.hole.angle_uas(), |_| Some(1.0 / MICROARCSECOND))
}

/// Returns the area of a pixel, in µas²; a camera's in the middle of the picture. In M² where the hole's
/// angular size is not known, which a scene with a flux in Jy never leaves out.
fn pixel_area(scene: &Scene) -> f64 {
    (scene.pixel_size() * pixel_angle(scene).unwrap_or(1.0)).powi(2)
}
