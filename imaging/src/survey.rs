//! All that is asked of a static image: the strength of its penalties, the best of several starts, what else the data
//! allow, and how noise scatters it.

use crate::Error;
use crate::data::{self, cadence, instants};
use crate::envelope::{Envelope, Profile};
use crate::found::{Calibration, Candidate, Survey};
use crate::problem::{FluxPrior, ImageProblem};
use crate::ring::Ring;
use crate::settings::{EnvelopeSettings, StaticImageFile, StrengthSettings};
use crate::shapes::{ShapeFit, best_shape, fit_shapes, refitted_flux};
use crate::solve::solve;
use crate::start;
use kerrlight_tomo::fit::linear::Prior;
use kerrlight_tomo::fit::setup::{FitData, Held, best_held};
use kerrlight_tomo::fit::{FrameTerm, Weighted};
use kerrlight_vlbi::observation::Observation;
use kerrlight_vlbi::operator::ImageGrid;
use rand::{RngExt, SeedableRng};
use rand_distr::StandardNormal;
use rand_pcg::Pcg64;
use rayon::prelude::*;

/// Stage of a survey.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stage {
    /// Images from all starts.
    Starts,
    /// Images without a part of the frames.
    HeldOut,
    /// Images with other strengths that held-out frames allow.
    Strengths,
    /// The image measured once more, with other noise.
    Draws,
}

/// Told what has been solved of a stage and how many solutions it has; says whether to go on.
pub type SurveyWatch<'a> = dyn Fn(Stage, usize) -> bool + Sync + 'a;

/// Finds the image of measured visibilities, from the starts of the settings and then from shapes that fit the same data; none if
/// `watch` said no.
///
/// # Errors
/// If a loss has no data.
pub fn survey(
    file: &StaticImageFile,
    measured: &FitData,
    shapes: &[ShapeFit],
    watch: &SurveyWatch<'_>,
) -> Result<Option<Survey>, Error> {
    let grid = file.image.grid()?;
    let terms = measured.visibility_terms(&file.loss, grid.pixels())?;
    let of_best = best_shape(shapes.iter()).map(|best| best.envelope(grid));
    let expected = file.envelope.map(|settings| expected(settings, of_best)).transpose()?;
    let envelope = expected.map(|(envelope, weight)| (envelope.shares(grid), weight));
    let of_shapes = shapes.iter().filter(|fit| fit.criterion.is_finite());
    let of_shapes = of_shapes.map(|fit| start::shape(&fit.shares));
    let begin = file.image.starts.iter().map(|start| start::image(*start, grid)).chain(of_shapes);
    let (priors, begin) = (file.priors()?, begin.collect());
    let search = Search { file, grid, priors, envelope, expected, begin, terms: &terms, watch };
    let frames: Vec<usize> = (0..measured.times.len()).collect();
    let middle = file.strength.as_ref().map_or(1.0, middle);
    let Some(starts) = search.starts(middle, &frames) else { return Ok(None) };
    let Some(held) = search.hold_out(least(&starts), measured) else { return Ok(None) };
    let allowed = allowed(&held);
    let strength = match held.is_empty() {
        true => middle,
        false => allowed.last().copied().unwrap_or(middle),
    };
    let starts = match strength == middle {
        true => Some(starts),
        false => search.starts(strength, &frames),
    };
    let Some(starts) = starts else { return Ok(None) };
    let best = least(&starts);
    if !starts[best].solution.loss.is_finite() {
        return Err(Error::Failed("no start has come to an image with a finite loss".to_owned()));
    }
    let others: Vec<f64> = allowed.iter().copied().filter(|value| *value != strength).collect();
    let of = |value: &f64| search.solved(Stage::Strengths, best, *value, &frames, search.flux());
    let Some(strengths) = others.par_iter().map(of).collect() else { return Ok(None) };
    let least = starts[best].solution.loss;
    let good = starts.iter().filter(|start| start.solution.loss <= 1.01 * least).collect();
    // The image's own strength first: it is the one that draws have where the data choose none.
    let chosen = [strength].into_iter().chain(others).collect();
    let shape = best_shape(shapes.iter());
    // What the prior does is taken off where a shape explains the data, from an image at a minimum.
    let is_taken_off = starts[best].solution.has_converged;
    let flux_sigma_jy = match is_taken_off && shape.is_some_and(|shape| shape.explains) {
        true => 0.0,
        false => file.image.flux_sigma_jy,
    };
    let others = Others { starts: good, strengths: chosen, flux_sigma_jy };
    let image = &starts[best].solution.image;
    let count = file.image.draws.unwrap_or(0);
    let Some(draws) = search.draws(measured, image, &others, &frames, count)? else {
        return Ok(None);
    };
    let known_sky = match shape {
        Some(shape) => search.calibration(measured, shape, &others, &frames, known_skies(count))?,
        None => None,
    };
    let envelope = expected.map(|(envelope, _)| envelope);
    Ok(Some(Survey { envelope, held, strength, starts, best, strengths, draws, known_sky }))
}

