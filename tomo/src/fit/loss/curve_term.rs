//! Fluxes of an unresolved source in Stokes parameters, frame by frame.

use super::terms::plain;
use crate::Error;
use crate::fit::FrameTerm;
use kerrlight_common::simd::Float;
use kerrlight_vlbi::data_terms::Residual;

/// A flux and its standard deviation, Jy.
pub type FluxDatum = [f64; 2];

/// χ² of the fluxes of a model that sees nothing else: a pixel for each Stokes parameter.
#[derive(Clone, Debug)]
pub struct StokesCurveTerm {
    parameters: usize,
    /// Frame by frame, parameter by parameter.
    data: Vec<Option<FluxDatum>>,
}

impl StokesCurveTerm {
    /// Takes the measurements, parameter by parameter in each frame.
    ///
    /// # Errors
    /// If numbers are not whole frames, not finite, or a standard deviation is not above 0.
    pub fn new(parameters: usize, data: Vec<Option<FluxDatum>>) -> Result<Self, Error> {
        let (check, count) = (Error::check, data.len());
        let whole = parameters > 0 && count.is_multiple_of(parameters) && count > 0;
        check("light-curve numbers", count as f64, whole, "whole frames, 1 or more")?;
        for [flux, sigma] in data.iter().flatten() {
            check("light-curve flux", *flux, flux.is_finite(), "finite numbers")?;
            check("light-curve sigma", *sigma, *sigma > 0.0 && sigma.is_finite(), "above 0")?;
        }
        Ok(Self { parameters, data })
    }

    fn of(&self, frame: usize) -> &[Option<FluxDatum>] {
        &self.data[frame * self.parameters..(frame + 1) * self.parameters]
    }
}

impl<T: Float> FrameTerm<T> for StokesCurveTerm {
    fn name(&self) -> &str {
        "light curve"
    }

    fn frames(&self) -> usize {
        self.data.len() / self.parameters
    }

    fn pixels(&self) -> usize {
        self.parameters
    }

    fn degrees_of_freedom(&self, frame: usize) -> usize {
        self.of(frame).iter().flatten().count()
    }

    fn is_quadratic(&self) -> bool {
        true
    }

    fn value_and_gradient(&self, frame: usize, image: &[T], weight: T, gradient: &mut [T]) -> f64 {
        let mut value = 0.0;
        for ((model, datum), slope) in image.iter().zip(self.of(frame)).zip(gradient) {
            let Some([flux, sigma]) = datum else { continue };
            let residual = (model.double() - flux) / sigma;
            *slope += T::of(2.0 * residual / sigma) * weight;
            value += residual * residual;
        }
        value
    }

    fn residuals(&self, frame: usize, image: &[T]) -> Vec<Residual> {
        let pairs = image.iter().zip(self.of(frame));
        pairs
            .filter_map(|(model, datum)| {
                let [flux, sigma] = (*datum)?;
                Some(plain(model.double(), flux, 1.0 / sigma))
            })
            .collect()
    }
}
