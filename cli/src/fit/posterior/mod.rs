//! `kerrlight posterior`: how sure a fit is. Each draw is the fit of the data with noise once more (randomise, then
//! optimise: Bardsley et al. 2014), in a geometry of its own where the geometry is not known.

mod page;
mod predictive;
mod sample;
mod summary;

use super::folder::Folder;
use super::held_out;
use super::inputs;
use super::run;
use super::searches;
use crate::answer::Answer;
use crate::checksum::{is_whole, sealed};
use crate::interrupt::{Interrupted, SignalGuard};
use crate::record::Recorder;
use crate::{output, plain, progress, session, volume_files};
use anyhow::{Context, bail, ensure};
use clap::Args;
use indicatif::ProgressBar;
use kerrlight_render::volume::{Volume, VolumeFile};
use kerrlight_tomo::fit::settings::{AxisSearch, FitFile, Kind, UnknownGeometry};
use kerrlight_tomo::fit::setup::{GeometryPosterior, RaySampling, Resolution};
use kerrlight_tomo::fit::{OF_POSTERIOR, mixed_seed, setup};
use kerrlight_tomo::recovery::results::{GeometryResults, PerParameter};
use kerrlight_tomo::recovery::{Problem, ResolvedFit, true_volume};
use kerrlight_tomo::representation::Registry;
use predictive::Check;
use sample::Through;
use serde::{Deserialize, Serialize};
use std::ops::RangeInclusive;
use std::path::{Path, PathBuf};
use std::time::Duration;
pub use summary::{RANKED, WITHIN};

/// Folder of draws and of what follows from them, in the folder of a run.
pub const FOLDER: &str = "posterior";
/// The page.
pub const PAGE: &str = "report.html";
/// Numbers.
pub const NUMBERS: &str = "posterior.json";

/// Arguments of `kerrlight posterior`.
#[derive(Debug, Args)]
pub struct Posterior {
    /// Folder of a finished fit
    #[arg(value_name = "RUN")]
    run: PathBuf,
    /// Draws, those of an earlier call included
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(2..=100_000), required_unless_present = "draws")]
    samples: Option<u32>,
    /// Draw numbers A to B alone, beside other processes that draw others; --samples adds up later
    #[arg(long, value_name = "A..B", conflicts_with = "samples", value_parser = numbers)]
    draws: Option<RangeInclusive<u32>>,
}

impl Posterior {
    /// Draws, and writes what follows from the draws.
    pub fn run(&self, registry: &Registry) -> anyhow::Result<Answer> {
        if let Some(numbers) = &self.draws {
            return self.some(registry, numbers.clone());
        }
        let folder = Folder::open(&self.run, Duration::ZERO)?;
        let prepared = self.prepared(&folder.settings, registry)?;
        draw(&prepared, &folder, self.samples.unwrap_or(2))
    }

    fn prepared(&self, text: &str, registry: &Registry) -> anyhow::Result<Problem> {
        if !self.run.join("results.json").is_file() {
            let run = plain::word(&self.run);
            bail!(
                "{run} is not finished: there is no results.json in it; resume it with `kerrlight fit --resume {run}`"
            );
        }
        let file = super::parse(text).with_context(|| self.run.display().to_string())?;
        let read = || run::problem(file, &super::base_dir_of(text), registry);
        inputs::read_again(&self.run, read)
    }

    /// Draws some, each a file of its own, and adds nothing up. Others may draw around the same run: a draw is the same
    /// bytes whoever writes it.
    fn some(&self, registry: &Registry, numbers: RangeInclusive<u32>) -> anyhow::Result<Answer> {
        let folder = Folder::look(&self.run)?;
        let prepared = self.prepared(&folder.settings, registry)?;
        check(&prepared.settings)?;
        let unknown = prepared.settings.unknown_geometry()?;
        let path = folder.path().join(FOLDER);
        std::fs::create_dir_all(&path)
            .with_context(|| format!("cannot make {}", path.display()))?;
        let drawing = Drawing::new(&prepared, &folder, unknown.as_ref(), *numbers.end(), &path)?;
        let bar = progress::counting(numbers.clone().count() as u64, "draw");
        let keeper = SignalGuard::brief("stopping; the same command continues");
        for number in numbers.clone() {
            if drawing.kept_or_drawn(&path, number.into(), &keeper, &bar)?.is_none() {
                bar.abandon();
                let text = format!("stopped at draw {number}; the same command continues");
                return Err(Interrupted(text).into());
            }
            bar.inc(1);
        }
        bar.finish_and_clear();
        let (first, last) = numbers.into_inner();
        let text = format!("draws {first} to {last} are there");
        Ok(Answer::lines(&text, &path.display().to_string())
            .with("draws", [first, last])
            .with("folder", path.display().to_string()))
    }
}

