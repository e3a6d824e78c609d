//! The run of a static image. It takes seconds and keeps no intermediate state: a stopped run starts over and ends in the
//! same bytes.

mod numbers;
mod page;
mod phases;
mod pictures;
mod polarized;
mod results;
mod words;

use super::closures;
use super::data;
use super::folder::{self, Folder};
use super::results::gains::{Gains, KnownSky, Others};
use super::results::verdict::{DataVerdict, Evidence};
use crate::answer::Answer;
use crate::interrupt::{Interrupted, SignalGuard};
use crate::progress;
use crate::session;
use anyhow::bail;
use kerrlight_common::frames::Frames;
use kerrlight_imaging::settings::{StaticImageFile, StrengthSettings};
use kerrlight_imaging::{
    Calibration, Candidate, PolarizedSurvey, Ring, Shape, ShapeFit, Stage, Survey, fit_shapes,
    survey, survey_polarized,
};
use kerrlight_tomo::fit::FrameTerm;
use kerrlight_tomo::fit::settings::{Loss, LossKind};
use kerrlight_tomo::fit::setup::FitData;
use kerrlight_tomo::fit::verdict::Statistics;
use kerrlight_vlbi::files::images;
use polarized::Polarized;
use std::path::Path;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Instant;

const STOPPED: &str =
    "stopped: a static image keeps no intermediate state; `kerrlight fit --resume` starts over";

/// Settings and data.
pub struct Prepared {
    file: StaticImageFile,
    measured: FitData,
    /// All products of the feeds, where polarisation is asked for.
    polarized: Option<FitData>,
}

/// The image that was found, with its evidence.
struct Found<'a> {
    file: &'a StaticImageFile,
    measured: &'a FitData,
    folder: &'a Folder,
    survey: Survey,
    /// Simple shapes that were fitted to the same data.
    shapes: Vec<ShapeFit>,
    /// The image once a frame.
    movie: Frames<f32>,
    judged: DataVerdict,
    gains: Option<Gains>,
    polarized: Option<Polarized>,
    /// Kinds of data that were not fitted, with χ² per datum.
    beside: Vec<(&'static str, f64)>,
    begun: Instant,
}

impl Prepared {
    /// Reads the data; relative paths start from `base_dir`.
    pub fn new(file: StaticImageFile, base_dir: &Path) -> anyhow::Result<Self> {
        let knows_flux =
            |loss: &Loss| matches!(loss.data, LossKind::Visibilities | LossKind::Amplitudes);
        if file.image.draws.is_some() && !file.loss.iter().any(knows_flux) {
            bail!(
                "image.draws needs a loss of amplitudes or of visibilities: closure quantities alone do not tell how large \
                 the noise of a measurement of the image would be beside it"
            );
        }
        let (measured, polarized) = data::of_static(&file, base_dir)?;
        let pixels = file.image.pixels * file.image.pixels;
        // Only to refuse losses without data before a folder is made.
        measured.visibility_terms::<f64>(&file.loss, pixels)?;
        if let (Some(measured), Some(polarization)) = (&polarized, &file.polarization) {
            measured.visibility_terms::<f64>(&[polarization.loss()], pixels)?;
        }
        Ok(Self { file, measured, polarized })
    }
}

/// Finds the image, and writes all that was found.
pub fn run(prepared: &Prepared, folder: &Folder) -> anyhow::Result<Answer> {
    let Prepared { file, measured, .. } = prepared;
    let begun = Instant::now();
    folder.file(folder::LOG)?.write(b"")?;
    let (survey, shapes, polarized) = searched(prepared)?;
    let movie = still(&survey.found().solution.image, measured);
    let evidence = Evidence { file: None, losses: &file.loss, seed: file.seed, measured };
    let (polarized, tested) = match (&prepared.polarized, polarized) {
        (Some(measured), Some(of_polarized)) => {
            Polarized::new(file, measured, of_polarized, &survey, folder)?.unzip()
        }
        _ => (None, None),
    };
    let mut judged = evidence.judged(compared(file, measured, &survey)?, &movie, tested)?;
    judged.expect(&numbers::chi2_of_draws(&survey), survey.draws_that_count().len());
    let gains = Gains::beside(&evidence, &movie, &others(&survey, measured), folder)?;
    let beside = beside(file, measured, &survey);
    let found = Found {
        file,
        measured,
        folder,
        survey,
        shapes,
        movie,
        judged,
        gains,
        polarized,
        beside,
        begun,
    };
    found.images()?;
    let results = found.results();
    folder.keep("results.json", &results)?;
    found.report(&evidence, &results)?;
    let files = ["report.html", "results.json", "image.npz", "image.fits", "image.png"];
    Ok(folder.answer(&found.worth(), serde_json::to_value(results)?, &files))
}

