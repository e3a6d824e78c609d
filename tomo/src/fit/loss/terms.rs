//! Data of a movie, frame by frame: χ² of an image, and its gradient with respect to pixels.

use crate::Error;
use kerrlight_common::frames::Frames;
use kerrlight_common::simd::Float;
use kerrlight_vlbi::data_terms::{Comparison, Residual};
use kerrlight_vlbi::operator::ImageGrid;
use std::borrow::Cow;
use std::sync::OnceLock;

/// Data of a frame, for callers who compute χ² on another device.
#[derive(Clone, Debug, PartialEq)]
pub enum Compared {
    /// Nothing.
    Nothing,
    /// The sum of all pixels: a flux (Jy) and 1/σ².
    Flux(f32, f32),
    /// Visibilities of the image.
    Scan {
        /// Grid of pixels.
        sky: ImageGrid,
        /// (u, v) in wavelengths, and the Fourier transform of a pixel there.
        seen: Vec<([f64; 2], f64)>,
        /// Comparison with the data.
        with: Comparison,
    },
}

/// χ² of the frames of a movie.
///
/// Images are rows of pixels from the north, each from the east, in Jy/pixel where data are
/// radio ones.
pub trait FrameTerm<T: Float>: Send + Sync {
    /// Names the data, for logs and reports.
    fn name(&self) -> &str;

    /// Images of the movie.
    fn frames(&self) -> usize;

    /// Pixels of an image.
    fn pixels(&self) -> usize;

    /// Real data of a frame; 0 where there are none.
    fn degrees_of_freedom(&self, frame: usize) -> usize;

    /// Returns whether χ² is quadratic in the pixels.
    fn is_quadratic(&self) -> bool;

    /// Returns whether χ² is convex in the pixels: quadratic ones are. Only then can a minimum be told from other
    /// stationary points.
    fn is_convex(&self) -> bool {
        self.is_quadratic()
    }

    /// Returns whether χ² stays the same when all pixels are multiplied by one positive number: such data do not
    /// know the flux.
    fn is_scale_free(&self) -> bool {
        false
    }

    /// Returns the reason why data that were there at the beginning cannot be read any more: χ² is no number
    /// then.
    fn fault(&self) -> Option<&str> {
        None
    }

    /// Returns the data of a frame, for callers who compute χ² on another device; none where only this processor
    /// computes it.
    fn compared(&self, _frame: usize) -> Option<Compared> {
        None
    }

    /// χ² of a frame; adds `weight` times its gradient.
    fn value_and_gradient(&self, frame: usize, image: &[T], weight: T, gradient: &mut [T]) -> f64;

    /// Residuals of a frame, whose squares add up to χ² and whose freedoms to [`Self::degrees_of_freedom`]; pixels in their order.
    fn residuals(&self, frame: usize, image: &[T]) -> Vec<Residual>;
}

/// A residual of something that no stations measured.
pub(in crate::fit) fn plain(model: f64, datum: f64, weight: f64) -> Residual {
    Residual {
        value: weight * (model - datum),
        datum: weight * datum,
        freedom: 1.0,
        stations: Vec::new(),
    }
}

/// Every pixel of every frame: Σ (I − data)²/σ².
#[derive(Clone, Debug)]
pub struct ImageTerm<T> {
    movie: Frames<f64>,
    inverse_variance: T,
    /// Pixels that do not count; all do where it is empty.
    left_out: Vec<bool>,
    fault: OnceLock<String>,
}

impl<T: Float> ImageTerm<T> {
    /// Takes a movie, frame after frame, all pixels with the same standard deviation.
    ///
    /// # Errors
    /// If σ is not positive, or the movie is not whole frames of finite numbers.
    pub fn new(movie: Vec<T>, pixels: usize, noise_sigma: f64) -> Result<Self, Error> {
        let whole = pixels > 0 && !movie.is_empty() && movie.len().is_multiple_of(pixels);
        Error::check("movie numbers", movie.len() as f64, whole, "whole frames, 1 or more")?;
        let movie = movie.into_iter().map(Float::double).collect();
        Self::of(Frames::of(movie, pixels), noise_sigma)
    }