/// `A..B`, both included.
fn numbers(text: &str) -> Result<RangeInclusive<u32>, String> {
    let ends = text
        .split_once("..")
        .and_then(|(first, last)| Some(first.parse().ok()?..=last.parse().ok()?));
    let is_allowed =
        |all: &RangeInclusive<u32>| *all.start() >= 1 && !all.is_empty() && *all.end() <= 100_000;
    ends.filter(is_allowed).ok_or_else(|| "A..B with 1 <= A <= B <= 100000 is allowed".to_owned())
}

/// One draw as it is kept.
struct Kept {
    /// Emission at the reference time.
    pub volume: Volume,
    /// Numbers that are written beside it.
    pub numbers: DrawNumbers,
}

/// Numbers of a draw.
#[derive(Serialize, Deserialize)]
struct DrawNumbers {
    /// The geometry, where it is not known.
    pub geometry: Option<PerParameter<f64>>,
    /// χ² of each loss over the number of its data.
    pub chi2_per_datum: Vec<f64>,
    /// Noise over the errors of the data.
    pub noise_factor: f64,
    /// Posterior predictive checks.
    #[serde(default)]
    pub predicted: Vec<Check>,
}

/// Refuses fits around which nothing is drawn.
pub fn check(file: &FitFile) -> anyhow::Result<()> {
    if !matches!(file.axis, AxisSearch::Known {}) {
        bail!("a posterior needs [axis.known]: draws do not look for the axis of the motion");
    }
    if file.instrument.as_ref().is_some_and(|instrument| instrument.leakage.is_some()) {
        bail!("a posterior needs leakage that is known: draws do not solve for it");
    }
    if file.band.is_some() {
        bail!(
            "a fit with [band] has the posterior of its geometry in band.json: nothing else is drawn around it"
        );
    }
    Ok(())
}

/// Draws so many times, those that are there included, and writes what follows.
pub fn draw(prepared: &Problem, folder: &Folder, samples: u32) -> anyhow::Result<Answer> {
    check(&prepared.settings)?;
    let recorder = Recorder::of_process();
    let path = folder.path().join(FOLDER);
    std::fs::create_dir_all(&path).with_context(|| format!("cannot make {}", path.display()))?;
    let unknown = prepared.settings.unknown_geometry()?;
    let drawing = Drawing::new(prepared, folder, unknown.as_ref(), samples, &path)?;
    let bar = progress::counting(u64::from(samples), "draw");
    let keeper = SignalGuard::brief(format!("stopping; resume with: {}", again(folder, samples)));
    let mut all = Vec::new();
    for number in 1..=u64::from(samples) {
        let Some(kept) = drawing.kept_or_drawn(&path, number, &keeper, &bar)? else {
            bar.abandon();
            let how = again(folder, samples);
            let text = format!("stopped after {} draws; resume with: {how}", all.len());
            return Err(Interrupted(text).into());
        };
        all.push(kept);
        bar.inc(1);
        session::reached(&bar);
    }
    bar.finish_and_clear();
    let answer = add_up(prepared, folder, &path, &all)?;
    recorder.write_into(&path)?;
    Ok(answer)
}

/// Writes what follows from draws.
fn add_up(
    prepared: &Problem,
    folder: &Folder,
    path: &Path,
    all: &[Kept],
) -> anyhow::Result<Answer> {
    let geometry = folder.found::<GeometryResults>(searches::GEOMETRY)?;
    let truth = prepared.measured.truth.as_ref();
    let truth = truth.map(|truth| true_volume(&prepared.settings, truth, 0.0)).transpose()?;
    // With the prior that held-out frames have chosen, which is that of the draws.
    let file = held_out::settled(&prepared.settings, folder)?;
    let explains = Results::read(folder)?.explains();
    let found = summary::Summary::new(&file, geometry.as_deref(), all, truth, explains)?;
    page::write(&found, prepared, path)?;
    let numbers = found.numbers();
    output::Output::new(&path.join(NUMBERS), "")?.write(sealed(numbers.clone()).as_bytes())?;
    let files = [PAGE, NUMBERS, "mean.npz", "deviation.npz"].map(|name| path.join(name));
    Ok(Answer::lines(&found.sentences().join(" "), &files[0].display().to_string())
        .with_all(numbers)
        .files(files.iter().map(PathBuf::as_path)))
}

fn again(folder: &Folder, samples: u32) -> String {
    let folder = plain::word(folder.path());
    format!("kerrlight posterior {folder} --samples {samples}")
}