/// An image once a frame.
fn still(image: &[f64], measured: &FitData) -> Frames<f32> {
    let image: Vec<f32> = image.iter().map(|x| *x as f32).collect();
    Frames::of(image.repeat(measured.times.len()), image.len())
}

/// Images that tell errors of gains.
fn others(survey: &Survey, measured: &FitData) -> Others {
    let of = |image: &Candidate| still(&image.solution.image, measured);
    let known = |known: &Calibration| KnownSky {
        sky: still(&known.shape, measured),
        images: known.at_minimum().map(of).collect(),
        explains: known.explains,
    };
    Others {
        draws: survey.draws_that_count().into_iter().map(of).collect(),
        known_sky: survey.calibration().map(known),
    }
}

/// The search, with its progress; an error if a signal stops it.
fn searched(
    prepared: &Prepared,
) -> anyhow::Result<(Survey, Vec<ShapeFit>, Option<PolarizedSurvey>)> {
    let Prepared { file, measured, polarized } = prepared;
    let (rows, frames) = (
        measured.visibilities.iter().flat_map(|(seen, _)| seen.stokes_i()).count(),
        measured.times.len(),
    );
    let losses: Vec<&str> = file.loss.iter().map(|loss| loss.data.label()).collect();
    eprintln!(
        "{}: {}; {rows} visibilities in {frames} frames; an image of {} x {} pixels, {:.2} µas each",
        file.title,
        losses.join(", "),
        file.image.pixels,
        file.image.pixels,
        file.image.field_uas / file.image.pixels as f64,
    );
    for used in closures::sentences(measured, &file.loss) {
        eprintln!("{used}");
    }
    let values = |s: &Option<StrengthSettings>| s.as_ref().map_or(0, |s| s.values.len() * s.folds);
    let draws = file.image.draws.unwrap_or(0);
    let of_polarized = file.polarization.as_ref().map_or(0, |p| values(&p.strength) + 1 + draws);
    // About so many: starts are solved again where held-out frames choose another strength.
    let all = file.image.starts.len()
        + Shape::ALL.len()
        + values(&file.strength)
        + draws
        + kerrlight_imaging::known_skies(draws)
        + of_polarized;
    let keeper = SignalGuard::brief(STOPPED);
    let bar = progress::counting(all as u64, "solution");
    let done = AtomicU64::new(0);
    let watch = |stage: Stage, solved: usize| {
        // With nothing solved it is asked within a solution whether to go on.
        if solved > 0 {
            bar.set_message(match stage {
                Stage::Starts => "starts",
                Stage::HeldOut => "frames held out",
                Stage::Strengths => "other strengths",
                Stage::Draws => "draws of noise",
            });
            let solved = done.fetch_add(solved as u64, Ordering::Relaxed) + solved as u64;
            bar.set_length(solved.max(all as u64));
            bar.set_position(solved);
            session::reached(&bar);
        }
        !keeper.stopped()
    };
    let stopped = || Interrupted(STOPPED.to_owned());
    let shapes = fit_shapes(file, measured, &|| !keeper.stopped())?.ok_or_else(stopped)?;
    let found = survey(file, measured, &shapes, &watch)?.ok_or_else(stopped)?;
    let of_polarized = match polarized {
        None => None,
        Some(measured) => {
            Some(survey_polarized(file, measured, &found, &watch)?.ok_or_else(stopped)?)
        }
    };
    bar.finish_and_clear();
    Ok((found, shapes, of_polarized))
}

