//! Polarimetric ratios of a model with I, Q and U.

use super::{DataTerm, DataTermError, Residual, stokes};
use crate::Complex64;
use crate::Error;
use crate::observation::{Basis, Measured, Observation, Row};
use crate::operator::Float;
use crate::polarimetry::MODELLED;
use num_complex::Complex;

/// The interferometric fractional polarisation m = (Q̃ ± iŨ)/Ĩ of baselines (Roberts, Wardle & Brown 1994, ApJ 427, 718;
/// Johnson et al. 2015, Science 350, 1242) beside RL, LR and (RR + LL)/2, or Q, U and I:
///
/// χ² = Σ min over I of |I − I_data|²/σ²(I) + Σ |m I − P_data|²/σ²(P), P = Q̃ ± iŨ.
///
/// Data term of polarimetric ratios: Σ |m I_data − P_data|²/(σ²(P) + |m|² σ²(I)) where one P was measured. No quotient of noisy
/// numbers is formed: errors stay Gaussian however weak I is. Gains that both hands of a station share cancel in m.
/// Visibilities of the model are I of all rows, then Q, then U.
pub struct RatioTerm {
    baselines: Vec<Baseline>,
}

/// Measurement on a baseline.
struct Baseline {
    i: Measured,
    /// P with i of Q + iU, or −i of Q − iU: one or two.
    crossed: Vec<(Complex64, Measured)>,
    stations: [u16; 2],
}

impl RatioTerm {
    /// Takes the baselines of a scan whose Stokes I is stronger than `least_snr` times its noise.
    ///
    /// # Errors
    /// If there is none, or one has an error that is not above 0 and finite.
    pub fn new(observation: &Observation, least_snr: f64) -> Result<Self, Error> {
        let of = |(row, i): (&Row, Measured)| Baseline {
            i,
            crossed: crossed(row, observation.basis),
            stations: row.stations,
        };
        let baselines: Vec<Baseline> = strong(observation, least_snr).map(of).collect();
        let data = baselines.iter().flat_map(|b| b.crossed.iter().map(|(_, p)| p).chain([&b.i]));
        for (index, datum) in data.enumerate() {
            let sigma = datum.noise_sigma;
            if !(sigma > 0.0 && sigma.is_finite()) {
                return Err(DataTermError::Sigma { index, sigma }.into());
            }
            if !datum.visibility.is_finite() {
                return Err(DataTermError::NotFinite(index).into());
            }
        }
        if baselines.is_empty() {
            return Err(DataTermError::Empty.into());
        }
        Ok(Self { baselines })
    }

    /// (u, v) in wavelengths of the baselines that it compares, in order.
    pub fn uv(observation: &Observation, least_snr: f64) -> Vec<[f64; 2]> {
        strong(observation, least_snr).map(|(row, _)| row.uv).collect()
    }
}

impl Baseline {
    /// m for each P. A model without Stokes I has none: it counts as 0.
    fn ratios(&self, [i, q, u]: [Complex64; MODELLED]) -> impl Iterator<Item = Complex64> {
        let of = move |(turn, _): &(Complex64, Measured)| {
            if is_dark(i) { i } else { (q + turn * u) / i }
        };
        self.crossed.iter().map(of)
    }

    /// Residuals of each P, independent and with an error of 1, after the I that those before it expect; and the I that
    /// explains all of them best.
    fn innovations(&self, stokes: [Complex64; MODELLED]) -> (Vec<Complex64>, Complex64) {
        let (mut i, mut weight) = (self.i.visibility, self.i.noise_sigma.powi(-2));
        let mut residuals = Vec::with_capacity(self.crossed.len());
        for (m, (_, p)) in self.ratios(stokes).zip(&self.crossed) {
            // P measures m I: one number is updated as by a Kalman filter.
            let (variance, of_p) = (p.noise_sigma.powi(2), p.noise_sigma.powi(-2));
            let residual = m * i - p.visibility;
            residuals.push(residual / (variance + m.norm_sqr() / weight).sqrt());
            let total = weight + m.norm_sqr() * of_p;
            i -= m.conj() * residual * of_p / total;
            weight = total;
        }
        (residuals, i)
    }
}

