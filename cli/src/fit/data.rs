//! The data of a fit: simulated, or from files.

use super::config::{DataFiles, FitFile, Gains, Loss, LossKind, Noise};
use super::setup::{self, Instrument};
use super::truth::Truth;
use super::visibility_file;
use crate::interferometry::arguments;
use crate::interferometry::movie_files;
use anyhow::{Context, anyhow, bail};
use kerrlight_tomo::fit::{
    Chain, Data, FrameTerm, ImageTerm, LightCurveTerm, Motion, Scan, ScanTerm, Weighted,
};
use kerrlight_tomo::interferometry::data_terms::{
    AmplitudeTerm, ClosureTerm, DataTerm, DataTermError, VisibilityTerm,
};
use kerrlight_tomo::interferometry::earth::{Frame, Ut1};
use kerrlight_tomo::interferometry::noise::{GainErrors, add_thermal_noise, apply_gains};
use kerrlight_tomo::interferometry::observation::Observation;
use kerrlight_tomo::interferometry::operator::{ImageGrid, Method, Pulse, Transform};
use kerrlight_tomo::interferometry::products::ClosureKind;
use kerrlight_tomo::interferometry::schedule::{Clock, Schedule, Setup};
use kerrlight_tomo::interferometry::simulate::{self, Movie};
use kerrlight_tomo::memory;
use std::path::Path;

/// What is measured, and what is known to be true.
pub struct Measured {
    /// Times of the frames, M.
    pub times: Vec<f64>,
    /// The movie, where images are the data or are simulated.
    pub movie: Option<Vec<f64>>,
    /// Visibilities, with the frame of each row.
    pub visibilities: Option<(Observation, Vec<usize>)>,
    /// Where pixels are on the sky, where that matters.
    pub sky: Option<ImageGrid>,
    /// What is simulated.
    pub truth: Option<Truth>,
}

/// Simulates or reads the data. `folder` is that of the fit's file.
pub fn measure(file: &FitFile, instrument: &Instrument, folder: &Path) -> anyhow::Result<Measured> {
    match (&file.data, &file.truth) {
        (Some(_), Some(_)) => bail!("truth and data exclude each other: simulate, or read"),
        (None, None) => {
            bail!("there is neither truth (to simulate) nor data (to read): {SPOT}; or {FILE}")
        }
        (Some(_), None) if !file.world.is_empty() => {
            bail!("world is for simulated data: there is no truth")
        }
        (Some(data), None) => read(file, data, folder),
        (None, Some(_)) if file.world.is_empty() => simulate(file, instrument, folder),
        (None, Some(_)) => {
            let world = file.simulated()?;
            let instrument = Instrument::new(&world).context("world")?;
            simulate(&world, &instrument, folder)
        }
    }
}

fn frames(file: &FitFile) -> anyhow::Result<Vec<f64>> {
    let missing = || {
        anyhow!(
            "movie is missing: frames of images need times; add a table [movie] with `frames = …`, their number, and \
             `from = …` and `to = …`, the times of the first and the last in M"
        )
    };
    let movie = file.movie.as_ref().ok_or_else(missing)?;
    let n = movie.frames;
    if !(1..=100_000).contains(&n) {
        bail!("movie.frames = {n} is not allowed: 1 to 100000");
    }
    if !(movie.from.is_finite() && movie.to.is_finite() && (n == 1 || movie.to > movie.from)) {
        bail!("movie: from = {}, to = {} are not allowed: growing", movie.from, movie.to);
    }
    let step = (movie.to - movie.from) / (n.max(2) - 1) as f64;
    Ok((0..n).map(|k| movie.from + step * k as f64).collect())
}

/// Refuses movies that there is no memory for: as they are simulated, as data, and as they are recovered.
fn afford_movie(frames: usize, pixels: usize) -> anyhow::Result<()> {
    let what = || format!("movies of {frames} frames of {pixels} x {pixels} pixels");
    let one = memory::movie(frames as f64, (pixels * pixels) as f64);
    Ok(memory::afford(what, 2.0 * one)?)
}

