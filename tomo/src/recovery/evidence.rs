//! Evidence for a fit: what its residuals are judged by.

use crate::Error;
use crate::fit::settings::{FitFile, Loss, LossKind};
use crate::fit::setup::{FitData, errors};
use crate::fit::verdict::{Errors, Expected, Statistics, Tested, Verdict, ZeroSpacing, judge};
use kerrlight_common::frames::Frames;

/// A verdict with all that it is made of.
#[derive(Clone, Debug)]
pub struct DataVerdict {
    /// Verdict.
    pub verdict: Verdict,
    /// The kinds of data with their names.
    pub terms: Vec<(String, Tested)>,
    /// Flux at zero spacing, where short baselines have measured it.
    pub flux: Option<ZeroSpacing>,
    /// True if a model that lacks it is at fault.
    pub flux_counts: bool,
    /// Names of the stations.
    pub stations: Vec<String>,
    /// Times of the frames: M; hours of UTC of a static image.
    pub times: Vec<f64>,
    /// True if they are those of a static image.
    pub is_static: bool,
}

/// Baselines shorter than this part of 1/(field of view) see the whole flux: within 0.3 % for a source whose standard
/// deviation is a quarter of the field.
const SHORT: f64 = 0.05;

/// Losses in the order of the objective's terms: the image first.
fn ordered(losses: &[Loss]) -> impl Iterator<Item = &Loss> {
    let of = |image: bool| losses.iter().filter(move |l| (l.data == LossKind::Image) == image);
    of(true).chain(of(false))
}

/// Data, and what they are to the fit.
#[derive(Clone, Copy)]
pub struct Evidence<'a> {
    /// Settings; none of a static image, whose errors are those that its data state.
    pub file: Option<&'a FitFile>,
    /// Losses that are compared.
    pub losses: &'a [Loss],
    /// Seed of the settings.
    pub seed: u64,
    /// Data.
    pub measured: &'a FitData,
}

/// Kinds of data with their names, in the order of the losses, images first.
pub type Compared<'a> = (Vec<&'a str>, Vec<Statistics>);

impl Evidence<'_> {
    /// Judges images of all frames, with a kind of data, if any, that is not in the losses.
    ///
    /// # Errors
    /// If images cannot be read.
    pub fn judged(
        &self,
        (names, statistics): Compared<'_>,
        movie: &Frames<f32>,
        other: Option<(String, Tested)>,
    ) -> Result<DataVerdict, Error> {
        let model = self.model_visibilities(movie)?;
        let mut terms = Vec::new();
        for ((loss, name), statistics) in ordered(self.losses).zip(names).zip(statistics) {
            let has_background =
                self.measured.curve.as_ref().is_some_and(|curve| curve.background.is_some());
            let shared = has_background || self.measured.has_intrinsic_variability;
            let errors = match self.file {
                _ if shared => Errors::Shared,
                Some(file) => errors(file, loss.data),
                None => Errors::Stated,
            };
            let mut tested = Tested::gaussian(statistics, errors);
            // Draws of noise say nothing about data that have none.
            if tested.errors != Errors::Weight
                && let Some(model) = &model
                && let Some(draws) = self.draws(loss, model)
            {
                tested = tested.among(&draws);
            }
            terms.push((name.to_owned(), tested));
        }
        terms.extend(other);
        let flux = self.zero_spacing(movie)?;
        let knows_flux =
            |loss: &Loss| loss.data.is_visibilities() || loss.data == LossKind::Amplitudes;
        // Gains that are free may be what is missing.
        let flux_counts = self.measured.gains.is_none() && self.losses.iter().any(knows_flux);
        let observation = self.measured.visibilities.as_ref().map(|(observation, _)| observation);
        let stations = observation.map(|o| o.stations.iter().map(|s| s.name.clone()).collect());
        Ok(DataVerdict {
            verdict: judge(terms.iter().map(|(_, term)| term), flux.filter(|_| flux_counts)),
            terms,
            flux,
            flux_counts,
            stations: stations.unwrap_or_default(),
            times: self.measured.times.clone(),
            is_static: self.file.is_none(),
        })
    }

    /// Returns the measurements of baselines that resolve nothing of the field of view.
    fn zero_spacing(&self, movie: &Frames<f32>) -> Result<Option<ZeroSpacing>, Error> {
        let (Some((observation, frames)), Some(sky)) =
            (&self.measured.visibilities, self.measured.sky)
        else {
            return Ok(None);
        };
        let shortest = SHORT / (sky.pixel_rad * sky.width as f64);
        let flux = movie.sums()?;
        // Mean squares: those of noise are known, at any signal to noise, and phases are not needed.
        let (mut count, mut weights, mut squares, mut variance) = (0, 0.0, [0.0; 2], 0.0);
        for (row, frame) in observation.rows.iter().zip(frames) {
            let Some(i) = row.stokes_i(observation.basis) else { continue };
            // A row without an error would have all the weight.
            if row.uv[0].hypot(row.uv[1]) > shortest || i.noise_sigma <= 0.0 {
                continue;
            }
            let weight = i.noise_sigma.powi(-2);
            count += 1;
            weights += weight;
            let flux = flux.get(*frame).copied().unwrap_or(f64::NAN);
            squares[0] += weight * i.visibility.norm_sqr() - 2.0;
            squares[1] += weight * flux * flux;
            // |V|² has the variance 4 σ² (F² + σ²).
            variance += weight * flux * flux + 1.0;
        }
        // NaN stays what it is.
        let root = |sum: f64| if sum < 0.0 { 0.0 } else { (sum / weights).sqrt() };
        let [measured_jy, model_jy] = squares.map(root);
        let error_jy = variance.sqrt() / (weights * model_jy.max(weights.powf(-0.5)));
        Ok((count > 0).then_some(ZeroSpacing { measured_jy, error_jy, model_jy, count }))
    }
}

impl DataVerdict {
    /// Judges once more with what fits of the same model to other noise leave of each kind of data: mean and standard
    /// deviation of χ² per datum. `count` is how many fits these are.
    pub fn expect(&mut self, drawn: &[[f64; 2]], count: usize) {
        // The mean is as uncertain as its fits are few.
        let beyond = (1.0 + 1.0 / count.max(1) as f64).sqrt();
        for ((_, tested), [mean, deviation]) in self.terms.iter_mut().zip(drawn) {
            let Expected { chi2, spread, .. } = &mut tested.expected;
            (*chi2, *spread) = (*mean, spread.max(beyond * deviation));
        }
        let flux = self.flux.filter(|_| self.flux_counts);
        self.verdict = judge(self.terms.iter().map(|(_, tested)| tested), flux);
    }
}
