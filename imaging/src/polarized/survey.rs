//! All that is asked of the polarisation of a static image: the strength of its penalty, the image, and how noise scatters
//! it.

use super::{LinearPolarization, PolarizedProblem};
use crate::Error;
use crate::data::instants;
use crate::found::Survey;
use crate::settings::{StaticImageFile, StaticPolarization};
use crate::solve::minimum;
use crate::survey::{Stage, SurveyWatch, allowed, held};
use kerrlight_tomo::fit::setup::{FitData, Held, SolvedLeakage, best_held};
use kerrlight_tomo::fit::{FrameTerm, Weighted};
use kerrlight_vlbi::data_terms::DataTermError;
use kerrlight_vlbi::operator::ImageGrid;
use rayon::prelude::*;

/// Images of I, Q and U with what they were made of.
#[derive(Clone, Debug, PartialEq)]
pub struct PolarizedCandidate {
    /// Factor on the penalty.
    pub strength: f64,
    /// I, Q and U of all pixels, Jy, one after the other.
    pub images: Vec<f64>,
    /// The loss.
    pub loss: f64,
    /// Iterations that were made.
    pub iterations: usize,
    /// True if the loss had ceased to fall.
    pub has_converged: bool,
    /// χ² per datum.
    pub chi2: f64,
    /// Its numbers.
    pub numbers: LinearPolarization,
}

/// The polarisation that was found, with others that tell its errors.
#[derive(Clone, Debug)]
pub struct PolarizedSurvey {
    /// Strengths with the loss of frames that were held out.
    pub held: Vec<Held>,
    /// The images.
    pub found: PolarizedCandidate,
    /// Images with the other strengths that predict held-out frames as well.
    pub strengths: Vec<PolarizedCandidate>,
    /// Images of data with other noise, each beside a draw of total intensity.
    pub draws: Vec<PolarizedCandidate>,
    /// Leakage of the stations, where it is solved for.
    pub leakage: Option<SolvedLeakage>,
}

impl PolarizedSurvey {
    /// Error of a number: root mean square distance of the draws from it, and of the images with other strengths, added in
    /// quadrature; none without draws. Angles have a `period`, and are compared the short way round.
    pub fn error(
        &self,
        number: impl Fn(&LinearPolarization) -> f64,
        period: Option<f64>,
    ) -> Option<f64> {
        let here = number(&self.found.numbers);
        let square = |images: &[PolarizedCandidate]| {
            let apart = images.iter().map(|image| number(&image.numbers) - here);
            let short = apart.map(|x| match period {
                Some(period) => (x + 0.5 * period).rem_euclid(period) - 0.5 * period,
                None => x,
            });
            short.map(|x| x * x).sum::<f64>() / images.len().max(1) as f64
        };
        (self.draws.len() > 1).then(|| (square(&self.draws) + square(&self.strengths)).sqrt())
    }
}

/// Finds the polarisation of the image that a survey of total intensity has found; none if `watch` said no, or if no
/// polarisation is asked for. `measured` are the data of [`data::polarized`](crate::data::polarized).
///
/// # Errors
/// If there are no data.
pub fn survey_polarized(
    file: &StaticImageFile,
    measured: &FitData,
    survey: &Survey,
    watch: &SurveyWatch<'_>,
) -> Result<Option<PolarizedSurvey>, Error> {
    let Some(settings) = &file.polarization else { return Ok(None) };
    let grid = file.image.grid()?;
    let light = &survey.found().solution.image;
    let search = Search { file, settings, grid, watch };
    let term = search.term(measured)?;
    let frames: Vec<usize> = (0..measured.times.len()).collect();
    let instants = instants(&measured.times, &measured.files);
    let Some(losses) = search.hold_out(&*term.term, light, survey, &instants) else {
        return Ok(None);
    };
    let best = best_held(&losses).map_or(1.0, |best| best.value);
    let strength = |value: f64| {
        let problem = search.problem(&*term.term, light, value, frames.clone());
        search.solved(Stage::Strengths, &problem, value, survey)
    };
    let Some(mut found) = strength(best) else { return Ok(None) };
    let (mut round, mut is_stopped) = (0, false);
    // Rows see the leakage that was found last.
    let leakage = measured.in_turn(
        || {
            round += 1;
            // The first round has the image above; one that was stopped keeps what it has.
            if round > 1 && !is_stopped {
                match strength(best) {
                    Some(next) => found = next,
                    None => is_stopped = true,
                }
            }
            let once: Vec<f32> = found.images.iter().map(|x| *x as f32).collect();
            Ok::<_, Error>(once.repeat(measured.times.len()))
        },
        |_, _| {},
    )?;
    if is_stopped {
        return Ok(None);
    }
    // A round finds leakage after its image: the last leakage has no image yet.
    if leakage.is_some() {
        let Some(last) = strength(best) else { return Ok(None) };
        found = last;
    }
    let others: Vec<f64> = allowed(&losses).into_iter().filter(|value| *value != best).collect();
    let Some(strengths) = others.into_par_iter().map(strength).collect() else { return Ok(None) };
    let draws = search.draws(measured, survey, best)?;
    Ok(draws.map(|draws| PolarizedSurvey { held: losses, found, strengths, draws, leakage }))
}