/// Geometries about the one that the run has found.
fn geometries<'a>(
    prepared: &'a Problem,
    unknown: &'a UnknownGeometry,
    folder: &Folder,
    geometry: &GeometryResults,
) -> anyhow::Result<GeometryPosterior<'a>> {
    let free = &unknown.free;
    let best = geometry.geometry_in(&prepared.settings, free);
    let best = best.with_context(|| folder.damaged(searches::GEOMETRY))?;
    let spread = geometry.spread(best, free);
    let spread = spread.context("the search for the geometry has no errors")?;
    let (results, is_changing) = (Results::read(folder)?, prepared.settings.change.is_some());
    // Residuals of the best geometry, but no less than the errors that the search assumed.
    let left = (geometry.chi2_per_datum / results.expected()).sqrt().max(geometry.noise_factor);
    let factor = if is_changing { results.noise() } else { left };
    let Problem { settings, measured, .. } = prepared;
    Ok(GeometryPosterior::new(settings, measured, unknown, best, &spread, factor)?)
}

/// What draws need of the verdict.
#[derive(Deserialize)]
struct Judged {
    outcome: String,
    data: Vec<JudgedData>,
}

#[derive(Deserialize)]
struct JudgedData {
    chi2_per_datum: Option<f64>,
    expected: Option<ExpectedMean>,
}

#[derive(Deserialize)]
struct ExpectedMean {
    mean: f64,
}

/// What draws need of all results of a fit.
#[derive(Deserialize)]
struct Results {
    verdict: Judged,
    /// Steps that the fit took.
    steps: u64,
}

impl Results {
    fn read(folder: &Folder) -> anyhow::Result<Self> {
        let text = output::read_text(&folder.path().join("results.json"))?;
        let name = plain::path(folder.path());
        ensure!(
            is_whole(&text),
            "{name}/results.json is damaged: remove it and resume the fit with kerrlight fit --resume"
        );
        serde_json::from_str(&text).context("results.json is damaged")
    }

    /// Returns whether the fit explains its data.
    fn explains(&self) -> bool {
        self.verdict.outcome != "unexplained"
    }

    /// Largest mean of χ² per datum among the data of a right model.
    fn expected(&self) -> f64 {
        let means = self.verdict.data.iter().filter_map(|of| of.expected.as_ref());
        means.map(|expected| expected.mean).fold(1.0, f64::max)
    }

    /// Noise of a draw over the errors of the data: these are too small where χ² is above that of a right model.
    fn noise(&self) -> f64 {
        let excess = |of: &JudgedData| {
            let expected = of.expected.as_ref().map_or(1.0, |expected| expected.mean);
            of.chi2_per_datum.map(|chi2| chi2 / expected)
        };
        self.verdict.data.iter().filter_map(excess).fold(1.0f64, f64::max).sqrt()
    }
}

/// Parts of which draws are made.
struct Drawing<'a> {
    prepared: &'a Problem,
    /// Settings, with what the run has chosen.
    file: FitFile,
    unknown: Option<&'a UnknownGeometry>,
    geometries: Option<GeometryPosterior<'a>>,
    rays: RaySampling,
    /// Noise of a draw over the errors of the data.
    factor: f64,
    /// Steps that the fit took.
    steps: u64,
}

impl<'a> Drawing<'a> {
    /// Draws around the run in `folder`, of which there are to be so many in `path`.
    fn new(
        prepared: &'a Problem,
        folder: &Folder,
        unknown: Option<&'a UnknownGeometry>,
        samples: u32,
        path: &Path,
    ) -> anyhow::Result<Self> {
        let geometry = folder.found::<GeometryResults>(searches::GEOMETRY)?;
        let complete = (1..=u64::from(samples)).all(|number| names(path, number)[1].is_file());
        let geometries = match (unknown, &geometry) {
            (Some(unknown), Some(geometry)) if !complete => {
                Some(geometries(prepared, unknown, folder, geometry)?)
            }
            _ => None,
        };
        let results = Results::read(folder)?;
        let factor = match &geometries {
            Some(geometries) => geometries.factor(),
            None => results.noise(),
        };
        let file = held_out::settled(&prepared.settings, folder)?;
        let found = geometry.as_ref().map(|geometry| Resolution::from(geometry.resolution));
        let file = match found {
            Some(found) => found.refined(file),
            None => file,
        };
        let rays = found.map(|found| found.rays).unwrap_or_default();
        let steps = results.steps;
        Ok(Self { prepared, file, unknown, geometries, rays, factor, steps })
    }

