//! Visibilities, or amplitudes, with gains that are solved for beside every model.

pub use tangent::TangentTerm;

use super::{DataTerm, DataTermError, Residual, checked, stations_of};
use crate::Complex64;
use crate::Error;
use crate::gains::{GainPriors, GainProblem, ScanGains};
use crate::observation::Observation;
use crate::operator::Float;
use crate::products::debiased_amplitude;
use nalgebra::DMatrix;
use num_complex::Complex;

/// χ² = min over gains of Σ |g₁ ḡ₂ V − D|²/σ² + Σ (ln|g|/s)²: variable projection (Golub & Pereyra 1973). By the envelope
/// theorem its gradient is that with the gains held. The data are those of one scan.
///
/// Data term of visibilities or amplitudes with free gains. For amplitudes it is Σ (|g₁ g₂ V| − A)²/σ² + Σ (ln|g|/s)²
/// with debiased A.
#[derive(Debug, Clone)]
pub struct GainTerm {
    problem: GainProblem,
    data: Vec<Complex64>,
    sigma: Vec<f64>,
    baselines: Vec<[u16; 2]>,
    /// Stations that take part.
    stations: Vec<u16>,
    amplitudes_only: bool,
}

impl GainTerm {
    /// Takes the Stokes I of a scan, in its order; `priors` are those of all stations of the observation.
    ///
    /// # Errors
    /// If there are no data, or an error is not positive.
    pub fn visibilities(observation: &Observation, priors: &GainPriors) -> Result<Self, Error> {
        let data = checked(observation)?.iter().map(|m| m.visibility).collect();
        Self::new(observation, priors, data, false)
    }

    /// Takes the amplitudes of a scan, which gains' phases do not change.
    ///
    /// # Errors
    /// As for [`visibilities`](Self::visibilities).
    pub fn amplitudes(observation: &Observation, priors: &GainPriors) -> Result<Self, Error> {
        let data = checked(observation)?.iter().map(|m| debiased_amplitude(m).into()).collect();
        let priors = GainPriors { free_phases: false, ..priors.clone() };
        Self::new(observation, &priors, data, true)
    }

    fn new(
        observation: &Observation,
        priors: &GainPriors,
        data: Vec<Complex64>,
        amplitudes_only: bool,
    ) -> Result<Self, Error> {
        let sigma: Vec<f64> = checked(observation)?.iter().map(|m| m.noise_sigma).collect();
        let variance: Vec<f64> = sigma.iter().map(|sigma| sigma * sigma).collect();
        // σ² may underflow where σ does not.
        let bad = variance.iter().position(|v| !v.recip().is_finite());
        if let Some(index) = bad {
            return Err(DataTermError::Overflow { index, sigma: sigma[index] }.into());
        }
        let baselines = stations_of(observation);
        let mut stations: Vec<u16> = baselines.iter().flatten().copied().collect();
        stations.sort_unstable();
        stations.dedup();
        let at = |k: u16| stations.partition_point(|s| *s < k);
        let pairs = baselines.iter().map(|pair| pair.map(at)).collect();
        let problem = GainProblem::new(pairs, data.clone(), &variance, &priors.of(&stations));
        Ok(Self { problem, data, sigma, baselines, stations, amplitudes_only })
    }

    /// Stations that take part, in order.
    pub fn stations(&self) -> &[u16] {
        &self.stations
    }

    /// The gains that explain the data best beside a model, and their standard deviations (ln|g|; arg g in radians).
    pub fn gains<T: Float>(&self, model: &[Complex<T>]) -> (ScanGains, ScanGains) {
        let model = self.seen(model);
        let gains = self.problem.solve(&model);
        let errors = self.problem.errors(&model, &gains);
        (gains, errors)
    }

    /// Returns the quantities that gains act upon: visibilities of the model, or their amplitudes.
    fn seen<T: Float>(&self, model: &[Complex<T>]) -> Vec<Complex64> {
        assert_eq!(model.len(), self.data.len());
        let of = |v: &Complex<T>| Complex64::new(v.re.double(), v.im.double());
        let amplitude = |v: Complex64| if self.amplitudes_only { v.norm().into() } else { v };
        model.iter().map(of).map(amplitude).collect()
    }

    /// (g₁ ḡ₂ V − D)/σ of every baseline.
    fn misses(&self, model: &[Complex64], gains: &ScanGains) -> Vec<Complex64> {
        let miss = |k: usize| {
            (gains.on(self.problem.pairs()[k]) * model[k] - self.data[k]) / self.sigma[k]
        };
        (0..self.data.len()).map(miss).collect()
    }

    /// Real numbers of a datum.
    fn parts(&self) -> usize {
        if self.amplitudes_only { 1 } else { 2 }
    }

    /// Stations whose amplitude is free, with 1/s².
    fn amplitudes_free(&self) -> Vec<(usize, f64)> {
        let free = |k: usize| self.problem.precision(k).map(|p| (k, p));
        (0..self.stations.len()).filter_map(free).collect()
    }

