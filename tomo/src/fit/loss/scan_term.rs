//! Visibilities of frames by an array of telescopes.

use super::device_observable::Compared;
use super::terms::FrameTerm;
use kerrlight_common::simd::Float;
use kerrlight_vlbi::data_terms::{DataTerm, Residual};
use kerrlight_vlbi::operator::{Operator, Transform};
use num_complex::Complex;

/// Measurements of a frame by an array of telescopes.
pub struct Scan<T> {
    /// Transform of the frame, an image or several for Stokes parameters, to its visibilities.
    pub transform: Transform<T>,
    /// Data term of the visibilities.
    pub term: Box<dyn DataTerm<T> + Send>,
}

/// Visibilities, or what is made of them, of the frames that were observed.
pub struct ScanTerm<T> {
    name: String,
    pixels: usize,
    quadratic: bool,
    scans: Vec<Option<Scan<T>>>,
}

impl<T: Float> ScanTerm<T> {
    /// Takes a scan a frame. `quadratic`: whether χ² is so in the visibilities.
    ///
    /// # Panics
    /// If a transform and its term do not fit together.
    pub fn new(name: &str, pixels: usize, quadratic: bool, scans: Vec<Option<Scan<T>>>) -> Self {
        for scan in scans.iter().flatten() {
            assert_eq!(scan.transform.data(), scan.term.visibilities());
            assert_eq!(scan.transform.frames() * scan.transform.pixels(), pixels);
        }
        Self { name: name.to_owned(), pixels, quadratic, scans }
    }
}

impl<T: Float> FrameTerm<T> for ScanTerm<T> {
    fn name(&self) -> &str {
        &self.name
    }

    fn frames(&self) -> usize {
        self.scans.len()
    }

    fn pixels(&self) -> usize {
        self.pixels
    }

    fn degrees_of_freedom(&self, frame: usize) -> usize {
        self.scans[frame].as_ref().map_or(0, |scan| scan.term.degrees_of_freedom())
    }

    fn is_quadratic(&self) -> bool {
        self.quadratic
    }

    fn is_scale_free(&self) -> bool {
        self.scans.iter().flatten().all(|scan| scan.term.is_scale_free())
    }

    fn compared(&self, frame: usize) -> Option<Compared> {
        let Some(Scan { transform, term }) = &self.scans[frame] else {
            return Some(Compared::Nothing);
        };
        // Devices sum one image directly; several, for Stokes parameters, stay on the processor.
        let (sky, pulse, uv) = transform.direct().filter(|_| transform.frames() == 1)?;
        let of_pixel = |uv: [f64; 2]| (uv, pulse.transform(uv, sky.pixel_rad));
        let seen = uv.into_iter().map(of_pixel).collect();
        Some(Compared::Scan { sky, seen, with: term.comparison()? })
    }

    fn value_and_gradient(&self, frame: usize, image: &[T], weight: T, gradient: &mut [T]) -> f64 {
        let Some(Scan { transform, term }) = &self.scans[frame] else { return 0.0 };
        let zero = Complex::new(T::zero(), T::zero());
        let mut model = vec![zero; transform.data()];
        transform.forward(image, &mut model);
        let mut of_model = vec![zero; model.len()];
        let value = term.value_and_gradient(&model, weight, &mut of_model);
        transform.adjoint(&of_model, gradient);
        value
    }

    fn residuals(&self, frame: usize, image: &[T]) -> Vec<Residual> {
        let Some(Scan { transform, term }) = &self.scans[frame] else { return Vec::new() };
        let mut model = vec![Complex::new(T::zero(), T::zero()); transform.data()];
        transform.forward(image, &mut model);
        term.residuals(&model)
    }
}

/// Data of total intensity in a fit whose frames are images of several Stokes parameters, I first.
pub struct IntensityTerm<T: Float> {
    /// The data.
    pub term: Box<dyn FrameTerm<T>>,
    /// Images of a frame.
    pub images: usize,
}

impl<T: Float> FrameTerm<T> for IntensityTerm<T> {
    fn name(&self) -> &str {
        self.term.name()
    }

    fn frames(&self) -> usize {
        self.term.frames()
    }

    fn pixels(&self) -> usize {
        self.term.pixels() * self.images
    }

    fn degrees_of_freedom(&self, frame: usize) -> usize {
        self.term.degrees_of_freedom(frame)
    }

    fn is_quadratic(&self) -> bool {
        self.term.is_quadratic()
    }

    fn is_convex(&self) -> bool {
        self.term.is_convex()
    }

    fn is_scale_free(&self) -> bool {
        self.term.is_scale_free()
    }

    fn value_and_gradient(&self, frame: usize, image: &[T], weight: T, gradient: &mut [T]) -> f64 {
        let first = ..self.term.pixels();
        self.term.value_and_gradient(frame, &image[first], weight, &mut gradient[first])
    }

    fn residuals(&self, frame: usize, image: &[T]) -> Vec<Residual> {
        self.term.residuals(frame, &image[..self.term.pixels()])
    }
}