/// The image of visibilities of a source that does not change, as `kerrlight fit` finds it: from the starts of the settings and
/// from simple shapes that fit the same data.
///
/// # Errors
/// If a number of the settings is out of range, visibilities have no errors, or a loss has no data.
pub fn image(file: &StaticImageFile, observation: Observation) -> Result<Survey, Error> {
    file.check_all()?;
    let measured = data::total_intensity(file, observation, "the observation")?;
    measured.check_resolved()?;
    let shapes = fit_shapes(file, &measured, &|| true)?.unwrap_or_default();
    let found = survey(file, &measured, &shapes, &|_, _| true)?;
    found.ok_or_else(|| Error::Failed("the search for an image was told to stop".to_owned()))
}

/// The envelope of given settings, or else of the best shape, with the factor on the entropy relative to it.
fn expected(
    EnvelopeSettings { fwhm_uas, weight }: EnvelopeSettings,
    of_best: Option<Envelope>,
) -> Result<(Envelope, f64), Error> {
    let given = fwhm_uas.map(|fwhm_uas| Envelope { profile: Profile::Gaussian, fwhm_uas });
    let envelope = given.or(of_best);
    let missing = || Error::Failed("envelope.fwhm_uas is needed without shapes".to_owned());
    Ok((envelope.ok_or_else(missing)?, weight))
}

/// The strength in the middle of those to choose from.
fn middle(settings: &StrengthSettings) -> f64 {
    let mut values = settings.values.clone();
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}

/// The start with the least loss; NaN, of a start that went astray, is none.
fn least(starts: &[Candidate]) -> usize {
    let losses = starts.iter().enumerate().map(|(k, start)| (k, start.solution.loss));
    let finite = losses.filter(|(_, loss)| loss.is_finite());
    finite.min_by(|(_, a), (_, b)| a.total_cmp(b)).map_or(0, |(k, _)| k)
}

/// Strengths that predict held-out frames as well as the best within a standard error of the difference, rising.
pub(super) fn allowed(held: &[Held]) -> Vec<f64> {
    let Some(best) = best_held(held) else { return Vec::new() };
    let good = |one: &&Held| one.mean() <= best.mean() + one.error_beside(best);
    let mut values: Vec<f64> = held.iter().filter(good).map(|held| held.value).collect();
    values.sort_by(f64::total_cmp);
    values
}

/// Drops strengths of which fewer than half of the parts are known, then parts that are not known of all others: NaN stands for
/// a fit that did not come to a minimum, which says nothing. Nothing is left where fewer than two parts are.
fn voting(mut held: Vec<Held>) -> Vec<Held> {
    let known = |held: &Held| held.losses.iter().filter(|loss| loss.is_finite()).count();
    held.retain(|one| 2 * known(one) >= one.losses.len());
    let parts = held.first().map_or(0, |one| one.losses.len());
    let votes = |part: &usize| held.iter().all(|one| one.losses[*part].is_finite());
    let kept: Vec<usize> = (0..parts).filter(votes).collect();
    if kept.len() < 2 {
        return Vec::new();
    }
    for one in &mut held {
        one.losses = kept.iter().map(|part| one.losses[*part]).collect();
    }
    held
}

/// Returns the losses of each strength and each part of the frames; none if one is missing.
pub(super) fn held(
    settings: &StrengthSettings,
    loss: impl Fn(f64, usize) -> Option<f64> + Sync,
) -> Option<Vec<Held>> {
    let StrengthSettings { values, folds } = settings;
    let cases: Vec<(f64, usize)> =
        values.iter().flat_map(|value| (0..*folds).map(move |fold| (*value, fold))).collect();
    let losses: Vec<f64> =
        cases.par_iter().map(|(value, fold)| loss(*value, *fold)).collect::<Option<_>>()?;
    let each = values.iter().zip(losses.chunks(*folds));
    Some(each.map(|(value, losses)| Held { value: *value, losses: losses.to_vec() }).collect())
}

