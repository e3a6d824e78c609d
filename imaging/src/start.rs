//! Images to start from.

use crate::settings::StartImage;
use core::f64::consts::LN_2;
use kerrlight_common::units::MICROARCSECOND;
use kerrlight_vlbi::operator::ImageGrid;

/// Brightness of the darkest pixel over that of the brightest: a pixel without light would stay so.
const FLOOR: f64 = 0.02;

/// A Gaussian that is 1 at 0.
pub(super) fn bell(x: f64, fwhm: f64) -> f64 {
    (-4.0 * LN_2 * (x / fwhm).powi(2)).exp()
}

/// Shares of the flux in all pixels; their sum is 1.
pub fn image(start: StartImage, grid: ImageGrid) -> Vec<f64> {
    shares(grid, |radius| {
        FLOOR
            + match start {
                StartImage::Ring { diameter_uas, width_uas } => {
                    bell(radius - 0.5 * diameter_uas, width_uas)
                }
                StartImage::Gaussian { fwhm_uas } => bell(radius, fwhm_uas),
            }
    })
}

/// The same of a shape that was fitted.
pub fn shape(found: &[f64]) -> Vec<f64> {
    let floor = FLOOR * found.iter().copied().fold(0.0, f64::max);
    let sum = 1.0 + floor * found.len() as f64;
    found.iter().map(|share| (share + floor) / sum).collect()
}

/// Shares of light that depends on the distance from the middle alone, µas.
pub(super) fn shares(grid: ImageGrid, light: impl Fn(f64) -> f64) -> Vec<f64> {
    let of = |k: usize| {
        let (row, column) = (k / grid.width, k % grid.width);
        light(grid.east(column).hypot(grid.north(row)) / MICROARCSECOND)
    };
    let all: Vec<f64> = (0..grid.pixels()).map(of).collect();
    let sum: f64 = all.iter().sum();
    all.into_iter().map(|x| x / sum).collect()
}