    /// Takes images, which may be in a file, all pixels with the same standard deviation.
    ///
    /// # Errors
    /// If σ is not positive, a pixel is not finite, or images cannot be read.
    pub fn of(movie: Frames<f64>, noise_sigma: f64) -> Result<Self, Error> {
        let check = Error::check;
        let positive = noise_sigma > 0.0 && noise_sigma.is_finite();
        check("image sigma", noise_sigma, positive, "above 0")?;
        for image in movie.images() {
            // As the fit sees it: a double beyond the largest single is infinite there.
            for pixel in &*image? {
                check("movie pixel", *pixel, T::of(*pixel).is_finite(), "finite numbers")?;
            }
        }
        let inverse_variance = T::of(noise_sigma.powi(-2));
        Ok(Self { movie, inverse_variance, left_out: Vec::new(), fault: OnceLock::new() })
    }

    /// The same images without some of their pixels.
    pub fn without(mut self, pixels: Vec<bool>) -> Self {
        self.left_out = pixels;
        self
    }

    /// Returns whether a pixel counts.
    fn counts(&self, pixel: usize) -> bool {
        !self.left_out.get(pixel).is_some_and(|out| *out)
    }

    /// A datum; no number, where it cannot be read ([`FrameTerm::fault`]).
    pub fn pixel(&self, frame: usize, pixel: usize) -> T {
        // A loss returns no errors: a NaN ends the fit, and `fault` gives the first reason.
        T::of(self.movie.pixel(frame, pixel).unwrap_or_else(|error| {
            let _ = self.fault.set(error.to_string());
            f64::NAN
        }))
    }

    /// 1/σ².
    pub fn inverse_variance(&self) -> T {
        self.inverse_variance
    }

    fn image(&self, frame: usize) -> Cow<'_, [f64]> {
        self.movie.image(frame).unwrap_or_else(|error| {
            let _ = self.fault.set(error.to_string());
            vec![f64::NAN; self.movie.pixels()].into()
        })
    }
}

impl<T: Float> FrameTerm<T> for ImageTerm<T> {
    fn name(&self) -> &str {
        "image"
    }

    fn frames(&self) -> usize {
        self.movie.count()
    }

    fn pixels(&self) -> usize {
        self.movie.pixels()
    }

    fn degrees_of_freedom(&self, _frame: usize) -> usize {
        (0..self.movie.pixels()).filter(|pixel| self.counts(*pixel)).count()
    }

    fn is_quadratic(&self) -> bool {
        true
    }

    fn fault(&self) -> Option<&str> {
        self.fault.get().map(String::as_str)
    }

    fn value_and_gradient(&self, frame: usize, image: &[T], weight: T, gradient: &mut [T]) -> f64 {
        let data = self.image(frame);
        let (scale, slope) = (self.inverse_variance, (weight + weight) * self.inverse_variance);
        let pixels = image.iter().zip(&*data).zip(gradient).enumerate();
        let pixels = pixels.filter(|(pixel, _)| self.counts(*pixel));
        let square = |(_, ((image, datum), gradient)): (_, ((&T, &f64), &mut T))| {
            let residual = *image - T::of(*datum);
            *gradient += slope * residual;
            (residual * residual).double()
        };
        scale.double() * pixels.map(square).sum::<f64>()
    }

    fn residuals(&self, frame: usize, image: &[T]) -> Vec<Residual> {
        let weight = self.inverse_variance.double().sqrt();
        let data = self.image(frame);
        let pixels = image.iter().zip(&*data).enumerate();
        let pixels = pixels.filter(|(pixel, _)| self.counts(*pixel));
        pixels.map(|(_, (image, x))| plain(image.double(), T::of(*x).double(), weight)).collect()
    }
}

