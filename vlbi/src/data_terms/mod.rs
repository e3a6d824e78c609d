//! Distance of model visibilities from data: χ² and its gradient. A data term sees visibilities, never images; an
//! [`Operator`](super::operator::Operator) carries the gradient on.

mod closures;
mod comparison;
mod gains;
mod polarized;
mod ratios;
mod visibilities;

pub use closures::ClosureTerm;
pub use comparison::{ClosureScan, Comparison};
pub use gains::{GainTerm, TangentTerm};
pub use polarized::PolarizedTerm;
pub use ratios::RatioTerm;
pub use visibilities::{AmplitudeTerm, VisibilityTerm};

use super::Complex64;
use super::observation::{Measured, Observation};
use super::operator::Float;
use super::polarimetry::MODELLED;
use core::f64::consts::{PI, TAU};
use num_complex::Complex;

/// Reason why data make no term.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum DataTermError {
    /// A datum with an error of 0, infinity, or so small that its weight is none in single precision.
    #[error("data point {index}: sigma = {sigma} Jy is not allowed: above 0 and finite")]
    Sigma {
        /// Index of the datum, counted from 0.
        index: usize,
        /// Its error.
        sigma: f64,
    },
    /// An error whose inverse square the precision of the fit cannot hold.
    #[error(
        "data point {index}: sigma = {sigma} Jy is not allowed: its inverse square overflows single precision"
    )]
    Overflow {
        /// Index of the datum, counted from 0.
        index: usize,
        /// Its error.
        sigma: f64,
    },
    /// A visibility that is not a finite number.
    #[error("data point {0} is not a finite visibility")]
    NotFinite(usize),
    /// Nothing to compare with.
    #[error("there are no data for this term")]
    Empty,
    /// Closure quantities that depend on each other.
    #[error("the covariance of closure quantities at {0} h UTC is singular")]
    Singular(f64),
}

/// A datum beside a model, in units of its error.
#[derive(Debug, Clone, PartialEq)]
pub struct Residual {
    /// (model − datum)/σ. Where data share errors, as closure quantities do, a combination of them whose error is 1 and
    /// independent of the others: squares add up to χ².
    pub value: f64,
    /// The datum in the same units; 0 for closure quantities, which have no natural zero.
    pub datum: f64,
    /// Data that it counts as: 1, less what gains that are solved for use up of it. A right model has this mean square.
    pub freedom: f64,
    /// Indices of the stations of the baseline, triangle or quadrangle; none for data that no stations measured.
    pub stations: Vec<u16>,
}

/// The residual of the logarithm of a closure quantity that a model has not: such a model is worse than one that shines.
const DARK: f64 = 100.0;

/// The same angle in [−π, π].
fn wrapped<T: Float>(angle: T) -> T {
    let turns = (angle / T::of(TAU)).round();
    // 2π is rounded in single precision, and the rest may be a trifle beyond π.
    (angle - turns * T::of(TAU)).max(T::of(-PI)).min(T::of(PI))
}

/// A χ² of model visibilities.
pub trait DataTerm<T: Float>: Sync {
    /// Returns the number of visibilities that it expects.
    fn visibilities(&self) -> usize;

    /// Returns the number of real data it compares with: χ² of the true model has this mean.
    fn degrees_of_freedom(&self) -> usize;

    /// Returns whether χ² stays the same when all visibilities are multiplied by one positive number: such data do not
    /// know the flux.
    fn is_scale_free(&self) -> bool {
        false
    }

    /// Returns the comparison, for callers who compute χ² on another device; none where only this processor computes it.
    fn comparison(&self) -> Option<Comparison> {
        None
    }

    /// χ², and adds `weight` times its gradient g to `gradient`, where dχ² = Re Σ ḡ dV: what
    /// [`Operator::adjoint`](super::operator::Operator::adjoint) takes.
    fn value_and_gradient(
        &self,
        model: &[Complex<T>],
        weight: T,
        gradient: &mut [Complex<T>],
    ) -> f64;

    /// Residuals, in the same order for every model; their freedoms add up to [`Self::degrees_of_freedom`].
    fn residuals(&self, model: &[Complex<T>]) -> Vec<Residual>;
}

/// Stations of the rows that have Stokes I, in order.
fn stations_of(observation: &Observation) -> Vec<[u16; 2]> {
    observation.stokes_i().map(|(row, _)| row.stations).collect()
}

/// Stokes I of an observation, in order, with errors fit for a χ².
fn checked(observation: &Observation) -> Result<Vec<Measured>, DataTermError> {
    let data: Vec<Measured> = observation.stokes_i().map(|(_, i)| i).collect();
    let bad = data.iter().position(|m| !(m.noise_sigma > 0.0 && m.noise_sigma.is_finite()));
    match bad {
        Some(index) => Err(DataTermError::Sigma { index, sigma: data[index].noise_sigma }),
        None if data.is_empty() => Err(DataTermError::Empty),
        None => match data.iter().position(|m| !m.visibility.is_finite()) {
            Some(index) => Err(DataTermError::NotFinite(index)),
            None => Ok(data),
        },
    }
}

/// 1/σ² of data in the fit's precision.
fn inverse_variances<T: Float>(data: &[Measured]) -> Result<Vec<T>, DataTermError> {
    let one = |(index, m): (usize, &Measured)| {
        let inverse = T::of(m.noise_sigma.powi(-2));
        let overflow = DataTermError::Overflow { index, sigma: m.noise_sigma };
        inverse.is_finite().then_some(inverse).ok_or(overflow)
    };
    data.iter().enumerate().map(one).collect()
}

/// I, Q and U of a row of a model, which has I of all rows, then Q, then U.
fn stokes<T: Float>(model: &[Complex<T>], row: usize) -> [Complex64; MODELLED] {
    let rows = model.len() / MODELLED;
    [0, 1, 2].map(|k| {
        let v = model[k * rows + row];
        Complex64::new(v.re.double(), v.im.double())
    })
}

/// Amplitudes at or below this count as 0: their squares underflow, and phase and logarithm mean nothing.
fn faintest<T: Float>() -> T {
    T::min_positive_value().sqrt()
}

#[cfg(test)]
mod tests;