/// Returns the number of images of a known sky beside so many draws: half as many, and two at least, from which on what a method
/// adds has an error.
pub fn known_skies(draws: usize) -> usize {
    if draws == 0 { 0 } else { draws.div_ceil(2).max(2) }
}

/// Distance of frames over the least one, from which on there is a gap between scans.
const GAP: f64 = 1.5;

/// The part that each frame is held out with. Frames of a scan see the sky through nearly the same baselines, and would tell
/// the fit what it is to predict: scans are held out whole, where there are two of them for each part. So are frames of several files at
/// one hour of UTC.
fn parts(times: &[f64], files: &[usize], folds: usize, average_h: f64) -> Vec<usize> {
    let scans = |apart: f64| {
        let mut scans = vec![0; times.len()];
        for (frame, pair) in times.windows(2).enumerate() {
            scans[frame + 1] = scans[frame] + usize::from(pair[1] - pair[0] > apart);
        }
        scans
    };
    // Averages lie on the clock: those of a scan are less than two of their lengths apart, and a ragged one has two that are
    // much nearer. Shorter gaps tell scans where longer ones leave too few.
    let near = GAP * cadence(times, files);
    let far = near.max((2.0 - 1e-6) * average_h);
    let is_enough = |scans: &Vec<usize>| scans.last().is_some_and(|last| last + 1 >= 2 * folds);
    let each = [far, near].map(scans).into_iter().find(is_enough);
    let each = each.unwrap_or_else(|| instants(times, files));
    each.into_iter().map(|of| of % folds).collect()
}

struct Search<'a> {
    file: &'a StaticImageFile,
    grid: ImageGrid,
    priors: Vec<Prior>,
    /// Light that is expected, with the factor on the entropy relative to it, and its shares in the pixels.
    expected: Option<(Envelope, f64)>,
    envelope: Option<(Vec<f64>, f64)>,
    /// Shares of the flux in the pixels, for each start.
    begin: Vec<Vec<f64>>,
    terms: &'a [Weighted<dyn FrameTerm<f64>>],
    watch: &'a SurveyWatch<'a>,
}

