//! The data once more, with other noise.

use super::{FitData, Result};
use crate::fit::settings::{Loss, LossKind};
use kerrlight_vlbi::noise::add_thermal_noise;
use kerrlight_vlbi::observation::Row;
use rand::{RngExt, SeedableRng};
use rand_distr::StandardNormal;
use rand_pcg::Pcg64;

impl FitData {
    /// The data with noise once more, `factor` times as large as their errors: what might as well have been measured.
    /// Every frame's pixels get that of the loss that they are in; visibilities that of their rows.
    ///
    /// # Errors
    /// If there is no room for the movie.
    pub fn perturbed(&self, losses: &[Loss], factor: f64, seed: u64) -> Result<Self> {
        let mut copy = self.without_truth();
        if let Some((observation, _)) = &mut copy.visibilities {
            let scale = |row: &mut Row, by: f64| row.noise_sigma.iter_mut().for_each(|s| *s *= by);
            observation.rows.iter_mut().for_each(|row| scale(row, factor));
            add_thermal_noise(observation, seed);
            // Errors stay as they are stated: the noise alone is scaled.
            observation.rows.iter_mut().for_each(|row| scale(row, 1.0 / factor));
        }
        let of = |kind: LossKind| losses.iter().find(|loss| loss.data == kind)?.sigma;
        if let Some(movie) = &mut copy.movie
            // The noise of a total flux is that of all of its pixels.
            && let Some(sigma) = of(LossKind::Image).or_else(|| {
                Some(of(LossKind::LightCurve)? / (movie.pixels() as f64).sqrt())
            })
        {
            let mut random = Pcg64::seed_from_u64(seed);
            let mut noisy = |pixel: &f64| {
                let noise: f64 = random.sample(StandardNormal);
                pixel + factor * sigma * noise
            };
            *movie =
                movie.mapped(movie.pixels(), |image| image.iter().map(&mut noisy).collect())?;
        }
        if let Some(curve) = &mut copy.curve {
            let mut random = Pcg64::seed_from_u64(seed);
            for [flux, sigma] in curve.data.iter_mut().flatten() {
                let noise: f64 = random.sample(StandardNormal);
                *flux += factor * *sigma * noise;
            }
        }
        Ok(copy)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use kerrlight_common::frames::Frames;

    /// Sums of pixels scatter by the error of the total flux, pixels of images by their own.
    #[test]
    fn exact_noise_of_a_flux_is_that_of_all_pixels() {
        let (pixels, frames, sigma) = (256, 400, 0.02);
        let movie = Some(Frames::of(vec![0.0; frames * pixels], pixels));
        let data = FitData { movie, ..FitData::empty() };
        let loss =
            |data| Loss { data, weight: 1.0, sigma: Some(sigma), stokes: None, least_snr: None };
        let scatter = |losses: &[Loss]| {
            let movie = data.perturbed(losses, 1.5, 7).unwrap().movie.unwrap();
            let fluxes = movie.sums().unwrap();
            (fluxes.iter().map(|flux| flux * flux).sum::<f64>() / frames as f64).sqrt()
        };
        let [flux, image] = [LossKind::LightCurve, LossKind::Image].map(loss);
        // 3.5 % of the standard deviation of 400 numbers is one of its own.
        assert!((scatter(std::slice::from_ref(&flux)) / (1.5 * sigma) - 1.0).abs() < 0.14);
        assert!((scatter(&[flux, image]) / (1.5 * sigma * 16.0) - 1.0).abs() < 0.14);
    }
}