fn simulate(file: &FitFile, instrument: &Instrument, folder: &Path) -> anyhow::Result<Measured> {
    let truth = Truth::new(file)?;
    let Some(seen) = &file.observation else {
        let times = frames(file)?;
        afford_movie(times.len(), file.screen.pixels)?;
        let movie = Some(lit(&truth, truth.movie(file, instrument, &times)?)?);
        return Ok(Measured {
            times,
            movie,
            visibilities: None,
            sky: setup::sky(file).ok(),
            truth: Some(truth),
        });
    };
    let sky = setup::sky(file)?;
    let source =
        arguments::source(&seen.source).map_err(|error| anyhow!("observation.source: {error}"))?;
    let (clock, hours) = match (seen.utc, seen.gmst) {
        (Some(hours), None) => (Clock::Utc, hours),
        (None, Some(hours)) => (Clock::Gmst, hours),
        (Some(_), Some(_)) => bail!(
            "observation.gmst is not allowed: observation.utc is given too, and one is enough"
        ),
        (None, None) => bail!(
            "observation.utc is missing: give `utc = [FROM, TO]`, hours of UTC of the first scan and of one after the last, \
             or `gmst = [FROM, TO]`, the same in sidereal time, in [observation]"
        ),
    };
    let schedule =
        Schedule { mjd: seen.mjd, clock, start_h: hours[0], stop_h: hours[1], scans: seen.scans };
    let setup = Setup {
        frequency_hz: seen.frequency_ghz * 1e9,
        bandwidth_hz: seen.bandwidth_ghz * 1e9,
        integration_s: seen.integration_s,
        elevation_deg: seen.elevation_deg,
        ut1: Ut1::Table,
        frame: Frame::Catalogue,
    };
    let array = arguments::array_near(&seen.array, folder).context("observation.array")?;
    let mut observation =
        arguments::observe(&array, source.position, &schedule, &setup).context("observation")?;
    observation.source = source.name;
    let hours = schedule.hours_utc(setup.ut1).context("observation")?;
    afford_movie(hours.len(), file.screen.pixels)?;
    let per_m = setup::hours_per_m(file)?;
    let times: Vec<f64> = hours.iter().map(|h| seen.first_time + (h - hours[0]) / per_m).collect();
    let movie = lit(&truth, truth.movie(file, instrument, &times)?)?;
    let images = Movie { grid: sky, pixels: movie.clone() };
    simulate::fill(&mut observation, &images, Pulse::Triangle, &hours, Method::Direct)?;
    if let Some(gains) = seen.gains {
        apply_gains(&mut observation, gain_errors(gains)?, file.seed);
    }
    if seen.noise == Noise::Thermal {
        add_thermal_noise(&mut observation, file.seed);
    }
    if let Some(systematic) = seen.systematic {
        add_systematic("observation.systematic", systematic, &mut observation)?;
    }
    let frame = |time: f64| hours.partition_point(|hour| *hour < time - 1e-9).min(hours.len() - 1);
    let of_rows = observation.rows.iter().map(|row| frame(row.time_h)).collect();
    Ok(Measured {
        times,
        movie: Some(movie),
        visibilities: Some((observation, of_rows)),
        sky: Some(sky),
        truth: Some(truth),
    })
}

/// A simulated movie, if any of its pixels shines: a dark one would be recovered as nothing, perfectly.
/// A truth of amplitude 0 is meant to be dark.
fn lit(truth: &Truth, movie: Vec<f64>) -> anyhow::Result<Vec<f64>> {
    let brightest = movie.iter().fold(0.0f64, |most, x| most.max(*x));
    if brightest < 1e-30 && !truth.is_dark() {
        bail!(
            "the truth shines in no pixel of any frame (the brightest has {brightest:e} Jy): spots must lie in the region \
             (region.r_min, r_max, z_width), be wide enough to meet rays, and shine during the movie (motion.injection_time)"
        );
    }
    Ok(movie)
}

/// Adds a part of each amplitude to its error in quadrature.
fn add_systematic(name: &str, part: f64, observation: &mut Observation) -> anyhow::Result<()> {
    if !(part >= 0.0 && part.is_finite()) {
        bail!("{name} = {part} is not allowed: 0 or above");
    }
    for row in &mut observation.rows {
        row.noise_sigma[0] = row.noise_sigma[0].hypot(part * row.products[0].norm());
    }
    Ok(())
}

