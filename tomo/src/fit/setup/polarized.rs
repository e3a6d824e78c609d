//! Polarised visibilities as the data of a fit.

use super::{Measured, Result};
use crate::fit::settings::{FitError, FitFile, Kind, Loss, LossKind, Start, refuse};
use crate::fit::{Scan, Seen};
use crate::interferometry::data_terms::{DataTerm, PolarizedTerm, RatioTerm};
use crate::interferometry::operator::{Float, Method, Operator, Pulse, Transform};
use crate::interferometry::polarimetry::MODELLED;
use crate::polarization::StokesParameter;
use num_complex::Complex;

/// Stokes parameters that polarised visibilities are made of, in the order of a frame's images.
pub(super) const PARAMETERS: [StokesParameter; MODELLED] =
    [StokesParameter::I, StokesParameter::Q, StokesParameter::U];

/// Whether any of the data compare Q and U of baselines.
pub(super) fn is_polarized(losses: &[Loss]) -> bool {
    losses.iter().any(|loss| loss.data.is_polarized())
}

/// Images of a frame that these losses see.
pub(super) fn images(losses: &[Loss]) -> usize {
    if is_polarized(losses) { MODELLED } else { 1 }
}

/// What polarised visibilities see; nothing where they are not fitted.
///
/// # Errors
/// If there is no field, or other settings contradict them.
pub(super) fn seen(file: &FitFile) -> Result<Option<Seen>> {
    if !is_polarized(&file.loss) {
        return Ok(None);
    }
    if file.polarization.is_none() {
        let why = "Q and U need the field of the gas: add a table [polarization]";
        return Err(FitError::missing("polarization", why).into());
    }
    let image = file.loss.iter().any(|loss| loss.data == LossKind::Image);
    if image || file.movie.is_some() {
        refuse!(
            "a loss of polarized-visibilities or polarimetric-ratios stands with other visibilities alone: [movie] and a loss of images are not allowed"
        );
    }
    Ok(Some(Seen::StokesImages(PARAMETERS.to_vec())))
}

/// Refuses what is not solved for together with polarised visibilities or leakage.
///
/// # Errors
/// Says what.
pub(super) fn check(file: &FitFile) -> Result<()> {
    if is_polarized(&file.loss) && file.unknown_world()?.is_some() {
        refuse!(
            "parameters of [world] are not searched with polarized-visibilities or polarimetric-ratios"
        );
    }
    let solves = file.instrument.as_ref().is_some_and(|instrument| instrument.leakage.is_some());
    let draws = file.observation.as_ref().is_some_and(|seen| seen.leakage.is_some());
    let has = |kind| file.loss.iter().any(|loss| loss.data == kind);
    if (solves || draws) && !has(LossKind::PolarizedVisibilities) {
        let key = if solves { "instrument.leakage" } else { "observation.leakage" };
        refuse!("{key} needs a loss with data = \"polarized-visibilities\"");
    }
    if solves && has(LossKind::PolarimetricRatios) {
        refuse!(
            "instrument.leakage and a loss of polarimetric-ratios exclude each other: leakage does not cancel in ratios"
        );
    }
    if solves && file.held_out.is_some() {
        refuse!("instrument.leakage and held_out exclude each other");
    }
    let is_linear = file.representation.kind == Kind::LinearGrid;
    if solves && !is_linear && !matches!(file.training.start, Start::Linear { .. }) {
        refuse!(
            "instrument.leakage needs representation.kind = \"linear-grid\", or training.start = {{ linear = {{ nodes, stride, steps }} }}: leakage is solved for beside a linear grid"
        );
    }
    Ok(())
}

/// Movies of I, Q and U of images that follow each other in each frame.
pub(super) fn split(all: &[f64], pixels: usize) -> [Vec<f64>; MODELLED] {
    let of = |k: usize| all.chunks_exact(pixels).skip(k).step_by(MODELLED).flatten().copied();
    [0, 1, 2].map(|k| of(k).collect())
}

/// Exponentials of a frame up to this many bytes are kept.
const MEMORY: usize = 8 << 20;

impl Measured {
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
        let transform = Transform::new(sky, Pulse::Triangle, &images, Method::Direct, MEMORY)?;
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
        let transform = Transform::new(sky, Pulse::Triangle, &images, Method::Direct, MEMORY)?;
        Ok(Some(Scan { transform, term }))
    }

    /// The products of all frames beside those of images of I, Q and U, frame after frame.
    ///
    /// # Errors
    /// If data make no term.
    pub(super) fn beside(&self, movie: &[f32]) -> Result<Vec<Beside>> {
        let pixels = movie.len() / self.times.len();
        let mut all = Vec::new();
        for (frame, images) in movie.chunks_exact(pixels).enumerate() {
            let Some((transform, term)) = self.products::<f32>(frame)? else { continue };
            let mut model = vec![Complex::new(0.0, 0.0); transform.data()];
            transform.forward(images, &mut model);
            all.push(Beside { frame, term, model });
        }
        Ok(all)
    }
}

/// The products of a frame, and visibilities of a model: I of all rows, then Q, then U.
pub(super) struct Beside {
    pub frame: usize,
    pub term: PolarizedTerm,
    pub model: Vec<Complex<f32>>,
}
