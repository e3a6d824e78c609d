//! Visibilities of frames by an array of telescopes.

use super::terms::{Compared, FrameTerm};
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

/// Visibilities, or what is made of them, of the frames that were observed. Frames may have more images than transforms take,
/// which are the first then: that of Stokes I.
pub struct ScanTerm<T> {
    name: String,
    pixels: usize,
    quadratic: bool,
    scans: Vec<Option<Scan<T>>>,
}

impl<T: Float> Scan<T> {
    /// Pixels of the images that it takes.
    fn seen(&self) -> usize {
        self.transform.frames() * self.transform.pixels()
    }
}

impl<T: Float> ScanTerm<T> {
    /// Takes a scan a frame, of so many pixels in all its images. `quadratic`: whether χ² is so in the visibilities.
    ///
    /// # Panics
    /// If a transform and its term do not fit together.
    pub fn new(name: &str, pixels: usize, quadratic: bool, scans: Vec<Option<Scan<T>>>) -> Self {
        for scan in scans.iter().flatten() {
            assert_eq!(scan.transform.data(), scan.term.visibilities());
            assert!(scan.seen() <= pixels);
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
        // Devices sum frames of one image directly; several, for Stokes parameters, stay on the processor.
        let (sky, pulse, uv) = transform.direct().filter(|_| transform.pixels() == self.pixels)?;
        let of_pixel = |uv: [f64; 2]| (uv, pulse.transform(uv, sky.pixel_rad));
        let seen = uv.into_iter().map(of_pixel).collect();
        Some(Compared::Scan { sky, seen, with: term.comparison()? })
    }

    fn value_and_gradient(&self, frame: usize, image: &[T], weight: T, gradient: &mut [T]) -> f64 {
        let Some(scan) = &self.scans[frame] else { return 0.0 };
        let (Scan { transform, term }, seen) = (scan, ..scan.seen());
        let zero = Complex::new(T::zero(), T::zero());
        let mut model = vec![zero; transform.data()];
        transform.forward(&image[seen], &mut model);
        let mut of_model = vec![zero; model.len()];
        let value = term.value_and_gradient(&model, weight, &mut of_model);
        transform.adjoint(&of_model, &mut gradient[seen]);
        value
    }

    fn residuals(&self, frame: usize, image: &[T]) -> Vec<Residual> {
        let Some(scan) = &self.scans[frame] else { return Vec::new() };
        let mut model = vec![Complex::new(T::zero(), T::zero()); scan.transform.data()];
        scan.transform.forward(&image[..scan.seen()], &mut model);
        scan.term.residuals(&model)
    }
}
