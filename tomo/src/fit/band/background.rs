//! Background of a flare: in each Stokes parameter a constant and a stationary process, Gaussian and independent of each
//! other, whose values are unknown and whose sizes are assumed.
//!
//! Dividing data and rows by the factor of its covariance leaves a problem with white noise. The data that are used come
//! first, so that the others have no part in theirs.

use super::field::{part, some};
use super::{Band, CurveRows};
use crate::Error;
use crate::fit::linear::Roughness;
use nalgebra::{DMatrix, DVector};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Light that no flare explains, of the same size in each Stokes parameter. With s = |t − t′|/τ what varies has a
/// correlation of exp(−s), a damped random walk, or (1 + √5 s + 5 s²/3) exp(−√5 s).
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Background {
    /// Standard deviation of the constant, Jy.
    #[serde(rename = "constant_jy")]
    #[schemars(range(min = 0.0, max = 1000.0), extend("unit" = "Jy"))]
    pub constant: f64,
    /// Standard deviation of what varies, Jy.
    #[serde(rename = "variation_jy")]
    #[schemars(range(min = 0.0, max = 1000.0), extend("unit" = "Jy"))]
    pub variation: f64,
    /// Its correlation time τ, minutes.
    #[serde(rename = "correlation_min")]
    #[schemars(range(min = 1e-3, max = 1e6), extend("unit" = "minutes"))]
    pub minutes: f64,
    /// ν of its Matérn covariance.
    #[serde(rename = "matern")]
    pub roughness: Roughness,
}

impl Default for Background {
    fn default() -> Self {
        Self::NONE
    }
}

impl Background {
    /// Darkness.
    pub const NONE: Self =
        Self { constant: 0.0, variation: 0.0, minutes: 1.0, roughness: Roughness::Half };

    fn is_none(&self) -> bool {
        self.constant == 0.0 && self.variation == 0.0
    }

    /// Itself, if its numbers are in their ranges.
    pub(super) fn checked(self) -> Result<Self, Error> {
        let ok = |x: f64| x >= 0.0 && x.is_finite();
        Error::check("constant", self.constant, ok(self.constant), "0 or above")?;
        Error::check("variation", self.variation, ok(self.variation), "0 or above")?;
        let lasts = self.minutes > 0.0 && self.minutes.is_finite();
        Error::check("minutes", self.minutes, lasts, "above 0")?;
        Ok(self)
    }

    /// One that is drawn at some times (minutes), from numbers of a normal distribution: as many.
    ///
    /// # Errors
    /// If a number of it is out of its range.
    pub fn drawn(self, minutes: &[f64], normal: &[f64]) -> Result<Vec<f64>, Error> {
        let background = self.checked()?;
        if background.is_none() {
            return Ok(vec![0.0; minutes.len()]);
        }
        let scale = background.constant.hypot(background.variation);
        let Self { constant, variation, .. } = background;
        // In units of the scale no square leaves the range of numbers.
        let relative =
            Self { constant: constant / scale, variation: variation / scale, ..background };
        let entry = |a: usize, b: usize| {
            // Smooth processes have covariances that are singular to rounding.
            let own = if a == b { 1e-10 } else { 0.0 };
            relative.covariance(minutes[a] - minutes[b]) + own
        };
        let factor = DMatrix::from_fn(minutes.len(), minutes.len(), entry).cholesky();
        let wild = || Error::out_of_range("minutes", background.minutes, "times that differ");
        let light = factor.ok_or_else(wild)?.unpack() * DVector::from_row_slice(normal) * scale;
        Ok(light.as_slice().to_vec())
    }

    /// Covariance of two values that are so many minutes apart, Jy².
    fn covariance(&self, apart: f64) -> f64 {
        let correlation = self.roughness.correlation(apart.abs() / self.minutes);
        self.constant.powi(2) + self.variation.powi(2) * correlation
    }
}

/// Times of the data of a light curve, and their errors.
#[derive(Clone, Debug, PartialEq)]
pub struct Sampling {
    /// Minutes of the samples, from any time on.
    pub minutes: Vec<f64>,
    /// One over the standard deviation of each number, 1/Jy, sample by sample; 0 where there is none.
    pub scales: Vec<f64>,
}