fn is_dark(i: Complex64) -> bool {
    i == Complex64::default()
}

/// Rows with any P, and their Stokes I.
fn strong(observation: &Observation, least_snr: f64) -> impl Iterator<Item = (&Row, Measured)> {
    observation.stokes_i().filter(move |(row, i)| {
        i.visibility.norm() > least_snr * i.noise_sigma
            && !crossed(row, observation.basis).is_empty()
    })
}

/// Q ± iU of a row, each with the turn of its U.
fn crossed(row: &Row, basis: Basis) -> Vec<(Complex64, Measured)> {
    let j = Complex64::i();
    let both = match basis {
        Basis::Circular => [row.measured(2), row.measured(3)],
        Basis::Stokes => {
            let sum = |turn: Complex64| {
                let (q, u) = row.measured(1).zip(row.measured(2))?;
                let visibility = q.visibility + turn * u.visibility;
                Some(Measured { visibility, noise_sigma: q.noise_sigma.hypot(u.noise_sigma) })
            };
            [sum(j), sum(-j)]
        }
    };
    [j, -j].into_iter().zip(both).filter_map(|(turn, p)| Some((turn, p?))).collect()
}

impl<T: Float> DataTerm<T> for RatioTerm {
    fn visibilities(&self) -> usize {
        MODELLED * self.baselines.len()
    }

    fn degrees_of_freedom(&self) -> usize {
        2 * self.baselines.iter().map(|baseline| baseline.crossed.len()).sum::<usize>()
    }

    fn is_scale_free(&self) -> bool {
        true
    }

    fn value_and_gradient(
        &self,
        model: &[Complex<T>],
        weight: T,
        gradient: &mut [Complex<T>],
    ) -> f64 {
        let count = self.baselines.len();
        assert_eq!((model.len(), gradient.len()), (MODELLED * count, MODELLED * count));
        let mut total = 0.0;
        for (row, baseline) in self.baselines.iter().enumerate() {
            let stokes = stokes(model, row);
            let (residuals, best) = baseline.innovations(stokes);
            total += residuals.iter().map(Complex64::norm_sqr).sum::<f64>();
            if is_dark(stokes[0]) {
                continue;
            }
            for (m, (turn, p)) in baseline.ratios(stokes).zip(&baseline.crossed) {
                // At the best I only m changes χ²; dm = dP/I − m dI/I.
                let slope = 2.0 * (m * best - p.visibility) * best.conj() * p.noise_sigma.powi(-2);
                let of_p = weight.double() * slope / stokes[0].conj();
                for (k, part) in
                    [-of_p * m.conj(), of_p, of_p * turn.conj()].into_iter().enumerate()
                {
                    gradient[k * count + row] += Complex::new(T::of(part.re), T::of(part.im));
                }
            }
        }
        total
    }

    fn residuals(&self, model: &[Complex<T>]) -> Vec<Residual> {
        let of = |(row, baseline): (usize, &Baseline)| {
            let (residuals, _) = baseline.innovations(stokes(model, row));
            let data = baseline.crossed.iter().map(|(_, p)| p.visibility / p.noise_sigma);
            let parts = |(value, datum): (Complex64, Complex64)| {
                [(value.re, datum.re), (value.im, datum.im)]
            };
            let pairs: Vec<_> = residuals.into_iter().zip(data).flat_map(parts).collect();
            let stations = baseline.stations;
            pairs.into_iter().map(move |(value, datum)| Residual {
                value,
                datum,
                freedom: 1.0,
                stations: stations.to_vec(),
            })
        };
        self.baselines.iter().enumerate().flat_map(of).collect()
    }
}

#[cfg(test)]
mod tests;