/// Residuals of the data that were fitted.
fn compared<'a>(
    file: &StaticImageFile,
    measured: &FitData,
    survey: &Survey,
) -> anyhow::Result<(Vec<&'a str>, Vec<Statistics>)> {
    let image = &survey.found().solution.image;
    let terms = measured.visibility_terms::<f64>(&file.loss, image.len())?;
    let of = |term: &dyn FrameTerm<f64>| {
        Statistics::of((0..measured.times.len()).map(|frame| term.residuals(frame, image)), 1)
    };
    let names = file.loss.iter().map(|loss| loss.data.label()).collect();
    Ok((names, terms.iter().map(|term| of(&*term.term)).collect()))
}

/// χ² per datum of the gain-free data that were not fitted, from baselines above three times their noise.
fn beside(file: &StaticImageFile, measured: &FitData, survey: &Survey) -> Vec<(&'static str, f64)> {
    let image = &survey.found().solution.image;
    let of = |kind: LossKind| {
        let loss = Loss { least_snr: Some(3.0), ..Loss::new(kind) };
        let terms = measured.visibility_terms::<f64>(&[loss], image.len()).ok()?;
        let term = &terms.first()?.term;
        let frames = || 0..measured.times.len();
        let count: usize = frames().map(|frame| term.degrees_of_freedom(frame)).sum();
        let mut none = vec![0.0; image.len()];
        // χ² alone is wanted: a weight of 0 adds no gradient.
        let of_frame = |frame| term.value_and_gradient(frame, image, 0.0, &mut none);
        let chi2: f64 = frames().map(of_frame).sum();
        Some((kind.label(), chi2 / count as f64))
    };
    let fitted = |kind: &LossKind| file.loss.iter().any(|loss| loss.data == *kind);
    let all = [LossKind::ClosurePhases, LossKind::LogClosureAmplitudes];
    all.into_iter().filter(|kind| !fitted(kind)).filter_map(of).collect()
}

impl Found<'_> {
    /// The image, and those of the draws, as arrays.
    fn images(&self) -> anyhow::Result<()> {
        let n = self.file.image.pixels;
        let field = ("field_uas", vec![self.file.image.field_uas]);
        let image = self.survey.found().solution.image.iter().map(|x| *x as f32).collect();
        // A movie of one frame, as `observe` reads it.
        let lists = [("time", vec![0.0]), ("hours", vec![0.0]), field.clone()];
        let mut all = vec![("recovered", image)];
        for (k, name) in [(1, "recovered_q"), (2, "recovered_u")] {
            let stokes = self.polarized.iter().map(|polarized| &polarized.survey.found.images);
            let pixels = |images: &Vec<f64>| {
                images[k * n * n..(k + 1) * n * n].iter().map(|x| *x as f32).collect::<Vec<f32>>()
            };
            all.extend(stokes.map(|images| (name, pixels(images))));
        }
        let bytes = images::movie_archive([1, n, n], &all, &lists);
        self.folder.file("image.npz")?.write(&bytes)?;
        if let Some(bytes) = self.fits()? {
            self.folder.file("image.fits")?.write(&bytes)?;
        }
        let draws = &self.survey.draws;
        if draws.is_empty() {
            return Ok(());
        }
        let all = draws.iter().flat_map(|draw| &draw.solution.image).map(|x| *x as f32).collect();
        let bytes = images::movie_archive([draws.len(), n, n], &[("draws", all)], &[field]);
        self.folder.file("draws.npz")?.write(&bytes)
    }

    /// The ring, where one is claimed.
    fn ring(&self) -> Option<Ring> {
        let ring = self.survey.found().ring?;
        words::doubt(&self.survey, &self.shapes).is_none().then_some(ring)
    }

    /// The verdict and the ring in a line.
    fn worth(&self) -> String {
        let polarized = self.polarized.as_ref().map(Polarized::sentence);
        let all = self.unfinished().into_iter().chain(self.ring_sentence()).chain(polarized);
        self.judged.worth() + &all.map(|sentence| format!("\n{sentence}")).collect::<String>()
    }
}
