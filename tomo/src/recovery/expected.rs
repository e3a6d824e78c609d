//! χ² that a right model has, where data are no linear functions of visibilities: amplitudes lose their Gaussian errors at
//! low signal to noise, closure quantities more so. Noise is drawn anew about the model, and data are made of that.

use super::evidence::Evidence;
use crate::Error;
use crate::fit::settings::{Loss, LossKind};
use crate::fit::verdict::Statistics;
use kerrlight_common::frames::Frames;
use kerrlight_vlbi::data_terms::{AmplitudeTerm, ClosureTerm, DataTerm};
use kerrlight_vlbi::noise::add_thermal_noise;
use kerrlight_vlbi::observation::Observation;
use kerrlight_vlbi::operator::{Method, Operator, Transform};
use kerrlight_vlbi::products::ClosureKind;
use num_complex::Complex;

/// Draws of the noise: the tails of closure quantities are long, and nothing is fitted to a draw.
const DRAWS: u64 = 48;

impl Evidence<'_> {
    /// Visibilities of a movie for all rows of the data that have Stokes I, in their order; none without any.
    ///
    /// # Errors
    /// If the movie cannot be read, or a transform is out of range.
    pub fn model_visibilities(
        &self,
        movie: &Frames<f32>,
    ) -> Result<Option<Vec<Complex<f64>>>, Error> {
        let (Some((observation, frames)), Some(sky)) =
            (&self.measured.visibilities, self.measured.sky)
        else {
            return Ok(None);
        };
        let seen = observation.rows.iter().zip(frames);
        let seen: Vec<_> =
            seen.filter(|(row, _)| row.stokes_i(observation.basis).is_some()).collect();
        let mut uv = vec![Vec::new(); self.measured.times.len()];
        // Transforms give visibilities frame by frame.
        let mut places = vec![Vec::new(); uv.len()];
        for (at, (row, frame)) in seen.iter().enumerate() {
            uv[**frame].push(row.uv);
            places[**frame].push(at);
        }
        let mut all = vec![Complex::new(0.0, 0.0); seen.len()];
        for (frame, (uv, places)) in uv.into_iter().zip(&places).enumerate() {
            if uv.is_empty() {
                continue;
            }
            let transform =
                Transform::<f32>::new(sky, self.measured.pulse, &[uv], Method::Direct, 0)?;
            let mut model = vec![Complex::new(0.0, 0.0); transform.data()];
            transform.forward(&movie.image(frame)?, &mut model);
            for (at, v) in places.iter().zip(&model) {
                all[*at] = Complex::new(f64::from(v.re), f64::from(v.im));
            }
        }
        Ok(Some(all))
    }

    /// Residuals of the model beside drawn data; none for data whose errors are Gaussian, or of which a draw has none.
    pub(super) fn draws(&self, loss: &Loss, model: &[Complex<f64>]) -> Option<Vec<Statistics>> {
        let (observation, frames) = self.measured.visibilities.as_ref()?;
        let has_gains = self.measured.gains.is_some() && loss.data == LossKind::Amplitudes;
        let kinds = [LossKind::Image, LossKind::LightCurve];
        if has_gains || loss.data.is_visibilities() || kinds.contains(&loss.data) {
            return None;
        }
        let draw = |k: u64| {
            // Noise of simulated data has the seed itself: draws must not repeat it.
            let drawn = redrawn(observation, model, self.seed.wrapping_add(1000 + k));
            statistics(&drawn, frames, loss, model)
        };
        (0..DRAWS).map(draw).collect()
    }
}

/// The same measurement of a model, with other noise.
fn redrawn(observation: &Observation, model: &[Complex<f64>], seed: u64) -> Observation {
    let mut drawn = observation.clone();
    let mut visibilities = model.iter();
    for row in &mut drawn.rows {
        if row.stokes_i(observation.basis).is_some()
            && let Some(v) = visibilities.next()
        {
            // Both parallel hands; in a basis of Stokes parameters the second has no part in I.
            (row.products[0], row.products[1]) = (*v, *v);
        }
    }
    add_thermal_noise(&mut drawn, seed);
    drawn
}

/// Residuals of a model beside data of it.
fn statistics(
    drawn: &Observation,
    frames: &[usize],
    loss: &Loss,
    model: &[Complex<f64>],
) -> Option<Statistics> {
    let last = frames.iter().copied().max()?;
    let empty = Observation { rows: Vec::new(), ..drawn.clone() };
    let mut parts = vec![(empty, Vec::new()); last + 1];
    let mut visibilities = model.iter();
    for (row, frame) in drawn.rows.iter().zip(frames) {
        if row.stokes_i(drawn.basis).is_some() {
            parts[*frame].0.rows.push(*row);
            parts[*frame].1.push(*visibilities.next()?);
        }
    }
    let residuals = |(part, model): &(Observation, Vec<Complex<f64>>)| {
        let term = term(part, loss).filter(|_| !part.rows.is_empty());
        term.map_or_else(Vec::new, |term| term.residuals(model))
    };
    let all = Statistics::of(parts.iter().map(residuals), 1);
    (all.all.count() > 0).then_some(all)
}

/// The data of a frame, if it has any.
fn term(part: &Observation, loss: &Loss) -> Option<Box<dyn DataTerm<f64>>> {
    let least = loss.least_snr.unwrap_or(0.0);
    let closures =
        |kind| Some(Box::new(ClosureTerm::<f64>::new(part, kind, least).ok()?) as Box<_>);
    match loss.data {
        LossKind::Amplitudes => Some(Box::new(AmplitudeTerm::<f64>::new(part).ok()?)),
        LossKind::ClosurePhases => closures(ClosureKind::Phase),
        LossKind::LogClosureAmplitudes => closures(ClosureKind::LogAmplitude),
        // Their residuals are Gaussian.
        LossKind::Image
        | LossKind::Visibilities
        | LossKind::PolarizedVisibilities
        | LossKind::PolarimetricRatios
        | LossKind::LightCurve => None,
    }
}