impl Sampling {
    /// Numbers of a sample.
    fn parameters(&self) -> usize {
        self.scales.len() / self.minutes.len().max(1)
    }

    /// The covariance of all data over their standard deviations.
    fn covariance(&self, background: &Background) -> DMatrix<f64> {
        let (data, count) = (self.scales.len(), self.parameters());
        DMatrix::from_fn(data, data, |a, b| match a % count == b % count {
            true => {
                let apart = self.minutes[a / count] - self.minutes[b / count];
                background.covariance(apart) * self.scales[a] * self.scales[b]
            }
            false => 0.0,
        })
    }
}

/// Some data over the factor of the covariance that noise and background give them.
pub(super) struct Whitening {
    factor: Option<DMatrix<f64>>,
    /// Logarithm of the determinant of that covariance, over the standard deviations of the data.
    pub ln_determinant: f64,
}

impl Whitening {
    /// Takes the data with these numbers.
    pub fn new(curve: &CurveRows, background: &Background, used: &[usize]) -> Result<Self, Error> {
        let background = background.checked()?;
        if background.is_none() {
            return Ok(Self { factor: None, ln_determinant: 0.0 });
        }
        let mut matrix = part(&curve.sampling.covariance(&background), used, used);
        // Noise: data are over their standard deviations.
        (0..used.len()).for_each(|k| matrix[(k, k)] += 1.0);
        let wild = || Error::out_of_range("constant", background.constant, "smaller numbers");
        let factor = matrix.cholesky().ok_or_else(wild)?.unpack();
        let ln_determinant = 2.0 * factor.diagonal().iter().map(|x| x.ln()).sum::<f64>();
        Ok(Self { factor: Some(factor), ln_determinant })
    }

    /// Columns over the factor.
    pub fn columns(&self, columns: DMatrix<f64>) -> DMatrix<f64> {
        match &self.factor {
            None => columns,
            Some(factor) => {
                factor.solve_lower_triangular(&columns).unwrap_or_else(|| columns * f64::NAN)
            }
        }
    }

    /// A covariance over the factor from both sides.
    pub fn covariance(&self, covariance: &DMatrix<f64>) -> DMatrix<f64> {
        match &self.factor {
            None => covariance.clone(),
            // L⁻¹ (L⁻¹ C)ᵀ = L⁻¹ C L⁻ᵀ, since C is symmetric.
            Some(_) => self.columns(self.columns(covariance.clone()).transpose()),
        }
    }
}

impl CurveRows {
    /// The covariance that the background of a band gives all data, over their standard deviations.
    pub(super) fn of_background(&self, background: &Background) -> DMatrix<f64> {
        self.sampling.covariance(background)
    }
}

/// Returns the expected background at all data, its standard deviation (both over those of the data), and the covariance with
/// the other one of two numbers of a sample, given the data that are used and a band; 0 where the data have no standard
/// deviation.
///
/// # Errors
/// If the band has no node.
pub fn expected_background(
    curve: &CurveRows,
    data: &[f64],
    band: &Band,
) -> Result<Vec<[f64; 3]>, Error> {
    let used = curve.numbers(true);
    let all: Vec<usize> = (0..curve.data()).collect();
    let own = curve.of_background(&band.background);
    let none = || Error::out_of_range("radius of the band", band.radius, "that of any node");
    // The flare is integrated out: beside the background it is noise of a known covariance.
    let mut together = part(&(curve.seen(band).ok_or_else(none)?.full(band) + &own), &used, &used);
    (0..used.len()).for_each(|k| together[(k, k)] += 1.0);
    let together = together.cholesky().ok_or_else(none)?;
    let across = part(&own, &used, &all);
    let solved = together.solve(&across);
    let expected = solved.tr_mul(&some(data, &used));
    let covariance = |a: usize, b: usize| own[(a, b)] - across.column(a).dot(&solved.column(b));
    let are_pairs = curve.sampling.parameters() == 2;
    let beside = |k: usize| if are_pairs { covariance(k, k ^ 1) } else { 0.0 };
    let deviation = |k: usize| covariance(k, k).max(0.0).sqrt();
    Ok(all.iter().map(|k| [expected[*k], deviation(*k), beside(*k)]).collect())
}
