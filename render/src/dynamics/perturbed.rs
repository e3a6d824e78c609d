//! Velocities that differ from a smooth law by chance.

use super::AngularVelocity;
use super::angular_velocity::first_wrong;
use super::law::Perturbed;
use crate::Error;
use nalgebra::{DMatrix, DVector};
use rand::{RngExt, SeedableRng};
use rand_distr::StandardNormal;
use rand_pcg::Pcg64;

/// Rows of the table.
const ROWS: usize = 100;

/// The process has mean 0 and covariance s² exp(−(r − r')²/(2 ℓ²)), as in the mismatch study of Levis et al. 2022 (their
/// Fig. 7).
impl Perturbed {
    fn check(&self) -> Result<(), Error> {
        let Self { deviation, correlation_length: length, radii: [first, last], .. } = *self;
        let grow = first > 0.0 && first < last && last.is_finite();
        first_wrong([
            ("deviation", deviation, deviation >= 0.0 && deviation.is_finite(), "0 or above"),
            ("correlation_length", length, length > 0.0 && length.is_finite(), "above 0"),
            ("radii", first, grow, "above 0, growing"),
        ])
    }

    /// Radii of the table.
    fn table(&self) -> Vec<f64> {
        let [first, last] = self.radii;
        let step = (last - first) / (ROWS - 1) as f64;
        (0..ROWS).map(|k| first + step * k as f64).collect()
    }

    /// Draws the perturbation of the velocity at each radius. The square root of the covariance comes
    /// from its eigenvectors: a process that is smooth on the scale of the table has hardly any of
    /// full rank.
    fn draw(&self, radii: &[f64], seed: u64) -> Vec<f64> {
        let covariance = |i: usize, k: usize| {
            let apart = (radii[i] - radii[k]) / self.correlation_length;
            (-0.5 * apart * apart).exp()
        };
        let parts = DMatrix::from_fn(radii.len(), radii.len(), covariance).symmetric_eigen();
        let mut random = Pcg64::seed_from_u64(seed);
        let along = DVector::from_fn(radii.len(), |k, _| {
            let normal: f64 = random.sample(StandardNormal);
            // Eigenvalues that are 0 may come out below it by rounding.
            normal * parts.eigenvalues[k].max(0.0).sqrt()
        });
        let drawn = parts.eigenvectors * along;
        drawn.iter().map(|x| self.deviation * x).collect()
    }
}

impl AngularVelocity {
    /// A table of this velocity with a perturbation, drawn from the seed, added to it.
    ///
    /// # Errors
    /// If a number of the perturbation is out of its range.
    pub(super) fn perturbed(&self, by: &Perturbed, seed: u64) -> Result<Self, Error> {
        by.check()?;
        let radii = by.table();
        let drawn = by.draw(&radii, seed);
        let rates = radii.iter().zip(drawn).map(|(r, by)| self.rate(*r) + by).collect();
        Self::Table { radii, rates }.checked()
    }
}

#[cfg(test)]
mod tests {
    use super::super::Velocity;
    use super::*;

    fn by() -> Perturbed {
        let of = Box::new(Velocity::Keplerian { drag: None });
        let (deviation, radii) = (0.3, [1.0, 10.0]);
        Perturbed { of, deviation, correlation_length: 0.5, radii, seed: None }
    }

    /// Variance and correlations of many draws are those of the process.
    #[test]
    fn exact_moments_of_the_process() {
        let radii = by().table();
        let draws: Vec<Vec<f64>> = (0..4000).map(|seed| by().draw(&radii, seed)).collect();
        let mean = |i: usize, k: usize| {
            draws.iter().map(|d| d[i] * d[k]).sum::<f64>() / draws.len() as f64
        };
        for (i, k) in [(0, 0), (50, 50), (50, 55), (50, 60), (10, 90)] {
            let apart = (radii[i] - radii[k]) / 0.5;
            let exact = 0.09 * (-0.5 * apart * apart).exp();
            // Three standard deviations of the mean of 4000 products.
            assert!((mean(i, k) - exact).abs() < 3.0 * 0.09 * (2.0f64 / 4000.0).sqrt(), "{i} {k}");
        }
    }

    #[test]
    fn exact_no_deviation_is_the_velocity() {
        let law = AngularVelocity::bhnerf();
        let same = law.perturbed(&Perturbed { deviation: 0.0, ..by() }, 3).unwrap();
        let again = law.perturbed(&by(), 3).unwrap();
        assert_eq!(again, law.perturbed(&by(), 3).unwrap());
        assert_ne!(again, law.perturbed(&by(), 4).unwrap());
        for r in [1.0, 1.0 + 9.0 * 27.0 / 99.0, 10.0] {
            assert!((same.rate(r) - law.rate(r)).abs() < 1e-12 * law.rate(r).abs());
        }
    }

    #[test]
    fn numbers_out_of_range_are_named() {
        let law = AngularVelocity::bhnerf();
        let text = |by: Perturbed| law.perturbed(&by, 1).unwrap_err().to_string();
        assert!(text(Perturbed { correlation_length: 0.0, ..by() }).contains("correlation_length"));
    }
}