fn gain_errors(gains: Gains) -> anyhow::Result<GainErrors> {
    let Gains { constant_amplitude, scan_amplitude, random_phases } = gains;
    for (name, value) in
        [("constant_amplitude", constant_amplitude), ("scan_amplitude", scan_amplitude)]
    {
        if !(0.0..=10.0).contains(&value) {
            bail!("observation.gains.{name} = {value} is not allowed: 0 to 10");
        }
    }
    Ok(GainErrors { constant_amplitude, scan_amplitude, random_phases })
}

fn read(file: &FitFile, data: &DataFiles, folder: &Path) -> anyhow::Result<Measured> {
    match data {
        DataFiles::Movie { path } => {
            let times = frames(file)?;
            let path = folder.join(path);
            let field = file.screen.field_uas.unwrap_or(1.0);
            let (movie, _) =
                movie_files::read(std::slice::from_ref(&path), Some(field)).or_else(|first| {
                    // FITS files and pictures of kerrlight know their field; of all others the first error is the one.
                    let knows =
                        path.extension().is_some_and(|e| e != "csv" && e != "npz" && e != "npy");
                    movie_files::read(std::slice::from_ref(&path), None)
                        .map_err(|second| if knows { second } else { first })
                })?;
            let n = file.screen.pixels;
            if (movie.grid.width, movie.grid.height) != (n, n) || movie.frames() != times.len() {
                bail!(
                    "{} has {} frames of {} x {} pixels: movie.frames and screen.pixels say {} of {n} x {n}",
                    path.display(),
                    movie.frames(),
                    movie.grid.width,
                    movie.grid.height,
                    times.len()
                );
            }
            let movie = Some(movie.pixels);
            Ok(Measured {
                times,
                movie,
                visibilities: None,
                sky: setup::sky(file).ok(),
                truth: None,
            })
        }
        DataFiles::Visibilities { path, average_s, systematic, first_time, uv_min } => {
            let settings = visibility_file::Settings { average_s: *average_s, uv_min: *uv_min };
            let mut observation = visibility_file::read(&folder.join(path), &settings)?;
            add_systematic("data.visibilities.systematic", *systematic, &mut observation)?;
            let (hours, of_rows) = visibility_file::frames(&mut observation);
            let per_m = setup::hours_per_m(file)?;
            let times = hours.iter().map(|h| first_time + (h - hours[0]) / per_m).collect();
            let sky = Some(setup::sky(file)?);
            Ok(Measured {
                times,
                movie: None,
                visibilities: Some((observation, of_rows)),
                sky,
                truth: None,
            })
        }
    }
}

impl Measured {
    /// The data alone.
    pub fn without_truth(&self) -> Self {
        Self {
            times: self.times.clone(),
            movie: self.movie.clone(),
            visibilities: self.visibilities.clone(),
            sky: self.sky,
            truth: None,
        }
    }

    /// The terms of the loss.
    pub fn terms(&self, losses: &[Loss], pixels: usize) -> anyhow::Result<Data<f32>> {
        let mut data = Data { image: None, others: Vec::new() };
        if losses.is_empty() {
            bail!(
                "loss is empty: there is nothing to fit; add a table [[loss]] with `data = …` ({}) and `weight = 1.0`",
                super::words::all::<LossKind>()
            );
        }
        for (k, loss) in losses.iter().enumerate() {
            let name = || format!("loss {k}");
            if !(loss.weight > 0.0 && loss.weight.is_finite()) {
                bail!("loss {k}: weight = {} is not allowed: above 0", loss.weight);
            }
            let weight = loss.weight;
            match loss.data {
                LossKind::Image if data.image.is_some() => bail!("loss {k}: image again"),
                LossKind::Image => {
                    let term = Box::new(self.image(loss, pixels).with_context(name)?);
                    data.image = Some(Weighted { weight, term });
                }
                _ => {
                    let term = self.other(loss, pixels).with_context(name)?;
                    data.others.push(Weighted { weight, term });
                }
            }
        }
        Ok(data)
    }

    fn movie(&self) -> anyhow::Result<&[f64]> {
        self.movie.as_deref().ok_or_else(|| anyhow!("there are no images, only visibilities"))
    }

    /// Flux of every frame, Jy.
    fn fluxes(&self) -> anyhow::Result<Vec<f64>> {
        let movie = self.movie()?;
        Ok(movie.chunks(movie.len() / self.times.len()).map(|f| f.iter().sum()).collect())
    }