impl Search<'_> {
    fn flux(&self) -> FluxPrior {
        FluxPrior { jy: self.file.image.flux_jy, sigma_jy: self.file.image.flux_sigma_jy }
    }

    /// The prior about a flux that is off by this, Jy. A flux below 0 is none: far from it for any prior that says something.
    fn flux_about(&self, off: f64) -> FluxPrior {
        let FluxPrior { jy, sigma_jy } = self.flux();
        FluxPrior { jy: (jy + off).max(0.01 * jy), sigma_jy }
    }

    fn problem(&self, strength: f64, frames: &[usize], flux: FluxPrior) -> ImageProblem<'_> {
        let (terms, priors, side) = (self.terms, &self.priors, self.file.image.pixels);
        let envelope = self.envelope.as_ref().map(|(shares, weight)| (&shares[..], *weight));
        ImageProblem { terms, frames: frames.to_vec(), priors, envelope, strength, flux, side }
    }

    /// The image from a start with a strength.
    fn solved(
        &self,
        stage: Stage,
        start: usize,
        strength: f64,
        frames: &[usize],
        flux: FluxPrior,
    ) -> Option<Candidate> {
        let problem = self.problem(strength, frames, flux);
        let begin = problem.parameters_of(&self.begin[start]);
        self.from(stage, &problem, &begin, start)
    }

    fn from(
        &self,
        stage: Stage,
        problem: &ImageProblem<'_>,
        begin: &[f64],
        start: usize,
    ) -> Option<Candidate> {
        let go_on = || (self.watch)(stage, 0);
        let solution = solve(problem, begin, self.file.image.iterations, &go_on)?;
        (self.watch)(stage, 1).then_some(())?;
        let ring = self.file.ring.as_ref();
        Some(Candidate {
            start,
            strength: problem.strength,
            chi2: problem.chi2(&solution.image),
            ring: ring.and_then(|ring| Ring::measure(&solution.image, self.grid, ring)),
            solution,
        })
    }

    fn starts(&self, strength: f64, frames: &[usize]) -> Option<Vec<Candidate>> {
        let of = |k: usize| self.solved(Stage::Starts, k, strength, frames, self.flux());
        (0..self.begin.len()).into_par_iter().map(of).collect()
    }

    /// The loss of frames that were not fitted, for each strength; nothing where one is given.
    fn hold_out(&self, start: usize, measured: &FitData) -> Option<Vec<Held>> {
        let Some(settings) = &self.file.strength else { return Some(Vec::new()) };
        let folds = settings.folds;
        let times = &measured.times;
        let average_h = self.file.data.visibilities.average_s / 3600.0;
        let parts = parts(times, &measured.files, folds, average_h);
        let part = |fold: usize, seen: bool| -> Vec<usize> {
            (0..times.len()).filter(|frame| (parts[*frame] != fold) == seen).collect()
        };
        held(settings, |strength, fold| {
            let found =
                self.solved(Stage::HeldOut, start, strength, &part(fold, true), self.flux())?;
            if !found.solution.has_converged {
                return Some(f64::NAN);
            }
            let unseen = self.problem(strength, &part(fold, false), self.flux());
            Some(unseen.misfit(&found.solution.image))
        })
        .map(voting)
    }

    /// Images of measurements of an image with other noise, with priors of the flux about drawn values and envelopes of drawn
    /// widths, each from one of the starts that are as good as the best, with one of the strengths that are.
    fn draws(
        &self,
        measured: &FitData,
        image: &[f64],
        others: &Others<'_>,
        frames: &[usize],
        count: usize,
    ) -> Result<Option<Vec<Candidate>>, Error> {
        let one = |k: usize| -> Result<Option<Candidate>, Error> {
            let seed = self.file.seed.wrapping_add(1 + k as u64);
            let drawn = data::redrawn(measured, &self.file.loss, image, seed)?;
            let terms = drawn.visibility_terms(&self.file.loss, self.grid.pixels())?;
            let mut random = Pcg64::seed_from_u64(seed);
            let [of_flux, of_width]: [f64; 2] = [(); 2].map(|()| random.sample(StandardNormal));
            let flux = self.flux_about(of_flux * others.flux_sigma_jy);
            let envelope = self.expected.map(|(expected, weight)| {
                let fwhm_uas = expected.fwhm_uas * (ENVELOPE_SPREAD * of_width).exp();
                (Envelope { fwhm_uas, ..expected }.shares(self.grid), weight)
            });
            let envelope = envelope.as_ref().map(|(shares, weight)| (&shares[..], *weight));
            let strength = others.strengths[k % others.strengths.len()];
            let problem =
                ImageProblem { terms: &terms, envelope, ..self.problem(strength, frames, flux) };
            let start = others.starts[k % others.starts.len()];
            let mut begin = start.solution.parameters.clone();
            // The flux counts from the mean of its prior, which is drawn here: it stays the same.
            if let Some(last) = begin.last_mut() {
                *last += (self.flux().jy / flux.jy).ln();
            }
            Ok(self.from(Stage::Draws, &problem, &begin, start.start))
        };
        let all: Result<Vec<Option<Candidate>>, Error> =
            (0..count).into_par_iter().map(one).collect();
        Ok(all?.into_iter().collect())
    }
}

impl Search<'_> {
    /// Images of measurements of a simple shape.
    fn calibration(
        &self,
        measured: &FitData,
        shape: &ShapeFit,
        others: &Others<'_>,
        frames: &[usize],
        count: usize,
    ) -> Result<Option<Calibration>, Error> {
        let image: Vec<f64> = shape.shares.iter().map(|share| share * shape.flux_jy).collect();
        let ring = self.file.ring.as_ref();
        let ring = ring.and_then(|ring| Ring::measure(&image, self.grid, ring));
        let Some(images) = self.draws(measured, &image, others, frames, count)? else {
            return Ok(None);
        };
        let one = |k: usize| self.refitted_flux(measured, shape, &image, frames, k);
        let fluxes: Result<Option<Vec<f64>>, Error> = match shape.explains {
            // As many as draws of the image: shapes are fitted fast.
            true => (0..2 * count).into_par_iter().map(one).collect(),
            false => Ok(Some(Vec::new())),
        };
        let explains = shape.explains;
        Ok(fluxes?.map(|fluxes| Calibration { shape: image, explains, ring, images, fluxes }))
    }

    /// The flux that a simple shape has in measurements of itself with other noise, and with the prior of the flux about a drawn value.
    fn refitted_flux(
        &self,
        measured: &FitData,
        shape: &ShapeFit,
        image: &[f64],
        frames: &[usize],
        k: usize,
    ) -> Result<Option<f64>, Error> {
        let seed = self.file.seed.wrapping_add(1 + k as u64);
        let drawn = data::redrawn(measured, &self.file.loss, image, seed)?;
        let terms = drawn.visibility_terms(&self.file.loss, self.grid.pixels())?;
        let mut random = Pcg64::seed_from_u64(seed);
        let off: f64 = random.sample(StandardNormal);
        let flux = self.flux_about(off * self.flux().sigma_jy);
        let problem = ImageProblem { terms: &terms, ..self.problem(1.0, frames, flux) };
        let go_on = || (self.watch)(Stage::Draws, 0);
        Ok(refitted_flux(shape, &problem, self.file, self.grid, &go_on))
    }
}

