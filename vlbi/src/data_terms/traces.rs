//! Closure traces of a model with I, Q and U.

use super::{DARK, DataTerm, DataTermError, Residual, wrapped};
use crate::Complex64;
use crate::Error;
use crate::observation::{Basis, Observation};
use crate::operator::Float;
use crate::polarimetry::MODELLED;
use crate::products::{ClosureTrace, Coherency, LogTrace, TracePart, TraceQuantity, TraceSet};
use core::f64::consts::PI;
use nalgebra::{DMatrix, DVector};
use num_complex::Complex;

/// χ² = Σ over scans of rᵀ C⁻¹ r, with residuals r of ln|T| and arg T of closure traces T and their covariance C to first
/// order in the errors. Visibilities of the model, which has no V, are I of all rows, then Q, then U.
pub struct TraceTerm {
    rows: usize,
    scans: Vec<Scan>,
}

struct Scan {
    quantities: Vec<TraceQuantity>,
    /// C⁻¹.
    precision: DMatrix<f64>,
    /// Lower triangle F of C⁻¹ = F Fᵀ: Fᵀ r are independent.
    factor: DMatrix<f64>,
}

impl TraceTerm {
    /// Of the rows of an observation that have all four products and whose Stokes I is stronger than `least_snr` times its
    /// noise.
    ///
    /// # Errors
    /// If there are no four stations with such rows, or the data are Stokes parameters.
    pub fn new(observation: &Observation, least_snr: f64) -> Result<Self, Error> {
        if observation.basis != Basis::Circular {
            return Err(DataTermError::TracesOfStokes.into());
        }
        let sets = TraceSet::of(observation, least_snr);
        if sets.is_empty() {
            return Err(DataTermError::Empty.into());
        }
        let scans = sets.into_iter().map(Scan::new).collect::<Result<_, _>>()?;
        Ok(Self { rows: TraceSet::rows(observation, least_snr).len(), scans })
    }

    /// (u, v) in wavelengths of the rows that it compares, in order.
    pub fn uv(observation: &Observation, least_snr: f64) -> Vec<[f64; 2]> {
        TraceSet::rows(observation, least_snr).iter().map(|row| row.uv).collect()
    }

    /// Coherencies of the model in all rows.
    fn coherencies<T: Float>(&self, model: &[Complex<T>]) -> Vec<Coherency> {
        assert_eq!(model.len(), MODELLED * self.rows);
        let stokes = |row: usize| {
            [0, 1, 2].map(|k| {
                let v = model[k * self.rows + row];
                Complex64::new(v.re.double(), v.im.double())
            })
        };
        (0..self.rows).map(|row| Coherency::of_stokes(stokes(row))).collect()
    }
}

impl Scan {
    fn new(set: TraceSet) -> Result<Self, DataTermError> {
        let n = set.quantities.len();
        let singular = || DataTermError::Singular(set.time_h);
        let covariance = DMatrix::from_row_slice(n, n, &set.covariance);
        let precision = covariance.cholesky().ok_or_else(singular)?.inverse();
        let factor = precision.clone().cholesky().ok_or_else(singular)?.unpack();
        if precision.iter().any(|x| !x.is_finite()) {
            return Err(singular());
        }
        Ok(Self { quantities: set.quantities, precision, factor })
    }

    /// The logarithms of the model's traces; none where it has no trace.
    fn logs(&self, model: &[Coherency]) -> Vec<Option<LogTrace>> {
        // Both numbers of a trace are often there.
        let mut last: Option<(ClosureTrace, Option<LogTrace>)> = None;
        let one = |quantity: &TraceQuantity| {
            let log = match last {
                Some((trace, log)) if trace == quantity.trace => log,
                _ => quantity.trace.log(model),
            };
            last = Some((quantity.trace, log));
            log
        };
        self.quantities.iter().map(one).collect()
    }