    /// A draw of an earlier call, or a new one; none if it was stopped.
    fn kept_or_drawn(
        &self,
        path: &Path,
        number: u64,
        keeper: &SignalGuard,
        bar: &ProgressBar,
    ) -> anyhow::Result<Option<Kept>> {
        if let Some(kept) = kept(path, number)? {
            return Ok(Some(kept));
        }
        let told = |text: &str| bar.set_message(text.to_owned());
        let Some(drawn) = self.one(number, keeper, &told)? else { return Ok(None) };
        keep(path, number, drawn).map(Some)
    }

    fn one(
        &self,
        number: u64,
        keeper: &SignalGuard,
        told: &dyn Fn(&str),
    ) -> anyhow::Result<Option<Kept>> {
        let Problem { instrument, measured, motion, registry, .. } = self.prepared;
        let (steps, noise_factor) = (self.steps, self.factor);
        let mut file = self.file.clone();
        // All draws have the flow of the fit: its seed is not theirs.
        file.motion.velocity = file.motion.velocity.clone().seeded(file.seed);
        file.seed = mixed_seed(file.seed, number, OF_POSTERIOR);
        let has_prior = file.linear.as_ref().is_some_and(|linear| linear.prior.is_some());
        if file.representation.kind == Kind::LinearGrid && !has_prior {
            // A prior varies what the data do not resolve; without one, other voxels vary what
            // depends on their places.
            let nodes = &mut file.representation.linear_grid.nodes;
            *nodes = other_voxels(*nodes, number);
        }
        let noise = seed(&file, number);
        let (Some(unknown), Some(geometries)) = (self.unknown, &self.geometries) else {
            let data = measured.perturbed(&file.loss, noise_factor, noise)?;
            let file = &file;
            let through =
                Through { file, instrument, motion, registry, measured, steps, noise_factor };
            return sample::draw(&through, &data, keeper, told);
        };
        told("the geometry");
        let data = geometries.data(noise)?;
        let geometry = geometries.draw(number);
        // Other rays of the photon ring in each draw, where those of the data are not known.
        let lattice = if setup::has_own_rays(&file) { 0 } else { number };
        let rays = RaySampling { lattice, ..self.rays };
        let ResolvedFit { file, instrument, motion, .. } =
            ResolvedFit::in_geometry(self.prepared, &file, &geometry, rays)?;
        let (file, instrument, motion) = (&file, &instrument, &motion);
        let through = Through { file, instrument, motion, registry, measured, steps, noise_factor };
        let mut drawn = sample::draw(&through, &data, keeper, told)?;
        if let Some(drawn) = &mut drawn {
            drawn.numbers.geometry = Some(geometry.values(&unknown.free));
        }
        Ok(drawn)
    }
}

/// Voxels of a draw along each axis, a few per cent more or fewer: what depends on where they lie is not known.
fn other_voxels(nodes: usize, number: u64) -> usize {
    const PERCENT: [usize; 7] = [97, 103, 94, 109, 100, 91, 106];
    (nodes * PERCENT[number as usize % PERCENT.len()]).div_ceil(100).max(4)
}

/// Returns the seed of the noise of a draw: not that of the simulation.
fn seed(file: &FitFile, number: u64) -> u64 {
    file.seed.wrapping_mul(0x9e37_79b9_7f4a_7c15).wrapping_add(number)
}

fn names(folder: &Path, number: u64) -> [PathBuf; 2] {
    ["npz", "json"].map(|kind| folder.join(format!("sample_{number:04}.{kind}")))
}

/// A draw of an earlier call, if it is whole.
fn kept(folder: &Path, number: u64) -> anyhow::Result<Option<Kept>> {
    let [volume, numbers] = names(folder, number);
    if !numbers.is_file() {
        return Ok(None);
    }
    let text = output::read_text(&numbers)?;
    if !is_whole(&text) {
        bail!("{} is damaged: remove it to draw again", numbers.display());
    }
    let numbers = serde_json::from_str(&text).with_context(|| numbers.display().to_string())?;
    Ok(Some(Kept { volume: volume_files::load(&volume)?.volume, numbers }))
}

fn keep(folder: &Path, number: u64, drawn: Kept) -> anyhow::Result<Kept> {
    let [volume, numbers] = names(folder, number);
    let file = VolumeFile { volume: drawn.volume, axis: None };
    output::Output::new(&volume, "")?.write(&file.to_npz())?;
    // Last: with it the draw is whole.
    let text = sealed(serde_json::to_value(drawn.numbers)?);
    output::Output::new(&numbers, "")?.write(text.as_bytes())?;
    // As a later call reads them, to the last digit.
    Ok(Kept { volume: file.volume, numbers: serde_json::from_str(&text)? })
}
