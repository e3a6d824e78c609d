//! Free gains about a model.

use super::{GainTerm, Residual, left_free};
use crate::Complex64;
use crate::data_terms::DataTerm;
use crate::operator::Float;
use nalgebra::{DMatrix, DVector};
use num_complex::Complex;

/// Visibilities whose gains were solved for beside a model, and move in proportion to how far another model is from it:
/// χ² is quadratic, and that of the [`GainTerm`] but for the product of what is left of the data with terms of second
/// order, and for terms of third order.
#[derive(Debug, Clone)]
pub struct TangentTerm {
    term: GainTerm,
    /// g₁ ḡ₂/σ of every baseline.
    held: Vec<Complex64>,
    /// Residuals of the amplitudes' priors.
    priors: Vec<f64>,
    /// Derivatives of residuals with respect to the gains that are free.
    slopes: DMatrix<f64>,
    /// Matrix from slopes of half of χ² along gains to the gains' moves.
    inverse: DMatrix<f64>,
}

/// Least second derivative along gains, in parts of their mean: a baseline that a model does not shine on says nothing about
/// its stations.
const AT_LEAST: f64 = 1e-10;

impl GainTerm {
    /// The same with gains that follow a model's visibilities in proportion, from where these are; none of amplitudes alone.
    pub fn tangent<T: Float>(self, model: &[Complex<T>]) -> Option<TangentTerm> {
        // |V| is not linear in V: χ² of amplitudes is not quadratic.
        if self.amplitudes_only {
            return None;
        }
        let model = self.seen(model);
        let gains = self.problem.solve(&model);
        let on = |k: usize| gains.on(self.problem.pairs()[k]) / self.sigma[k];
        let held = (0..self.data.len()).map(on).collect();
        let prior = |(k, precision): (usize, f64)| precision.sqrt() * gains.log_amplitude[k];
        let priors = self.amplitudes_free().into_iter().map(prior).collect();
        let slopes = self.slopes(&model, &gains);
        let mut bends = slopes.tr_mul(&slopes);
        let columns = bends.nrows();
        let least = AT_LEAST * bends.trace() / columns.max(1) as f64;
        (0..columns).for_each(|k| bends[(k, k)] += least.max(f64::MIN_POSITIVE));
        let inverse = bends.cholesky()?.inverse();
        Some(TangentTerm { term: self, held, priors, slopes, inverse })
    }
}

impl TangentTerm {
    /// Residuals of data (real and imaginary parts in turn) and of priors, at the gains that are best beside a model.
    fn left<T: Float>(&self, model: &[Complex<T>]) -> DVector<f64> {
        let model = self.term.seen(model);
        let data = |k: usize| self.held[k] * model[k] - self.term.data[k] / self.term.sigma[k];
        let parts = (0..model.len()).map(data).flat_map(|miss| [miss.re, miss.im]);
        let all: Vec<f64> = parts.chain(self.priors.iter().copied()).collect();
        let all = DVector::from_vec(all);
        // Linear least squares: gains take S (SᵀS)⁻¹ Sᵀ r off the residuals r.
        let moves = &self.inverse * self.slopes.tr_mul(&all);
        all - &self.slopes * moves
    }
}

impl<T: Float> DataTerm<T> for TangentTerm {
    fn visibilities(&self) -> usize {
        self.term.data.len()
    }

    fn degrees_of_freedom(&self) -> usize {
        DataTerm::<T>::degrees_of_freedom(&self.term)
    }

    fn value_and_gradient(
        &self,
        model: &[Complex<T>],
        weight: T,
        gradient: &mut [Complex<T>],
    ) -> f64 {
        assert_eq!(gradient.len(), self.held.len());
        let left = self.left(model);
        for ((gradient, held), k) in gradient.iter_mut().zip(&self.held).zip((0..).step_by(2)) {
            // What is left has no part along the gains: their moves add nothing to the slope.
            let slope = 2.0 * held.conj() * Complex64::new(left[k], left[k + 1]);
            *gradient += Complex::new(T::of(slope.re), T::of(slope.im)).scale(weight);
        }
        left.norm_squared()
    }

    /// Those of the data at the gains that are best, as [`GainTerm`]'s.
    fn residuals(&self, model: &[Complex<T>]) -> Vec<Residual> {
        let left = self.left(model);
        let baselines = self.term.baselines.iter().flat_map(|pair| [pair.to_vec(), pair.to_vec()]);
        let free = self.term.amplitudes_free().into_iter();
        let stations = free.map(|(k, _)| vec![self.term.stations[k]]);
        let all = left.iter().zip(left_free(self.slopes.clone())).zip(baselines.chain(stations));
        let residual = |((value, freedom), stations): ((&f64, f64), Vec<u16>)| Residual {
            value: *value,
            datum: 0.0,
            freedom,
            stations,
        };
        all.map(residual).collect()
    }
}
