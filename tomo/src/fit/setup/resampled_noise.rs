//! The data once more, with other noise.

use super::{FitData, Result};
use crate::fit::settings::{Loss, LossKind};
use kerrlight_vlbi::gains::GainPriors;
use kerrlight_vlbi::noise::add_thermal_noise;
use kerrlight_vlbi::observation::{Observation, Row};
use rand::{RngExt, SeedableRng};
use rand_distr::StandardNormal;
use rand_pcg::Pcg64;
use std::collections::{BTreeMap, BTreeSet};

impl FitData {
    /// The data with noise once more, `factor` times as large as their errors: what might as well have been measured.
    /// Every frame's pixels get that of the loss that they are in; visibilities that of their rows, and where gains are solved for,
    /// other gains of their priors.
    ///
    /// # Errors
    /// If there is no room for the movie.
    pub fn perturbed(&self, losses: &[Loss], factor: f64, seed: u64) -> Result<Self> {
        let mut copy = self.without_truth();
        if let Some((observation, frames)) = &mut copy.visibilities {
            let scale = |row: &mut Row, by: f64| row.noise_sigma.iter_mut().for_each(|s| *s *= by);
            observation.rows.iter_mut().for_each(|row| scale(row, factor));
            add_thermal_noise(observation, seed);
            // Errors stay as they are stated: the noise alone is scaled.
            observation.rows.iter_mut().for_each(|row| scale(row, 1.0 / factor));
            let amplitudes = losses.iter().any(|loss| loss.data == LossKind::Amplitudes);
            if amplitudes || self.gains.as_ref().is_some_and(|of| of.free_phases) {
                debias(observation, frames, factor, amplitudes);
            }
            if let Some(priors) = &self.gains {
                multiply_gains(observation, frames, priors, seed);
            }
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

/// Takes off rows the power of the noise that was added where it is not seen as such: amplitudes of data with noise twice would be
/// too large, since errors are stated for noise once. Of amplitudes that is one of two parts of each; free phases of stations
/// follow as many parts of a frame's noise as there are phases.
fn debias(observation: &mut Observation, frames: &[usize], factor: f64, amplitudes: bool) {
    let basis = observation.basis;
    let mut seen: BTreeMap<usize, (BTreeSet<u16>, f64)> = BTreeMap::new();
    for (row, frame) in observation.rows.iter().zip(frames) {
        if row.stokes_i(basis).is_some() {
            let (stations, rows) = seen.entry(*frame).or_default();
            stations.extend(row.stations);
            *rows += 1.0;
        }
    }
    for (row, frame) in observation.rows.iter_mut().zip(frames) {
        let (Some(i), Some((stations, rows))) = (row.stokes_i(basis), seen.get(frame)) else {
            continue;
        };
        // No more than all, where baselines are not connected.
        let phases = ((stations.len() as f64 - 1.0) / rows).min(1.0);
        let part = if amplitudes { 1.0 } else { phases };
        let square = i.visibility.norm_sqr();
        let left = square - part * (factor * i.noise_sigma).powi(2);
        // A little is left, so that it has a phase.
        let by = (left / square).max(1e-6).sqrt();
        if by.is_finite() {
            row.products.iter_mut().for_each(|product| *product *= by);
        }
    }
}

/// Stream of the random numbers of gains, others than those of noise.
const GAINS: u64 = 0x6761_696e;

/// Multiplies data and their errors by amplitudes of gains that the priors draw, new ones for each frame. A solution for gains then
/// has a prior about other amplitudes than 1: draws vary by what the priors leave open, not by noise alone.
fn multiply_gains(observation: &mut Observation, frames: &[usize], priors: &GainPriors, seed: u64) {
    let mut random = Pcg64::seed_from_u64(seed ^ GAINS);
    let mut draw = || {
        priors.amplitude_sigma.iter().map(|s| s * random.sample::<f64, _>(StandardNormal)).collect()
    };
    let (mut gains, mut drawn): (Vec<f64>, _) = (draw(), 0);
    for (row, frame) in observation.rows.iter_mut().zip(frames) {
        while drawn < *frame {
            (gains, drawn) = (draw(), drawn + 1);
        }
        let [first, second] = row.stations.map(|k| gains[usize::from(k)]);
        let factor = (first + second).exp();
        row.products.iter_mut().for_each(|product| *product *= factor);
        row.noise_sigma.iter_mut().for_each(|sigma| *sigma *= factor);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use kerrlight_common::frames::Frames;
    use kerrlight_vlbi::Complex64;
    use kerrlight_vlbi::array::Station;
    use kerrlight_vlbi::observation::{Basis, Measured};
    use kerrlight_vlbi::products::debiased_amplitude;

    /// Gains of two stations of a prior of 0.3 scatter the amplitudes of a frame by √2 times as much, and σ with them.
    #[test]
    fn exact_gains_of_draws_scatter_as_their_priors_say() {
        let mut observation = Observation::empty(Basis::Stokes);
        observation.stations = ["A", "B"].map(Station::named).to_vec();
        let frames: Vec<usize> = (0..2000).collect();
        let i = Measured { visibility: Complex64::new(1.0, 0.0), noise_sigma: 1e-9 };
        let row = |k: &usize| Row::total_intensity(*k as f64, [0, 1], [1e9, 0.0], i);
        observation.rows = frames.iter().map(row).collect();
        let gains = Some(GainPriors { free_phases: false, amplitude_sigma: vec![0.3; 2] });
        let visibilities = Some((observation, frames));
        let data = FitData { visibilities, gains, ..FitData::default() };
        let drawn = data.perturbed(&[], 1.0, 5).unwrap().visibilities.unwrap().0;
        let squares = drawn.rows.iter().map(|row| row.products[0].norm().ln().powi(2));
        let scatter = (squares.sum::<f64>() / 2000.0).sqrt();
        assert!((scatter / (0.3 * 2f64.sqrt()) - 1.0).abs() < 0.06, "{scatter}");
        for row in &drawn.rows {
            assert!((row.noise_sigma[0] / row.products[0].norm() / 1e-9 - 1.0).abs() < 1e-6);
        }
    }

    /// Amplitudes of data with noise once more are about those of the data, at a signal to noise of 3 too.
    #[test]
    fn exact_noise_once_more_makes_no_amplitude_larger() {
        let one = Measured { visibility: Complex64::new(3.0, 0.0), noise_sigma: 1.0 };
        let row = Row::total_intensity(0.0, [0, 1], [1e9, 0.0], one);
        let rows = 4000;
        let observation =
            Observation { rows: vec![row; rows], ..Observation::empty(Basis::Stokes) };
        let visibilities = Some((observation, vec![0; rows]));
        let data = FitData { visibilities, ..FitData::default() };
        let mean = |losses: &[Loss]| {
            let drawn = data.perturbed(losses, 1.0, 3).unwrap().visibilities.unwrap().0;
            let all = drawn.stokes_i().map(|(_, i)| debiased_amplitude(&i));
            all.sum::<f64>() / rows as f64
        };
        let amplitudes = mean(&[Loss::new(LossKind::Amplitudes)]);
        assert!((amplitudes - debiased_amplitude(&one)).abs() < 0.08, "{amplitudes}");
        // With phases nothing is lost: the noise stays what it is.
        assert!(mean(&[Loss::new(LossKind::Visibilities)]) > debiased_amplitude(&one) + 0.1);
    }

    /// Sums of pixels scatter by the error of the total flux, pixels of images by their own.
    #[test]
    fn exact_noise_of_a_flux_is_that_of_all_pixels() {
        let (pixels, frames, sigma) = (256, 400, 0.02);
        let movie = Some(Frames::of(vec![0.0; frames * pixels], pixels));
        let data = FitData { movie, ..FitData::default() };
        let loss = |data| Loss { sigma: Some(sigma), ..Loss::new(data) };
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