/// Standard deviation of the logarithm of the envelope's width: how far those from different baselines are apart.
const ENVELOPE_SPREAD: f64 = 0.1;

/// Choices of draws.
struct Others<'a> {
    /// Starts with a loss within 1 % of the least.
    starts: Vec<&'a Candidate>,
    /// Strengths that are as good as the best.
    strengths: Vec<f64>,
    /// Standard deviation of the flux that their priors are about, Jy: 0 where what the prior does is taken off.
    flux_sigma_jy: f64,
}

#[cfg(test)]
mod tests {
    use super::*;

    /// One fit of four that ended early takes its part from all strengths; a strength of which most did says nothing.
    #[test]
    fn exact_fits_without_a_minimum_do_not_vote() {
        let held = |value, losses: [f64; 4]| Held { value, losses: losses.to_vec() };
        let n = f64::NAN;
        let all = vec![
            held(1.0, [n, n, 3.0, n]),
            held(3.0, [n, 2.0, 3.0, 4.0]),
            held(9.0, [406.0, 2.5, 3.5, 4.5]),
        ];
        let left = voting(all);
        assert_eq!(left.iter().map(|one| one.value).collect::<Vec<_>>(), [3.0, 9.0]);
        assert_eq!(left[0].losses, [2.0, 3.0, 4.0]);
        assert_eq!(left[1].losses, [2.5, 3.5, 4.5]);
        assert!(voting(vec![held(1.0, [n, n, 3.0, 4.0]), held(3.0, [n, n, n, 4.0])]).len() == 1);
        assert!(voting(vec![held(1.0, [n, 2.0, n, n])]).is_empty());
    }

    #[test]
    fn exact_scans_are_held_out_whole() {
        let times = [0.0, 1.0, 2.0, 9.0, 10.0, 20.0, 21.0, 30.0];
        assert_eq!(parts(&times, &[], 2, 0.0), [0, 0, 0, 1, 1, 0, 0, 1]);
        assert_eq!(
            parts(&times, &[], 3, 0.0),
            [0, 1, 2, 0, 1, 2, 0, 1],
            "too few scans: frame by frame"
        );
        assert_eq!(
            parts(&[0.0, 5.0, 10.0, 15.0], &[], 2, 0.0),
            [0, 1, 0, 1],
            "frames without a gap"
        );
        // Averages of five minutes on the clock: a ragged scan has two that are nearer, and whole scans stay together.
        let minutes = [2.5, 7.5, 22.5, 27.5, 34.0, 36.0, 42.5, 47.5];
        let more = minutes.iter().map(|x| x + 90.0);
        let night: Vec<f64> = minutes.iter().copied().chain(more).collect();
        assert_eq!(parts(&night, &[], 2, 5.0), [0, 0, 1, 1, 1, 1, 1, 1, 0, 0, 1, 1, 1, 1, 1, 1]);
        // Gaps of one to two averages are those of scans where there are no others.
        let close = [2.5, 7.5, 15.5, 20.5, 28.5, 33.5, 41.5, 46.5];
        assert_eq!(parts(&close, &[], 2, 5.0), [0, 0, 1, 1, 0, 0, 1, 1]);
        // Two bands of one night a second apart, with scans and without gaps.
        let both = [0.0, 1.0, 10.0, 11.0, 40.0, 41.0, 50.0, 51.0, 80.0, 81.0, 120.0, 121.0];
        let bands = [0, 1, 0, 1, 0, 1, 0, 1, 0, 1, 0, 1];
        assert_eq!(parts(&both, &bands, 2, 0.0), [0, 0, 0, 0, 1, 1, 1, 1, 0, 0, 1, 1]);
        let steady = [0.0, 1.0, 10.0, 11.0, 20.0, 21.0];
        assert_eq!(parts(&steady, &bands[..6], 2, 0.0), [0, 0, 1, 1, 0, 0]);
        // Files with a frame each have no cadence: every hour is an instant.
        assert_eq!(parts(&[1.0, 2.0, 2.0, 3.0, 4.0], &[0, 1, 2, 3, 4], 2, 0.0), [0, 1, 1, 0, 1]);
    }
}