    fn image(&self, loss: &Loss, pixels: usize) -> anyhow::Result<ImageTerm<f32>> {
        let sigma = loss.sigma.ok_or_else(|| anyhow!("sigma is missing: give `sigma = …`, the standard deviation of a pixel in Jy, beside `data = \"image\"`"))?;
        let movie = self.movie()?.iter().map(|x| *x as f32).collect();
        Ok(ImageTerm::new(movie, pixels, sigma)?)
    }

    fn other(&self, loss: &Loss, pixels: usize) -> anyhow::Result<Box<dyn FrameTerm<f32>>> {
        if loss.data == LossKind::LightCurve {
            let sigma = loss.sigma.ok_or_else(|| anyhow!(
                    "sigma is missing: give `sigma = …`, the standard deviation of the total flux in Jy, beside \
                     `data = \"light-curve\"`"
                ))?;
            let flux: Vec<f64> = self.fluxes()?;
            let sigmas = vec![sigma; flux.len()];
            return Ok(Box::new(LightCurveTerm::new(flux, &sigmas, pixels)?));
        }
        let (name, quadratic) = match loss.data {
            LossKind::Visibilities => ("visibilities", true),
            LossKind::Amplitudes => ("amplitudes", false),
            LossKind::ClosurePhases => ("closure phases", false),
            _ => ("log closure amplitudes", false),
        };
        let scans: Vec<Option<Scan<f32>>> = (0..self.times.len())
            .map(|frame| self.scan(frame, loss))
            .collect::<anyhow::Result<_>>()?;
        if scans.iter().all(Option::is_none) {
            bail!("no frame has any {name}");
        }
        Ok(Box::new(ScanTerm::new(name, pixels, quadratic, scans)))
    }

    fn scan(&self, frame: usize, loss: &Loss) -> anyhow::Result<Option<Scan<f32>>> {
        let missing = || {
            anyhow!(
                "there are no visibilities: give {FILE}, or a truth and an [observation] of it (`kerrlight fit --init` \
                     writes an example)"
            )
        };
        let (observation, frames) = self.visibilities.as_ref().ok_or_else(missing)?;
        let sky = self.sky.ok_or_else(missing)?;
        let rows = observation.rows.iter().zip(frames).filter(|(_, of)| **of == frame);
        let rows: Vec<_> = rows.map(|(row, _)| *row).collect();
        let part = Observation { rows, ..observation.clone() };
        if part.stokes_i().next().is_none() {
            return Ok(None);
        }
        let uv: Vec<[f64; 2]> = part.stokes_i().map(|(row, _)| row.uv).collect();
        let least = loss.least_snr.unwrap_or(0.0);
        let term: Box<dyn DataTerm<f32> + Send> = match loss.data {
            LossKind::Visibilities => Box::new(VisibilityTerm::new(&part)?),
            LossKind::Amplitudes => Box::new(AmplitudeTerm::new(&part)?),
            kind => {
                let kind = match kind {
                    LossKind::ClosurePhases => ClosureKind::Phase,
                    _ => ClosureKind::LogAmplitude,
                };
                match ClosureTerm::new(&part, kind, least) {
                    Err(DataTermError::Empty) => return Ok(None),
                    term => Box::new(term?),
                }
            }
        };
        let transform = Transform::new(sky, Pulse::Triangle, &[uv], Method::Direct, MEMORY)?;
        Ok(Some(Scan { transform, term }))
    }
}

/// What to write where there is no truth.
pub const SPOT: &str = "add a table [[truth.spot]] with `center = [x, y, z]` and `sigma = …` in M and `amplitude = 1.0`";

/// What to write where there are no data.
const FILE: &str = "a table [data.visibilities] or [data.movie] with `path = \"FILE\"` (`kerrlight fit --init FILE` writes \
     all of it)";

/// Exponentials of a frame up to this many bytes are kept.
const MEMORY: usize = 8 << 20;

/// The chain of a fit, in single precision.
pub fn chain(instrument: &Instrument, motion: &Motion) -> anyhow::Result<Chain<f32>> {
    let Instrument { lines, hole, redshift, .. } = instrument;
    Ok(Chain::new(lines, motion, hole, *redshift)?)
}
