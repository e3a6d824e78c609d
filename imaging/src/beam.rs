//! Images as a round beam sees them.

use core::f64::consts::LN_2;

/// Convolved with a round Gaussian of this full width at half maximum, pixels; light that leaves the field is lost.
pub fn blurred(image: &[f64], side: usize, fwhm: f64) -> Vec<f64> {
    let sigma = fwhm / (8.0 * LN_2).sqrt();
    let bell = |k: usize| (-0.5 * (k as f64 / sigma).powi(2)).exp();
    // The sum of what is sampled, not the integral: a beam narrower than a pixel makes no light.
    let reach = (9.0 * sigma) as usize + 1;
    let total = bell(0) + 2.0 * (1..=reach).map(bell).sum::<f64>();
    let kernel: Vec<f64> = (0..side).map(|k| bell(k) / total).collect();
    let along = |value: &dyn Fn(usize) -> f64, at: usize| -> f64 {
        (0..side).map(|k| kernel[k.abs_diff(at)] * value(k)).sum()
    };
    let pixels = 0..side * side;
    // A round Gaussian is a product of one along rows and one along columns.
    let rows: Vec<f64> =
        pixels.clone().map(|k| along(&|j| image[k / side * side + j], k % side)).collect();
    pixels.map(|k| along(&|i| rows[i * side + k % side], k / side)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A point becomes a Gaussian whose flux stays and whose half width is that of the beam.
    #[test]
    fn exact_blurring_keeps_flux_and_has_the_width_of_the_beam() {
        let mut image = vec![0.0; 41 * 41];
        image[20 * 41 + 20] = 2.0;
        let blurred = blurred(&image, 41, 8.0);
        assert!((blurred.iter().sum::<f64>() - 2.0).abs() < 1e-6);
        let half = blurred[20 * 41 + 24] / blurred[20 * 41 + 20];
        assert!((half - 0.5).abs() < 1e-12, "{half}");
    }

    /// Beams down to a hundredth of a pixel neither make nor lose light.
    #[test]
    fn exact_narrow_beams_keep_flux() {
        let mut image = vec![0.0; 81];
        image[40] = 2.0;
        for fwhm in [0.01, 0.3, 0.7, 1.2] {
            let flux: f64 = blurred(&image, 9, fwhm).iter().sum();
            assert!((flux - 2.0).abs() < 1e-12, "{fwhm}: {flux}");
        }
    }
}
