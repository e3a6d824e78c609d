//! A Gaussian prior of a grid's numbers, with amplitude and correlation length.
//!
//! The field u of (κ² − Δ)^m u = w with white noise w is a Matérn field with ν = 2 m − 3/2 in three dimensions (Whittle
//! 1954; Lindgren, Rue & Lindström 2011). With second differences for Δ, the inverse of its covariance is a sparse matrix.
//! Edges of the grid are mirrors. There such a field varies more; every node is divided by its own standard deviation, so
//! that the amplitude is the same everywhere.

mod matern;
mod modes;
#[cfg(test)]
mod tests;

pub use matern::{Matern, Roughness};

use super::descent::{Descent, Stop};
use super::ray_weights::Voxels;
use super::scaled::{Convex, Scaled};
use crate::Error;
use crate::fit::loss::regulariser::Shape;
use core::ops::ControlFlow;
use modes::Modes;
use rand::{RngExt, SeedableRng};
use rand_distr::StandardNormal;
use rand_pcg::Pcg64;
use rayon::prelude::*;

/// Most iterations to the nearest field that is nowhere negative, and the part of the first gradient that may be left.
const ENOUGH: Stop = Stop { iterations: 4000, tolerance: 1e-9, settled: 0.0 };

/// A Gaussian field on the nodes of a grid.
///
/// Its density is exp(−|L (x − center)|²/2) with L x = (1 − Δ/κ²)^m (x/s): s makes the standard deviation of the field
/// between the nodes, on average over all points, what is wanted.
#[derive(Clone, Debug)]
pub struct GaussianField {
    law: Matern,
    shape: Shape,
    /// s of each node.
    spread: Vec<f64>,
    /// Amplitude of each wave in a field of unit white noise.
    amplitudes: Vec<f64>,
    /// Field at which the density is highest, emission.
    center: Vec<f64>,
}

/// Square of the amplitude of a wave in a field of unit white noise, by −Δ of the wave (per M²).
fn power(law: &Matern, bend: f64) -> f64 {
    (1.0 + bend / law.kappa().powi(2)).powi(-2 * law.roughness.times() as i32)
}

impl GaussianField {
    /// Puts the law on the nodes of a grid.
    ///
    /// # Errors
    /// If a number is out of its range.
    pub fn new(law: Matern, voxels: &Voxels) -> Result<Self, Error> {
        let law = law.checked()?;
        let share = |modes: &Modes| modes.between_nodes(voxels.degree, |bend| power(&law, bend));
        Self::with_share(law, voxels, share)
    }

    /// The same with the standard deviation that is wanted at the nodes themselves: of fields that are not what is
    /// between the nodes.
    ///
    /// # Errors
    /// If a number is out of its range.
    pub fn at_nodes(law: Matern, voxels: &Voxels) -> Result<Self, Error> {
        Self::with_share(law.checked()?, voxels, |_| 1.0)
    }

    fn with_share(
        law: Matern,
        voxels: &Voxels,
        share: impl FnOnce(&Modes) -> f64,
    ) -> Result<Self, Error> {
        voxels.field()?;
        let shape = voxels.shape();
        let modes = Modes::new(shape);
        let powers: Vec<f64> = modes.bends().into_iter().map(|bend| power(&law, bend)).collect();
        let amplitudes: Vec<f64> = powers.iter().map(|power| power.sqrt()).collect();
        let share = share(&modes);
        // B-splines average over nodes: between these only `share` of the variance is left.
        let spread = |variance: f64| law.amplitude / (share * variance).sqrt();
        let spread: Vec<f64> = modes.sum_of_squares(&powers).into_iter().map(spread).collect();
        let center = vec![law.mean; spread.len()];
        Ok(Self { law, shape, spread, amplitudes, center })
    }

    /// Number of nodes.
    pub fn count(&self) -> usize {
        self.spread.len()
    }

    /// Returns the field at which its density is highest, emission at the nodes.
    pub fn center(&self) -> &[f64] {
        &self.center
    }

    /// A field that it gives, the same for the same seed.
    pub fn drawn(&self, seed: u64) -> Vec<f64> {
        self.of_white(&self.white(seed))
    }

    /// A field that it gives, moved to the nearest one between 0 and `upper`: the least |L (x − draw)|² (Bardsley & Fox
    /// 2012; Everink, Dong & Andersen 2023). The same for the same seed.
    pub fn drawn_between(&self, upper: f64, seed: u64) -> Vec<f64> {
        let draw = self.drawn(seed);
        let start: Vec<f64> = draw.iter().map(|x| x.clamp(0.0, upper)).collect();
        let about = self.clone().about(draw);
        let mut problem = &about;
        let mut each = |_: f64| ControlFlow::Continue(());
        let descent = Descent::new(Scaled::new(&mut problem, upper), &start, &mut each);
        descent.run(ENOUGH).x
    }

    /// Independent normal numbers of variance 1, one for each wave, the same for the same seed.
    pub(super) fn white(&self, seed: u64) -> Vec<f64> {
        let mut random = Pcg64::seed_from_u64(seed);
        (0..self.count()).map(|_| random.sample(StandardNormal)).collect()
    }

