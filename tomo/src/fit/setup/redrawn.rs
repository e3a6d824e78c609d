//! The data once more, with other noise.

use super::{Measured, Result};
use crate::fit::settings::{Loss, LossKind};
use kerrlight_vlbi::Complex64;
use kerrlight_vlbi::noise::add_thermal_noise;
use kerrlight_vlbi::observation::Row;
use kerrlight_vlbi::operator::{Method, Operator, Transform};
use rand::{RngExt, SeedableRng};
use rand_distr::StandardNormal;
use rand_pcg::Pcg64;

impl Measured {
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

    /// What would have been measured of a static image, with the gains that explain the data best beside it and with other
    /// noise. Data without visibilities stay as they are.
    ///
    /// # Errors
    /// If data make no term.
    pub fn redrawn(&self, losses: &[Loss], image: &[f64], seed: u64) -> Result<Self> {
        let mut copy = self.without_truth();
        let (Some((observation, _)), Some(sky)) = (&mut copy.visibilities, self.sky) else {
            return Ok(copy);
        };
        let uv: Vec<[f64; 2]> = observation.stokes_i().map(|(row, _)| row.uv).collect();
        let transform = Transform::<f64>::new(sky, self.pulse, &[uv], Method::Direct, 0)?;
        let mut model = vec![Complex64::default(); transform.data()];
        transform.forward(image, &mut model);
        let gains = self.gains(losses, &model)?.unwrap_or_default();
        let gains = gains.by_station();
        let basis = observation.basis;
        let names: Vec<String> = observation.stations.iter().map(|s| s.name.clone()).collect();
        let seen = observation.rows.iter_mut().filter(|row| row.stokes_i(basis).is_some());
        for (row, v) in seen.zip(model) {
            let [first, second] = row
                .stations
                .map(|k| gains.at(&names[usize::from(k)], row.time_h).unwrap_or(1.0.into()));
            // Both parallel hands; in a basis of Stokes parameters the second has no part in I.
            let v = v * first * second.conj();
            (row.products[0], row.products[1]) = (v, v);
        }
        add_thermal_noise(observation, seed);
        Ok(copy)
    }
}