/// The total flux of every frame: (Σ I − data)²/σ².
#[derive(Clone, Debug)]
pub struct LightCurveTerm {
    /// Pixels of an image, and images of a frame, of which the first is I.
    pixels: usize,
    images: usize,
    flux: Vec<f64>,
    inverse_variance: Vec<f64>,
}

impl LightCurveTerm {
    /// Takes fluxes with their standard deviations.
    ///
    /// # Errors
    /// If a σ is not positive, a flux not finite, or their numbers differ.
    pub fn new(flux: Vec<f64>, noise_sigma: &[f64], pixels: usize) -> Result<Self, Error> {
        let (check, count) = (Error::check, noise_sigma.len());
        let ok = flux.len() == count && count > 0;
        check("light-curve sigmas", count as f64, ok, "as many as fluxes")?;
        for flux in &flux {
            check("light-curve flux", *flux, flux.is_finite(), "finite numbers")?;
        }
        for sigma in noise_sigma {
            check("light-curve sigma", *sigma, *sigma > 0.0 && sigma.is_finite(), "above 0")?;
        }
        let inverse_variance = noise_sigma.iter().map(|sigma| sigma.powi(-2)).collect();
        Ok(Self { pixels, images: 1, flux, inverse_variance })
    }

    /// The same where frames are images of so many Stokes parameters, I first.
    pub fn first_of(self, images: usize) -> Self {
        Self { images, ..self }
    }
}

impl<T: Float> FrameTerm<T> for LightCurveTerm {
    fn name(&self) -> &str {
        "light curve"
    }

    fn frames(&self) -> usize {
        self.flux.len()
    }

    fn pixels(&self) -> usize {
        self.pixels * self.images
    }

    fn degrees_of_freedom(&self, _frame: usize) -> usize {
        1
    }

    fn is_quadratic(&self) -> bool {
        true
    }

    fn compared(&self, frame: usize) -> Option<Compared> {
        let flux = Compared::Flux(self.flux[frame] as f32, self.inverse_variance[frame] as f32);
        (self.images == 1).then_some(flux)
    }

    fn value_and_gradient(&self, frame: usize, image: &[T], weight: T, gradient: &mut [T]) -> f64 {
        let flux: f64 = image[..self.pixels].iter().map(|pixel| pixel.double()).sum();
        let residual = flux - self.flux[frame];
        let scaled = residual * self.inverse_variance[frame];
        let slope = T::of(2.0 * scaled) * weight;
        gradient[..self.pixels].iter_mut().for_each(|pixel| *pixel += slope);
        residual * scaled
    }

    fn residuals(&self, frame: usize, image: &[T]) -> Vec<Residual> {
        let flux = image[..self.pixels].iter().map(|pixel| pixel.double()).sum();
        vec![plain(flux, self.flux[frame], self.inverse_variance[frame].sqrt())]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exact_pixels_that_are_left_out_do_not_count() {
        let whole = ImageTerm::<f64>::new(vec![1.0, 2.0, 3.0, 4.0, 5.0, 6.0], 3, 0.5).unwrap();
        let term = whole.clone().without(vec![false, true, false]);
        let few = ImageTerm::<f64>::new(vec![1.0, 3.0, 4.0, 6.0], 2, 0.5).unwrap();
        assert_eq!((term.degrees_of_freedom(1), whole.degrees_of_freedom(1)), (2, 3));
        let (mut gradient, mut expected) = ([0.0; 3], [0.0; 2]);
        let value = term.value_and_gradient(1, &[7.0, 9.0, 8.0], 1.5, &mut gradient);
        assert_eq!(value, few.value_and_gradient(1, &[7.0, 8.0], 1.5, &mut expected));
        assert_eq!(gradient, [expected[0], 0.0, expected[1]]);
        let squares = |term: &ImageTerm<f64>, image: &[f64]| -> Vec<f64> {
            term.residuals(1, image).iter().map(|residual| residual.value).collect()
        };
        assert_eq!(squares(&term, &[7.0, 9.0, 8.0]), squares(&few, &[7.0, 8.0]));
    }
}
