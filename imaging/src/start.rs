//! Images to start from.

use crate::settings::StartImage;
use core::f64::consts::{LN_2, PI};
use kerrlight_common::units::MICROARCSECOND;
use kerrlight_vlbi::operator::ImageGrid;

/// Brightness of the darkest pixel over that of the brightest: a pixel without light would stay so.
const FLOOR: f64 = 0.02;

/// A Gaussian that is 1 at 0.
fn bell(x: f64, fwhm: f64) -> f64 {
    (-4.0 * LN_2 * (x / fwhm).powi(2)).exp()
}

/// Light that is expected, round about the middle of the field.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Envelope {
    /// Its decline from the middle.
    pub profile: Profile,
    /// Full width at half maximum of the Gaussian with the same second moment, µas.
    pub fwhm_uas: f64,
}

/// Decline of light from the middle.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Profile {
    /// A Gaussian.
    Gaussian,
    /// exp(−(r/b)⁴): even in the middle, so that it draws no light of a ring inward, and dark outside.
    Flat,
}

impl Envelope {
    /// Shares of the flux in the pixels, nowhere below 1e-6 of the brightest.
    pub fn shares(self, grid: ImageGrid) -> Vec<f64> {
        const FLOOR: f64 = 1e-6;
        let Self { profile, fwhm_uas } = self;
        match profile {
            Profile::Gaussian => shares(grid, |radius| bell(radius, fwhm_uas) + FLOOR),
            Profile::Flat => {
                // Second moments: b²/√π, and fwhm²/(4 ln 2) of the Gaussian.
                let b = fwhm_uas * (PI.sqrt() / (4.0 * LN_2)).sqrt();
                shares(grid, |radius| (-(radius / b).powi(4)).exp() + FLOOR)
            }
        }
    }
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
fn shares(grid: ImageGrid, light: impl Fn(f64) -> f64) -> Vec<f64> {
    let of = |k: usize| {
        let (row, column) = (k / grid.width, k % grid.width);
        light(grid.east(column).hypot(grid.north(row)) / MICROARCSECOND)
    };
    let all: Vec<f64> = (0..grid.pixels()).map(of).collect();
    let sum: f64 = all.iter().sum();
    all.into_iter().map(|x| x / sum).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Both profiles have the second moment of their Gaussian.
    #[test]
    fn exact_profiles_have_one_second_moment() {
        let grid = ImageGrid::new(200, 200, 200.0 * MICROARCSECOND).unwrap();
        for profile in [Profile::Gaussian, Profile::Flat] {
            let of = Envelope { profile, fwhm_uas: 40.0 }.shares(grid);
            let square = |k: usize| {
                let (row, column) = (k / grid.width, k % grid.width);
                (grid.east(column).powi(2) + grid.north(row).powi(2)) / MICROARCSECOND.powi(2)
            };
            let moment: f64 = of.iter().enumerate().map(|(k, share)| share * square(k)).sum();
            let width = (4.0 * LN_2 * moment).sqrt();
            assert!((width / 40.0 - 1.0).abs() < 1e-3, "{profile:?} {width}");
        }
    }
}
