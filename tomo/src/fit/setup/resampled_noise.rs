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
        let of_pixels = |loss: &&Loss| matches!(loss.data, LossKind::Image | LossKind::LightCurve);
        let sigma = losses.iter().filter(of_pixels).filter_map(|loss| loss.sigma).next();
        if let (Some(movie), Some(sigma)) = (&mut copy.movie, sigma) {
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