struct Search<'a> {
    file: &'a StaticImageFile,
    settings: &'a StaticPolarization,
    grid: ImageGrid,
    watch: &'a SurveyWatch<'a>,
}

impl Search<'_> {
    fn term(&self, measured: &FitData) -> Result<Weighted<dyn FrameTerm<f64>>, Error> {
        let terms = measured.visibility_terms(&[self.settings.loss()], self.grid.pixels())?;
        terms.into_iter().next().ok_or_else(|| DataTermError::Empty.into())
    }

    fn problem<'a>(
        &self,
        term: &'a dyn FrameTerm<f64>,
        light: &'a [f64],
        strength: f64,
        frames: Vec<usize>,
    ) -> PolarizedProblem<'a> {
        let smoothness = self.settings.smoothness * strength;
        PolarizedProblem { term, frames, light, smoothness, side: self.file.image.pixels }
    }

    fn solved(
        &self,
        stage: Stage,
        problem: &PolarizedProblem<'_>,
        strength: f64,
        survey: &Survey,
    ) -> Option<PolarizedCandidate> {
        let start = vec![0.0; problem.parameters()];
        let mut objective = |x: &[f64], g: &mut [f64]| problem.value_and_gradient(x, g);
        let go_on = || (self.watch)(stage, 0);
        let least = minimum(&mut objective, &start, self.settings.iterations, &go_on)?;
        (self.watch)(stage, 1).then_some(())?;
        let images = problem.images(&least.parameters);
        let centre = survey.centre_uas(self.grid);
        Some(PolarizedCandidate {
            strength,
            chi2: problem.chi2(&images),
            numbers: LinearPolarization::measure(
                &images,
                self.grid,
                centre,
                self.settings.beam_uas,
            ),
            images,
            loss: least.loss,
            iterations: least.iterations,
            has_converged: least.has_converged,
        })
    }

    /// χ² per datum of frames that were not fitted, for each strength; nothing where one is given.
    fn hold_out(
        &self,
        term: &dyn FrameTerm<f64>,
        light: &[f64],
        survey: &Survey,
        instants: &[usize],
    ) -> Option<Vec<Held>> {
        let Some(settings) = &self.settings.strength else { return Some(Vec::new()) };
        let folds = settings.folds;
        let count = instants.last().map_or(1, |last| last + 1);
        let part = |fold: usize, seen: bool| -> Vec<usize> {
            let of = |frame: usize| instants[frame] * folds / count;
            (0..instants.len()).filter(|frame| (of(*frame) != fold) == seen).collect()
        };
        held(settings, |value, fold| {
            let seen = self.problem(term, light, value, part(fold, true));
            let found = self.solved(Stage::HeldOut, &seen, value, survey)?;
            Some(self.problem(term, light, value, part(fold, false)).chi2(&found.images))
        })
    }

    /// Images of the data with their noise once more, each beside the total intensity of a draw.
    fn draws(
        &self,
        measured: &FitData,
        survey: &Survey,
        strength: f64,
    ) -> Result<Option<Vec<PolarizedCandidate>>, Error> {
        let frames: Vec<usize> = (0..measured.times.len()).collect();
        let one = |k: usize| -> Result<Option<PolarizedCandidate>, Error> {
            let seed = self.file.seed.wrapping_add(1 + k as u64);
            let drawn = measured.perturbed(&[self.settings.loss()], 1.0, seed)?;
            let term = self.term(&drawn)?;
            let light = &survey.draws[k].solution.image;
            let problem = self.problem(&*term.term, light, strength, frames.clone());
            Ok(self.solved(Stage::Draws, &problem, strength, survey))
        };
        let all: Result<Vec<Option<PolarizedCandidate>>, Error> =
            (0..survey.draws.len()).into_par_iter().map(one).collect();
        Ok(all?.into_iter().collect())
    }
}
