//! Thermal noise.

use super::generator;
use crate::Complex64;
use crate::observation::Observation;
use rand::RngExt;
use rand_distr::StandardNormal;

/// Adds to the real and the imaginary part of every product a normal number with the product's
/// standard deviation.
pub fn add_thermal_noise(observation: &mut Observation, seed: u64) {
    let mut random = generator(seed, 1);
    for row in &mut observation.rows {
        for (product, sigma) in row.products.iter_mut().zip(row.noise_sigma) {
            // Drawn also where there is no product, so that others keep their noise.
            let re: f64 = random.sample(StandardNormal);
            let im: f64 = random.sample(StandardNormal);
            if !sigma.is_nan() {
                *product += Complex64::new(re, im) * sigma;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::observation::{Basis, Measured, Row};

    fn empty_rows(count: usize) -> Observation {
        let mut observation = Observation::empty(Basis::Stokes);
        let zero = Complex64::new(0.0, 0.0);
        let i = Measured { visibility: zero, noise_sigma: 0.25 };
        observation.rows = vec![Row::total_intensity(0.0, [0, 1], [0.0; 2], i); count];
        observation
    }

    /// Mean, variance and correlation of 100,000 draws, within five standard errors.
    #[test]
    fn exact_moments() {
        let count = 100_000;
        let mut observation = empty_rows(count);
        add_thermal_noise(&mut observation, 7);
        let mean = |f: fn(Complex64) -> f64| {
            observation.rows.iter().map(|row| f(row.products[0])).sum::<f64>() / count as f64
        };
        let error = 5.0 / (count as f64).sqrt();
        assert!(mean(|v| v.re).abs() < 0.25 * error && mean(|v| v.im).abs() < 0.25 * error);
        assert!((mean(|v| v.re * v.re) / 0.0625 - 1.0).abs() < error * 1.5);
        assert!((mean(|v| v.im * v.im) / 0.0625 - 1.0).abs() < error * 1.5);
        assert!(mean(|v| v.re * v.im).abs() < 0.0625 * error);
        assert!(observation.rows.iter().all(|row| row.products[1].norm() == 0.0));
    }

    #[test]
    fn exact_same_seed_same_noise() {
        let run = |seed| {
            let mut observation = empty_rows(3);
            add_thermal_noise(&mut observation, seed);
            observation.rows.iter().map(|row| row.products[0]).collect::<Vec<_>>()
        };
        assert_eq!(run(3), run(3));
        assert_ne!(run(3), run(4));
    }
}