    /// The field that such numbers make, with the mean of the law.
    pub(super) fn of_white(&self, white: &[f64]) -> Vec<f64> {
        let waves: Vec<f64> = white.iter().zip(&self.amplitudes).map(|(z, a)| z * a).collect();
        let all = Modes::new(self.shape).sum(&waves);
        all.iter().zip(&self.spread).map(|(x, spread)| self.law.mean + x * spread).collect()
    }

    /// Converts slopes with respect to the field to those with respect to such numbers.
    pub(super) fn to_white(&self, slopes: &[f64]) -> Vec<f64> {
        let spread: Vec<f64> = slopes.iter().zip(&self.spread).map(|(x, s)| x * s).collect();
        let waves = Modes::new(self.shape).project(&spread);
        waves.iter().zip(&self.amplitudes).map(|(x, a)| x * a).collect()
    }

    /// The same density about another field.
    ///
    /// # Panics
    /// If it has another number of values.
    #[must_use]
    pub fn about(self, center: Vec<f64>) -> Self {
        assert!(center.len() == self.count());
        Self { center, ..self }
    }

    /// `factor` times |L (x − center)|²; adds its slopes. In an order that does not depend on the number of threads.
    ///
    /// # Panics
    /// If the lengths are not the number of nodes.
    pub fn value_and_gradient(&self, x: &[f64], factor: f64, slopes: &mut [f64]) -> f64 {
        let away: Vec<f64> = x.iter().zip(&self.center).map(|(x, center)| x - center).collect();
        let white = self.whitened(&away);
        self.add_back(&white, 2.0 * factor, slopes);
        factor * white.iter().map(|x| x * x).sum::<f64>()
    }

    /// Adds `factor` times the second derivatives of |L x|² times a direction.
    pub(super) fn add_curvature(&self, direction: &[f64], factor: f64, out: &mut [f64]) {
        self.add_back(&self.whitened(direction), 2.0 * factor, out);
    }

    /// `factor` times the second derivative of |L x|² with respect to each number, away from the edges.
    pub(super) fn diagonal(&self, factor: f64) -> Vec<f64> {
        // Far from the edges (1 − Δ/κ²)²ᵐ has the same diagonal everywhere: its trace, which is the
        // sum of its eigenvalues, over the number of nodes.
        let mean = self.amplitudes.iter().map(|a| a.powi(-2)).sum::<f64>() / self.count() as f64;
        self.spread.iter().map(|spread| 2.0 * factor * mean / (spread * spread)).collect()
    }

    /// L x.
    fn whitened(&self, x: &[f64]) -> Vec<f64> {
        assert!(x.len() == self.count());
        self.differentiated(x.iter().zip(&self.spread).map(|(x, spread)| x / spread).collect())
    }

    /// Adds `factor` times Lᵀ of white numbers.
    fn add_back(&self, white: &[f64], factor: f64, out: &mut [f64]) {
        assert!(out.len() == self.count());
        let back = self.differentiated(white.to_vec());
        for ((out, x), spread) in out.iter_mut().zip(back).zip(&self.spread) {
            *out += factor * x / spread;
        }
    }

    /// (1 − Δ/κ²)^m x, a symmetric matrix.
    fn differentiated(&self, x: Vec<f64>) -> Vec<f64> {
        (0..self.law.roughness.times()).fold(x, |x, _| self.once(&x))
    }

    /// x − Δx/κ² with mirrors at the edges.
    fn once(&self, x: &[f64]) -> Vec<f64> {
        let ([nx, ny, nz], square) = (self.shape.nodes, self.law.kappa().powi(2));
        let weights = self.shape.spacing.map(|h| 1.0 / (square * h * h));
        let around = [(nx, ny * nz), (ny, nz), (nz, 1)];
        let mut out = vec![0.0; x.len()];
        out.par_chunks_mut(ny * nz).enumerate().for_each(|(i, plane)| {
            for (k, out) in plane.iter_mut().enumerate() {
                let (at, index) = ([i, k / nz, k % nz], i * ny * nz + k);
                *out = x[index];
                for ((at, (n, stride)), weight) in at.iter().zip(around).zip(weights) {
                    // Beyond an edge its mirror image has the same value: no difference.
                    let below = if *at > 0 { x[index] - x[index - stride] } else { 0.0 };
                    let above = if at + 1 < n { x[index] - x[index + stride] } else { 0.0 };
                    *out += weight * (below + above);
                }
            }
        });
        out
    }
}

impl Convex for &GaussianField {
    fn value_and_gradient(&mut self, x: &[f64], gradient: &mut Vec<f64>) -> f64 {
        gradient.clear();
        gradient.resize(x.len(), 0.0);
        GaussianField::value_and_gradient(self, x, 1.0, gradient)
    }

    fn diagonal(&self) -> Vec<f64> {
        GaussianField::diagonal(self, 1.0)
    }
}