    fn phases_free(&self) -> Vec<usize> {
        (0..self.stations.len()).filter(|k| self.problem.has_phase(*k)).collect()
    }

    /// Residuals of data and of priors.
    fn all_residuals(&self, misses: &[Complex64], gains: &ScanGains) -> Vec<Residual> {
        let part = |value: f64, datum: f64, stations: &[u16]| Residual {
            value,
            datum,
            freedom: 1.0,
            stations: stations.to_vec(),
        };
        let mut all = Vec::new();
        for (k, miss) in misses.iter().enumerate() {
            let datum = self.data[k] / self.sigma[k];
            all.push(part(miss.re, datum.re, &self.baselines[k]));
            if !self.amplitudes_only {
                all.push(part(miss.im, datum.im, &self.baselines[k]));
            }
        }
        for (k, precision) in self.amplitudes_free() {
            let value = precision.sqrt() * gains.log_amplitude[k];
            all.push(part(value, 0.0, &self.stations[k..=k]));
        }
        all
    }

    /// Derivatives of residuals with respect to the amplitudes (ln|g|) and phases that are free.
    fn slopes(&self, model: &[Complex64], gains: &ScanGains) -> DMatrix<f64> {
        let (amplitudes, phases) = (self.amplitudes_free(), self.phases_free());
        let (parts, data) = (self.parts(), self.parts() * self.data.len());
        let columns = amplitudes.len() + phases.len();
        let mut slopes = DMatrix::zeros(data + amplitudes.len(), columns);
        let mut put = |k: usize, column: usize, slope: Complex64| {
            slopes[(parts * k, column)] += slope.re;
            if parts == 2 {
                slopes[(2 * k + 1, column)] += slope.im;
            }
        };
        for (k, pair) in self.problem.pairs().iter().enumerate() {
            let seen = gains.on(*pair) * model[k] / self.sigma[k];
            for (station, sign) in [(pair[0], 1.0), (pair[1], -1.0)] {
                if let Some(column) = amplitudes.iter().position(|(s, _)| *s == station) {
                    put(k, column, seen);
                }
                if let Some(column) = phases.iter().position(|s| *s == station) {
                    put(k, amplitudes.len() + column, Complex64::new(0.0, sign) * seen);
                }
            }
        }
        for (row, (_, precision)) in amplitudes.iter().enumerate() {
            slopes[(data + row, row)] = precision.sqrt();
        }
        slopes
    }
}

impl<T: Float> DataTerm<T> for GainTerm {
    fn visibilities(&self) -> usize {
        self.data.len()
    }

    /// Data less one for each phase that is free. Each amplitude takes away as much as its prior adds.
    fn degrees_of_freedom(&self) -> usize {
        self.parts() * self.data.len() - self.phases_free().len()
    }

    fn value_and_gradient(
        &self,
        model: &[Complex<T>],
        weight: T,
        gradient: &mut [Complex<T>],
    ) -> f64 {
        assert_eq!(gradient.len(), self.data.len());
        let seen = self.seen(model);
        let gains = self.problem.solve(&seen);
        let misses = self.misses(&seen, &gains);
        for (k, gradient) in gradient.iter_mut().enumerate() {
            let held = gains.on(self.problem.pairs()[k]).conj();
            let mut slope = 2.0 * held * misses[k] / self.sigma[k];
            if self.amplitudes_only {
                slope *= direction(model[k]);
            }
            *gradient += Complex::new(T::of(slope.re), T::of(slope.im)).scale(weight);
        }
        self.problem.value(&seen, &gains)
    }

    /// Real and imaginary parts of the misses, and the amplitudes' priors. Each counts as what free gains leave of it.
    fn residuals(&self, model: &[Complex<T>]) -> Vec<Residual> {
        let seen = self.seen(model);
        let gains = self.problem.solve(&seen);
        let mut all = self.all_residuals(&self.misses(&seen, &gains), &gains);
        for (residual, freedom) in all.iter_mut().zip(left_free(self.slopes(&seen, &gains))) {
            residual.freedom = freedom;
        }
        all
    }
}

/// Returns what a linear fit with these derivatives leaves of each residual's variance: 1 less its leverage, the diagonal of
/// S (SᵀS)⁻¹ Sᵀ.
fn left_free(slopes: DMatrix<f64>) -> Vec<f64> {
    let (rows, q) = (slopes.nrows(), slopes.qr().q());
    (0..rows).map(|k| (1.0 - q.row(k).norm_squared()).max(0.0)).collect()
}

/// V/|V|; 0 where the model is dark.
fn direction<T: Float>(v: Complex<T>) -> Complex64 {
    let v = Complex64::new(v.re.double(), v.im.double());
    if v.norm() > super::faintest::<T>().double() { v / v.norm() } else { Complex64::default() }
}

mod tangent;
#[cfg(test)]
mod tests;
