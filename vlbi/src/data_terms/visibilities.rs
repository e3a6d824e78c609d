//! Complex visibilities, and amplitudes.

use super::{Comparison, DataTerm, Residual, checked, faintest, inverse_variances, stations_of};
use crate::Error;
use crate::observation::Observation;
use crate::operator::Float;
use crate::products::debiased_amplitude;
use num_complex::{Complex, Complex32};

/// χ² = Σ |V − V_data|²/σ².
#[derive(Debug, Clone)]
pub struct VisibilityTerm<T> {
    stations: Vec<[u16; 2]>,
    data: Vec<Complex<T>>,
    inverse_variance: Vec<T>,
}

impl<T: Float> VisibilityTerm<T> {
    /// Takes the Stokes I of an observation, in its order.
    ///
    /// # Errors
    /// If there are none, or an error is not positive.
    pub fn new(observation: &Observation) -> Result<Self, Error> {
        let data = checked(observation)?;
        let value = |v: Complex<f64>| Complex::new(T::of(v.re), T::of(v.im));
        Ok(VisibilityTerm {
            stations: stations_of(observation),
            inverse_variance: inverse_variances(&data)?,
            data: data.iter().map(|m| value(m.visibility)).collect(),
        })
    }
}

impl<T: Float> DataTerm<T> for VisibilityTerm<T> {
    fn visibilities(&self) -> usize {
        self.data.len()
    }

    fn degrees_of_freedom(&self) -> usize {
        2 * self.data.len()
    }

    fn comparison(&self) -> Option<Comparison> {
        let single = |(v, weight): (&Complex<T>, &T)| {
            (Complex32::new(v.re.double() as f32, v.im.double() as f32), weight.double() as f32)
        };
        Some(Comparison::Visibilities(
            self.data.iter().zip(&self.inverse_variance).map(single).collect(),
        ))
    }

    fn value_and_gradient(
        &self,
        model: &[Complex<T>],
        weight: T,
        gradient: &mut [Complex<T>],
    ) -> f64 {
        assert_eq!((model.len(), gradient.len()), (self.data.len(), self.data.len()));
        let mut total = 0.0;
        for (k, gradient) in gradient.iter_mut().enumerate() {
            let residual = model[k] - self.data[k];
            let scaled = residual.scale(self.inverse_variance[k]);
            total += (residual.conj() * scaled).re.double();
            *gradient += scaled.scale(weight + weight);
        }
        total
    }

    /// Real and imaginary part of every visibility.
    fn residuals(&self, model: &[Complex<T>]) -> Vec<Residual> {
        let one = |k: usize| {
            let weight = self.inverse_variance[k].double().sqrt();
            let (residual, stations) = (model[k] - self.data[k], self.stations[k].to_vec());
            let part = |value: T, datum: T| Residual {
                value: weight * value.double(),
                datum: weight * datum.double(),
                freedom: 1.0,
                stations: stations.clone(),
            };
            [part(residual.re, self.data[k].re), part(residual.im, self.data[k].im)]
        };
        (0..self.data.len()).flat_map(one).collect()
    }
}

/// χ² = Σ (|V| − A)²/σ² with debiased amplitudes A.
#[derive(Debug, Clone)]
pub struct AmplitudeTerm<T> {
    stations: Vec<[u16; 2]>,
    data: Vec<T>,
    inverse_variance: Vec<T>,
}

impl<T: Float> AmplitudeTerm<T> {
    /// Takes the Stokes I of an observation, in its order.
    ///
    /// # Errors
    /// If there are none, or an error is not positive.
    pub fn new(observation: &Observation) -> Result<Self, Error> {
        let data = checked(observation)?;
        Ok(AmplitudeTerm {
            stations: stations_of(observation),
            inverse_variance: inverse_variances(&data)?,
            data: data.iter().map(|m| T::of(debiased_amplitude(m))).collect(),
        })
    }
}

impl<T: Float> DataTerm<T> for AmplitudeTerm<T> {
    fn visibilities(&self) -> usize {
        self.data.len()
    }

    fn degrees_of_freedom(&self) -> usize {
        self.data.len()
    }

    fn comparison(&self) -> Option<Comparison> {
        let single = |(a, weight): (&T, &T)| (a.double() as f32, weight.double() as f32);
        Some(Comparison::Amplitudes(
            self.data.iter().zip(&self.inverse_variance).map(single).collect(),
        ))
    }

    /// Returns χ² and its gradient. At V = 0, where |V| has a kink, the gradient is 0.
    fn value_and_gradient(
        &self,
        model: &[Complex<T>],
        weight: T,
        gradient: &mut [Complex<T>],
    ) -> f64 {
        assert_eq!((model.len(), gradient.len()), (self.data.len(), self.data.len()));
        let mut total = 0.0;
        for (k, gradient) in gradient.iter_mut().enumerate() {
            let amplitude = model[k].norm();
            let residual = amplitude - self.data[k];
            let scaled = residual * self.inverse_variance[k];
            total += (residual * scaled).double();
            // In two steps: the inverse of a faint amplitude would leave single precision.
            if amplitude > faintest() {
                *gradient += model[k].unscale(amplitude).scale((weight + weight) * scaled);
            }
        }
        total
    }

    fn residuals(&self, model: &[Complex<T>]) -> Vec<Residual> {
        let one = |k: usize| {
            let weight = self.inverse_variance[k].double().sqrt();
            Residual {
                value: weight * (model[k].norm() - self.data[k]).double(),
                datum: weight * self.data[k].double(),
                freedom: 1.0,
                stations: self.stations[k].to_vec(),
            }
        };
        (0..self.data.len()).map(one).collect()
    }
}
