//! Polarised visibilities as the terms of a loss.

use super::losses::MEMORY;
use super::{FitData, Result};
use crate::fit::Scan;
use crate::fit::settings::{Loss, LossKind};
use kerrlight_vlbi::data_terms::{DataTerm, PolarizedTerm, RatioTerm};
use kerrlight_vlbi::operator::{Float, Method, Operator, Transform};
use kerrlight_vlbi::polarimetry::MODELLED;
use num_complex::Complex;

impl FitData {
    /// The products of a frame with what takes its images to their visibilities; none where nothing was measured.
    ///
    /// # Errors
    /// If there are no visibilities, or data make no term.
    pub(super) fn products<T: Float>(
        &self,
        frame: usize,
    ) -> Result<Option<(Transform<T>, PolarizedTerm)>> {
        let (part, sky) = self.part(frame)?;
        let uv = PolarizedTerm::uv(&part);
        if uv.is_empty() {
            return Ok(None);
        }
        let leakage = self.leakage.as_ref().map(|leakage| &leakage.shared);
        let term = PolarizedTerm::new(&part, self.gains.as_ref(), leakage)?;
        let images = vec![uv; MODELLED];
        let transform = Transform::new(sky, self.pulse, &images, Method::Direct, MEMORY)?;
        Ok(Some((transform, term)))
    }

    /// The data of a frame that such a loss compares, as a scan; none where nothing was measured.
    pub(super) fn polarized_scan<T: Float>(
        &self,
        frame: usize,
        loss: &Loss,
    ) -> Result<Option<Scan<T>>> {
        if loss.data == LossKind::PolarimetricRatios {
            return self.ratios(frame, loss.least_snr.unwrap_or(0.0));
        }
        let scan = |(transform, term)| {
            let term: Box<dyn DataTerm<T> + Send> = Box::new(term);
            Scan { transform, term }
        };
        Ok(self.products(frame)?.map(scan))
    }

    fn ratios<T: Float>(&self, frame: usize, least_snr: f64) -> Result<Option<Scan<T>>> {
        let (part, sky) = self.part(frame)?;
        let uv = RatioTerm::uv(&part, least_snr);
        if uv.is_empty() {
            return Ok(None);
        }
        let term = Box::new(RatioTerm::new(&part, least_snr)?);
        let images = vec![uv; MODELLED];
        let transform = Transform::new(sky, self.pulse, &images, Method::Direct, MEMORY)?;
        Ok(Some(Scan { transform, term }))
    }

    /// The products of all frames beside those of images of I, Q and U, frame after frame.
    ///
    /// # Errors
    /// If data make no term.
    pub(super) fn beside(&self, movie: &[f32]) -> Result<Vec<FrameProducts>> {
        let pixels = movie.len() / self.times.len();
        let mut all = Vec::new();
        for (frame, images) in movie.chunks_exact(pixels).enumerate() {
            let Some((transform, term)) = self.products::<f32>(frame)? else { continue };
            let mut model = vec![Complex::new(0.0, 0.0); transform.data()];
            transform.forward(images, &mut model);
            all.push(FrameProducts { frame, term, model });
        }
        Ok(all)
    }
}

/// The products of a frame, and visibilities of a model: I of all rows, then Q, then U.
pub(super) struct FrameProducts {
    pub frame: usize,
    pub term: PolarizedTerm,
    pub model: Vec<Complex<f32>>,
}