    fn residuals(&self, logs: &[Option<LogTrace>]) -> DVector<f64> {
        let one = |(quantity, log): (&TraceQuantity, &Option<LogTrace>)| {
            let difference = log.map(|log| quantity.part.of(log.value) - quantity.value);
            match quantity.part {
                TracePart::LogAmplitude => difference.unwrap_or(DARK),
                TracePart::Phase => difference.map_or(PI, wrapped),
            }
        };
        DVector::from_iterator(logs.len(), self.quantities.iter().zip(logs).map(one))
    }
}

/// Slopes of a sum of logarithms with respect to the products of a row, into those with respect to I, Q and U.
fn of_stokes([rr, ll, rl, lr]: [Complex64; 4]) -> [Complex64; MODELLED] {
    let difference = lr - rl;
    [rr + ll, rl + lr, Complex64::new(-difference.im, difference.re)]
}

impl<T: Float> DataTerm<T> for TraceTerm {
    fn visibilities(&self) -> usize {
        MODELLED * self.rows
    }

    fn degrees_of_freedom(&self) -> usize {
        self.scans.iter().map(|scan| scan.quantities.len()).sum()
    }

    fn is_scale_free(&self) -> bool {
        true
    }

    /// Where the model has no trace, the residual is π, or 100 for ln|T|, so that a dark model is worse than one that shines,
    /// and the gradient leaves that number out.
    fn value_and_gradient(
        &self,
        model: &[Complex<T>],
        weight: T,
        gradient: &mut [Complex<T>],
    ) -> f64 {
        assert_eq!(gradient.len(), model.len());
        let coherencies = self.coherencies(model);
        let mut slopes = vec![[Complex64::default(); 4]; self.rows];
        let mut total = 0.0;
        for scan in &self.scans {
            let logs = scan.logs(&coherencies);
            let residuals = scan.residuals(&logs);
            let pulls = &scan.precision * &residuals;
            total += residuals.dot(&pulls);
            for ((quantity, log), pull) in scan.quantities.iter().zip(&logs).zip(pulls.iter()) {
                let Some(log) = log else { continue };
                pull_back(quantity, log, 2.0 * pull, &mut slopes);
            }
        }
        for (row, slopes) in slopes.into_iter().enumerate() {
            for (k, slope) in of_stokes(slopes).into_iter().enumerate() {
                let part = slope * weight.double();
                gradient[k * self.rows + row] += Complex::new(T::of(part.re), T::of(part.im));
            }
        }
        total
    }

    fn residuals(&self, model: &[Complex<T>]) -> Vec<Residual> {
        let coherencies = self.coherencies(model);
        let of_scan = |scan: &Scan| {
            let independent = scan.factor.transpose() * scan.residuals(&scan.logs(&coherencies));
            let one = |(value, quantity): (&f64, &TraceQuantity)| Residual {
                value: *value,
                datum: 0.0,
                stations: quantity.trace.stations.to_vec(),
            };
            independent.iter().zip(&scan.quantities).map(one).collect::<Vec<_>>()
        };
        self.scans.iter().flat_map(of_scan).collect()
    }
}

/// Adds g of a number of a trace times `pull` to the products of its rows, where dχ² = Re Σ ḡ dV.
fn pull_back(quantity: &TraceQuantity, log: &LogTrace, pull: f64, slopes: &mut [[Complex64; 4]]) {
    // Re(c dV) and Im(c dV) = Re(−i c dV).
    let factor = match quantity.part {
        TracePart::LogAmplitude => Complex64::new(pull, 0.0),
        TracePart::Phase => Complex64::new(0.0, -pull),
    };
    for (leg, of_leg) in quantity.trace.legs.iter().zip(&log.slopes) {
        for (slope, c) in slopes[leg.row].iter_mut().zip(of_leg) {
            let c = c * factor;
            *slope += if leg.is_reversed { c } else { c.conj() };
        }
    }
}

#[cfg(test)]
mod tests;
