//! Light that is expected.

use crate::start::{bell, shares};
use core::f64::consts::{LN_2, PI};
use kerrlight_vlbi::operator::ImageGrid;

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
        // The entropy divides by these shares, and both profiles underflow far out.
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

#[cfg(test)]
mod tests {
    use super::*;
    use kerrlight_common::units::MICROARCSECOND;

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
