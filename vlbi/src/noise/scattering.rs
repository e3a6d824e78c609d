//! The interstellar medium towards Sgr A*.

use crate::Error;
use crate::observation::{Observation, Row, Unknown};
use core::f64::consts::PI;
use kerrlight_common::units::{MICROARCSECOND, SPEED_OF_LIGHT};

/// A Gaussian kernel whose width grows with the square of the wavelength: diffractive scattering.
/// (At 1.3 mm the true kernel has a little more power on long baselines; refraction is left out.)
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ScatteringKernel {
    /// Full width at half maximum along the major axis in µas at 1 cm.
    pub major_uas: f64,
    /// Along the minor axis, µas.
    pub minor_uas: f64,
    /// Position angle of the major axis in degrees east of north.
    pub position_angle_deg: f64,
}

impl ScatteringKernel {
    /// Sgr A* (Johnson et al. 2018, ApJ 865, 104): 1.380 × 0.703 mas at 1 cm, 81.9° east of north.
    pub const SGR_A: Self =
        ScatteringKernel { major_uas: 1380.0, minor_uas: 703.0, position_angle_deg: 81.9 };

    /// The kernel's Fourier transform, real, at (u, v) in wavelengths.
    pub fn transform(&self, uv: [f64; 2], frequency_hz: f64) -> f64 {
        let squared_cm = (100.0 * SPEED_OF_LIGHT / frequency_hz).powi(2);
        let (sin, cos) = self.position_angle_deg.to_radians().sin_cos();
        // East is u, north is v: the major axis points along (sin, cos).
        let along = [uv[0] * sin + uv[1] * cos, uv[0] * cos - uv[1] * sin];
        let widths = [self.major_uas, self.minor_uas];
        let exponent: f64 = along
            .iter()
            .zip(widths)
            .map(|(q, fwhm)| (PI * q * fwhm * squared_cm * MICROARCSECOND).powi(2))
            .sum();
        (-exponent / (4.0 * core::f64::consts::LN_2)).exp()
    }
}

/// Multiplies all visibilities by a kernel's transform.
///
/// # Errors
/// If the frequency is not known.
pub fn scatter(observation: &mut Observation, kernel: &ScatteringKernel) -> Result<(), Error> {
    let factors = factors(observation, kernel)?;
    for (row, factor) in observation.rows.iter_mut().zip(factors) {
        row.products.iter_mut().for_each(|product| *product *= factor);
    }
    Ok(())
}

/// Divides all visibilities and their errors by a kernel's transform: a model without scattering fits them as the
/// scattered model fits the data, with the same χ² (Fish et al. 2014, ApJ 795, 134).
///
/// # Errors
/// If the frequency is not known.
pub fn unscatter(observation: &mut Observation, kernel: &ScatteringKernel) -> Result<(), Error> {
    let factors = factors(observation, kernel)?;
    for (row, factor) in observation.rows.iter_mut().zip(factors) {
        row.products.iter_mut().for_each(|product| *product /= factor);
        row.noise_sigma.iter_mut().for_each(|sigma| *sigma /= factor);
    }
    Ok(())
}

/// A kernel's transform on every row.
fn factors(observation: &Observation, kernel: &ScatteringKernel) -> Result<Vec<f64>, Unknown> {
    let factor = |row: &Row| {
        let frequency_hz = observation.frequency_of(row).ok_or(Unknown("the frequency"))?;
        Ok(kernel.transform(row.uv, frequency_hz))
    };
    observation.rows.iter().map(factor).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A Gaussian falls to half its peak at q = 2 ln 2/(π·FWHM).
    #[test]
    fn exact_half_width_along_both_axes() {
        let kernel = ScatteringKernel::SGR_A;
        let frequency = 230e9;
        let (sin, cos) = 81.9f64.to_radians().sin_cos();
        let squared_cm = (100.0 * SPEED_OF_LIGHT / frequency).powi(2);
        for (fwhm, along) in [(1380.0, [sin, cos]), (703.0, [-cos, sin])] {
            let q = 2.0 * core::f64::consts::LN_2 / (PI * fwhm * squared_cm * MICROARCSECOND);
            let half = kernel.transform(along.map(|x| q * x), frequency);
            assert!((half - 0.5).abs() < 1e-12, "{half}");
        }
        assert_eq!(kernel.transform([0.0, 0.0], frequency), 1.0);
        // 22 µas wide at 230 GHz, and blurring most along east-west baselines.
        assert!(kernel.transform([8e9, 0.0], frequency) < kernel.transform([0.0, 8e9], frequency));
    }
}
