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
    /// Correlation of the errors of both data of each frame; 0 where there are not two.
    correlations: Vec<f64>,
}

/// A background that a fit does not explain: its expected value, Jy, its standard deviation, and the covariance with the other one
/// of two parameters at the same time, Jy².
pub type BackgroundDatum = [f64; 3];

/// Largest correlation of two errors.
const MOST: f64 = 0.9999;

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
            // The inverse square is one of single precision.
            let ok = (1e-18..1e18).contains(sigma);
            check("light-curve sigma", *sigma, ok, "1e-18 Jy to 1e18 Jy")?;
        }
        Ok(Self { parameters, correlations: vec![0.0; data.len() / parameters], data })
    }

    /// Takes correlations of the errors of two parameters, a number a frame, between −1 and 1.
    #[must_use]
    pub fn correlated(mut self, of_frame: impl Fn(usize) -> f64) -> Self {
        for frame in 0..self.correlations.len() {
            if let [Some(_), Some(_)] = self.of(frame) {
                // Rounding may leave no variance at all.
                self.correlations[frame] = of_frame(frame).clamp(-MOST, MOST);
            }
        }
        self
    }

    /// Residuals of a frame with errors of 1 that are independent, with their slopes along both of its parameters: what is
    /// left of the second is that beside what the first tells of it.
    fn whitened(&self, frame: usize, image: [f64; 2]) -> [(f64, [f64; 2]); 2] {
        let [Some([a, sigma_a]), Some([b, sigma_b])] = *self.of(frame) else {
            return [(0.0, [0.0; 2]); 2];
        };
        let correlation = self.correlations[frame];
        let left = (1.0 - correlation * correlation).sqrt();
        let [first, second] = [(image[0] - a) / sigma_a, (image[1] - b) / sigma_b];
        let slopes = [-correlation / left / sigma_a, 1.0 / left / sigma_b];
        [(first, [1.0 / sigma_a, 0.0]), ((second - correlation * first) / left, slopes)]
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
        if self.correlations[frame] != 0.0 {
            for (residual, slopes) in self.whitened(frame, [0, 1].map(|k| image[k].double())) {
                for (of, slope) in gradient.iter_mut().zip(slopes) {
                    *of += T::of(2.0 * residual * slope) * weight;
                }
                value += residual * residual;
            }
            return value;
        }
        for ((model, datum), slope) in image.iter().zip(self.of(frame)).zip(gradient) {
            let Some([flux, sigma]) = datum else { continue };
            let residual = (model.double() - flux) / sigma;
            *slope += T::of(2.0 * residual / sigma) * weight;
            value += residual * residual;
        }
        value
    }

    fn residuals(&self, frame: usize, image: &[T]) -> Vec<Residual> {
        if self.correlations[frame] != 0.0 {
            let image = [0, 1].map(|k| image[k].double());
            let [model, none] = [image, [0.0; 2]].map(|image| self.whitened(frame, image));
            // What a model of nothing leaves is the data.
            let pairs = model.into_iter().zip(none);
            return pairs.map(|((r, _), (d, _))| plain(r - d, -d, 1.0)).collect();
        }
        let pairs = image.iter().zip(self.of(frame));
        pairs
            .filter_map(|(model, datum)| {
                let [flux, sigma] = (*datum)?;
                Some(plain(model.double(), flux, 1.0 / sigma))
            })
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// χ² of two correlated data is rᵀ C⁻¹ r; its gradient is that of differences, and residuals sum to it.
    #[test]
    fn exact_correlated_errors_are_an_ellipse() {
        let data = vec![Some([1.0, 0.3]), Some([2.0, 0.4])];
        let term = StokesCurveTerm::new(2, data).unwrap().correlated(|_| 0.6);
        let value = |image: [f64; 2]| {
            let mut gradient = [0.0; 2];
            (term.value_and_gradient(0, &image, 1.0, &mut gradient), gradient)
        };
        let (chi2, gradient) = value([1.2, 1.5]);
        // Of r = (0.2, −0.5) and C = [[0.09, 0.072], [0.072, 0.16]].
        let determinant = 0.09 * 0.16 - 0.072 * 0.072;
        let expected = (0.16 * 0.04 + 2.0 * 0.072 * 0.1 + 0.09 * 0.25) / determinant;
        assert!((chi2 - expected).abs() < 1e-12, "{chi2} {expected}");
        for k in 0..2 {
            let at = |step: f64| {
                let mut image = [1.2, 1.5];
                image[k] += step;
                value(image).0
            };
            assert!(((at(1e-5) - at(-1e-5)) / 2e-5 - gradient[k]).abs() < 1e-5);
        }
        let residuals = FrameTerm::<f64>::residuals(&term, 0, &[1.2, 1.5]);
        let squares: f64 = residuals.iter().map(|residual| residual.value.powi(2)).sum();
        assert!((squares - chi2).abs() < 1e-12);
    }
}
