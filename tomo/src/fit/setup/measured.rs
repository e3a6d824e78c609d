//! The data of a fit: simulated, or measured.

use super::gains;
use super::leakage::{self, LeakageUnknown};
use super::light_curve::{self, Curve};
use super::observed::{Spoiled, add_systematic, schedule_of, spoil};
use super::polarized::{self, is_polarized};
use super::truth::SPOT;
use super::visibilities::{VisibilitySettings, all_products, frames_of, prepared};
use super::{Instrument, Result, Truth, hours_per_m, motion, sky};
use crate::fit::settings::{
    DataFiles, FitError, FitFile, Loss, LossKind, Scattering, StaticImageFile, Within, refuse,
};
use crate::frames::Frames;
use crate::interferometry::Complex64;
use crate::interferometry::array::Array;
use crate::interferometry::gains::{GainPriors, GainTable};
use crate::interferometry::noise::{ScatteringKernel, add_thermal_noise, unscatter};
use crate::interferometry::observation::{Observation, Row};
use crate::interferometry::operator::{ImageGrid, Method, Operator, Pulse, Transform};
use crate::interferometry::polarimetry::LeakageTable;
use crate::interferometry::simulate::{self, Movie};
use rand::{RngExt, SeedableRng};
use rand_distr::StandardNormal;
use rand_pcg::Pcg64;

/// What to write where there are no data.
pub(super) const FILE: &str = "a table [data.visibilities] or [data.movie] with `path = \"FILE\"` (`kerrlight fit --init FILE` writes \
     all of it)";

/// The data of a fit, and what is known to be true.
pub struct Measured {
    /// Times of the frames, M.
    pub times: Vec<f64>,
    /// The movie, where images are the data or are simulated.
    pub movie: Option<Frames<f64>>,
    /// Visibilities, with the frame of each row.
    pub visibilities: Option<(Observation, Vec<usize>)>,
    /// The light curve of an unresolved source.
    pub curve: Option<Curve>,
    /// Where pixels are on the sky, where that matters.
    pub sky: Option<ImageGrid>,
    /// What is simulated.
    pub truth: Option<Truth>,
    /// Priors of the stations' gains, where these are solved for.
    pub gains: Option<GainPriors>,
    /// The gains that were put on simulated data.
    pub true_gains: Option<GainTable>,
    /// Leakage of the stations' feeds, where it is solved for.
    pub leakage: Option<LeakageUnknown>,
    /// The leakage that was put on simulated data.
    pub true_leakage: Option<LeakageTable>,
}

impl Measured {
    /// Simulates the data of settings that have a truth, seen by `array` where they have an observation.
    ///
    /// # Errors
    /// If settings are missing or contradict each other, or the truth shines in no pixel.
    pub fn simulated(
        file: &FitFile,
        instrument: &Instrument,
        array: Option<&Array>,
    ) -> Result<Self> {
        if !file.is_simulated_elsewhere() {
            return simulate(file, file, instrument, array);
        }
        let world = file.simulated()?;
        let instrument = Instrument::new(&world).within("world")?;
        simulate(&world, file, &instrument, array)
    }

    /// Refuses settings that name both a truth and data, or neither.
    ///
    /// # Errors
    /// Says what to write.
    pub fn check_origin(file: &FitFile) -> Result<()> {
        match (&file.data, &file.truth) {
            (Some(_), Some(_)) => {
                refuse!("truth and data exclude each other: give one of them")
            }
            (None, None) => refuse!(
                "there is neither truth (to simulate) nor data (to read): {SPOT}; or {FILE}"
            ),
            (Some(_), None) if file.is_simulated_elsewhere() => {
                refuse!(
                    "world.hole, observer, region, effects and motion need simulated data: add a truth"
                )
            }
            _ if file.instrument.is_some() && !file.has_visibilities() => refuse!(
                "instrument needs visibilities: [data.visibilities], or an [observation] of the truth"
            ),
            _ => Ok(()),
        }
    }

    /// Takes images of this width and height as the data. `name` is what the movie is called in messages.
    ///
    /// # Errors
    /// If it has other frames or pixels than the settings.
    pub fn of_movie(
        file: &FitFile,
        (movie, [width, height]): (Frames<f64>, [usize; 2]),
        name: &str,
    ) -> Result<Self> {
        let (times, n) = (frames(file)?, file.screen.pixels);
        if [width, height] != [n, n] || movie.count() != times.len() {
            refuse!(
                "{name} has {} frames of {width} x {height} pixels, but movie.frames and screen.pixels say {} of {n} x {n}",
                movie.count(),
                times.len()
            );
        }
        let (movie, sky) = (Some(movie), sky(file).ok());
        Ok(Measured { times, movie, sky, ..Measured::empty() })
    }

    /// Takes measured visibilities as the data. `name` is what they are called in messages.
    ///
    /// # Errors
    /// If a visibility has no error, none is left, or mass or distance are missing.
    pub fn of_visibilities(file: &FitFile, observation: Observation, name: &str) -> Result<Self> {
        let Some(DataFiles::Visibilities { average_s, systematic, first_time, uv_min, .. }) =
            file.data
        else {
            refuse!("{name} holds visibilities, and there is no [data.visibilities]")
        };
        let settings = VisibilitySettings { average_s, uv_min };
        let mut observation = match is_polarized(&file.loss) {
            true => all_products(observation, &settings).within(name)?,
            false => prepared(observation, &settings).within(name)?,
        };
        let losses = (&mut observation, &file.loss[..]);
        add_systematic("data.visibilities.systematic", systematic, losses)?;
        let (hours, of_rows) = frames_of(&mut observation);
        let per_m = hours_per_m(file)?;
        let times = hours.iter().map(|h| first_time + (h - hours[0]) / per_m).collect();
        let gains = gains::priors(file.instrument.as_ref(), &file.loss, &observation)?;
        let leakage = leakage::unknown(file.instrument.as_ref(), &observation)?;
        let (visibilities, sky) = (Some((observation, of_rows)), Some(sky(file)?));
        Ok(Measured { times, visibilities, sky, gains, leakage, ..Measured::empty() })
    }

    /// Takes measured visibilities as the data of a static image, whose frames have hours of UTC for times. `name` is
    /// what they are called in messages.
    ///
    /// # Errors
    /// If a visibility has no error, none is left, or the kernel of scattering needs a frequency that is not known.
    pub fn of_static(file: &StaticImageFile, observation: Observation, name: &str) -> Result<Self> {
        if file.instrument.as_ref().is_some_and(|instrument| instrument.leakage.is_some()) {
            refuse!("instrument.leakage is not for a static image of total intensity");
        }
        let data = &file.data.visibilities;
        let settings = VisibilitySettings { average_s: data.average_s, uv_min: data.uv_min };
        let mut observation = prepared(observation, &settings).within(name)?;
        let losses = (&mut observation, &file.loss[..]);
        add_systematic("data.visibilities.systematic", data.systematic, losses)?;
        if data.scattering == Some(Scattering::SgrA) {
            unscatter(&mut observation, &ScatteringKernel::SGR_A).within(name)?;
        }
        if let Some(variability) = &data.variability {
            for row in &mut observation.rows {
                let sigma = variability.sigma(row.uv[0].hypot(row.uv[1]));
                row.noise_sigma[0] = row.noise_sigma[0].hypot(sigma);
            }
        }
        let (times, of_rows) = frames_of(&mut observation);
        if let Some(strength) = file.strength.as_ref().filter(|s| times.len() < 2 * s.folds) {
            let allowed = format!("{} at most, half of the frames", times.len() / 2);
            return Err(FitError::range("strength.folds", strength.folds, &allowed).into());
        }
        let gains = gains::priors(file.instrument.as_ref(), &file.loss, &observation)?;
        let (visibilities, sky) = (Some((observation, of_rows)), Some(file.image.grid()?));
        Ok(Measured { times, visibilities, sky, gains, ..Measured::empty() })
    }

    /// The data with noise once more, `factor` times as large as their errors: what might as well have been measured.
    /// Every frame's pixels get that of the loss that they are in; visibilities that of their rows.
    ///
    /// # Errors
    /// If there is no room for the movie.
    pub fn perturbed(&self, losses: &[Loss], factor: f64, seed: u64) -> Result<Self> {
        let mut copy = self.without_truth();
        if let Some((observation, _)) = &mut copy.visibilities {
            let scale = |row: &mut Row, by: f64| row.noise_sigma.iter_mut().for_each(|s| *s *= by);
            observation.rows.iter_mut().for_each(|row| scale(row, factor));
            add_thermal_noise(observation, seed);
            observation.rows.iter_mut().for_each(|row| scale(row, 1.0 / factor));
        }
        let of_pixels = |loss: &&Loss| matches!(loss.data, LossKind::Image | LossKind::LightCurve);
        let sigma = losses.iter().filter(of_pixels).filter_map(|loss| loss.sigma).next();
        if let (Some(movie), Some(sigma)) = (&mut copy.movie, sigma) {
            let mut random = Pcg64::seed_from_u64(seed);
            let mut noisy = |pixel: &f64| {
                let noise: f64 = random.sample(StandardNormal);
                pixel + factor * sigma * noise
            };
            *movie =
                movie.mapped(movie.pixels(), |image| image.iter().map(&mut noisy).collect())?;
        }
        if let Some(curve) = &mut copy.curve {
            let mut random = Pcg64::seed_from_u64(seed);
            for [flux, sigma] in curve.data.iter_mut().flatten() {
                let noise: f64 = random.sample(StandardNormal);
                *flux += factor * *sigma * noise;
            }
        }
        Ok(copy)
    }

    /// What would have been measured of a static image, with the gains that explain the data best beside it and with other
    /// noise. Data without visibilities stay as they are.
    ///
    /// # Errors
    /// If data make no term.
    pub fn redrawn(&self, losses: &[Loss], image: &[f64], seed: u64) -> Result<Self> {
        let mut copy = self.without_truth();
        let (Some((observation, _)), Some(sky)) = (&mut copy.visibilities, self.sky) else {
            return Ok(copy);
        };
        let uv: Vec<[f64; 2]> = observation.stokes_i().map(|(row, _)| row.uv).collect();
        let transform = Transform::<f64>::new(sky, Pulse::Triangle, &[uv], Method::Direct, 0)?;
        let mut model = vec![Complex64::default(); transform.data()];
        transform.forward(image, &mut model);
        let gains = self.gains(losses, &model)?.unwrap_or_default();
        let gains = gains.by_station();
        let basis = observation.basis;
        let names: Vec<String> = observation.stations.iter().map(|s| s.name.clone()).collect();
        let seen = observation.rows.iter_mut().filter(|row| row.stokes_i(basis).is_some());
        for (row, v) in seen.zip(model) {
            let [first, second] = row
                .stations
                .map(|k| gains.at(&names[usize::from(k)], row.time_h).unwrap_or(1.0.into()));
            // Both parallel hands; in a basis of Stokes parameters the second has no part in I.
            let v = v * first * second.conj();
            (row.products[0], row.products[1]) = (v, v);
        }
        add_thermal_noise(observation, seed);
        Ok(copy)
    }

    /// The data alone.
    pub fn without_truth(&self) -> Self {
        Self {
            times: self.times.clone(),
            movie: self.movie.clone(),
            visibilities: self.visibilities.clone(),
            curve: self.curve.clone(),
            sky: self.sky,
            gains: self.gains.clone(),
            leakage: self.leakage.clone(),
            truth: None,
            true_gains: None,
            true_leakage: None,
        }
    }
}

fn frames(file: &FitFile) -> Result<Vec<f64>> {
    let missing = || {
        FitError::missing(
            "movie",
            "frames of images need times; add a table [movie] with `frames = …`, their number, and `from = …` and \
             `to = …`, the times of the first and the last in M",
        )
    };
    let movie = file.movie.as_ref().ok_or_else(missing)?;
    let n = movie.frames;
    if !(movie.from.is_finite() && movie.to.is_finite() && (n == 1 || movie.to > movie.from)) {
        refuse!(
            "movie: from = {}, to = {} are not allowed: from must be below to",
            movie.from,
            movie.to
        );
    }
    let step = (movie.to - movie.from) / (n.max(2) - 1) as f64;
    Ok((0..n).map(|k| movie.from + step * k as f64).collect())
}

fn simulate(
    file: &FitFile,
    fit: &FitFile,
    instrument: &Instrument,
    array: Option<&Array>,
) -> Result<Measured> {
    if let Some(settings) = &file.light_curve {
        return light_curve::simulate(file, fit, instrument, settings);
    }
    let truth = Truth::new(file)?;
    let Some(seen) = &file.observation else {
        let times = frames(file)?;
        let movie = Some(lit(&truth, truth.movie(file, instrument, &times)?)?);
        let sky = sky(file).ok();
        return Ok(Measured { times, movie, sky, truth: Some(truth), ..Measured::empty() });
    };
    let sky = sky(file)?;
    let (mut observation, hours) = schedule_of(seen, array)?;
    let per_m = hours_per_m(file)?;
    let times: Vec<f64> = hours.iter().map(|h| seen.first_time + (h - hours[0]) / per_m).collect();
    let movie = fill(&mut observation, (file, fit, instrument), &truth, (&hours, &times), sky)?;
    let Spoiled { gains: true_gains, leakage: true_leakage } =
        spoil((file, fit), seen, &mut observation)?;
    let gains = gains::priors(fit.instrument.as_ref(), &fit.loss, &observation)?;
    let leakage = leakage::unknown(fit.instrument.as_ref(), &observation)?;
    let frame = |time: f64| hours.partition_point(|hour| *hour < time - 1e-9).min(hours.len() - 1);
    let of_rows = observation.rows.iter().map(|row| frame(row.time_h)).collect();
    let visibilities = Some((observation, of_rows));
    let (movie, sky, truth) = (Some(movie), Some(sky), Some(truth));
    Ok(Measured {
        times,
        movie,
        visibilities,
        sky,
        truth,
        gains,
        true_gains,
        leakage,
        true_leakage,
        ..Measured::empty()
    })
}

/// Fills an observation with the visibilities of a truth: its images of total intensity.
fn fill(
    observation: &mut Observation,
    (file, fit, instrument): (&FitFile, &FitFile, &Instrument),
    truth: &Truth,
    (hours, times): (&[f64], &[f64]),
    sky: ImageGrid,
) -> Result<Frames<f64>> {
    if !is_polarized(&fit.loss) {
        let images = lit(truth, truth.movie(file, instrument, times)?)?;
        simulate::fill_from(observation, (sky, &images), Pulse::Triangle, hours)?;
        return Ok(images);
    }
    let of = |pixels: Vec<f64>| Movie { grid: sky, pixels };
    let mut model = instrument.forward::<f64>(&motion(file, times.to_vec())?)?;
    let mut all = truth.movie_through(&mut model);
    truth.rings.add_to(&mut all, &polarized::PARAMETERS);
    let [i, q, u] = polarized::split(&all, sky.pixels()).map(of);
    let lit = lit(truth, Frames::of(i.pixels.clone(), sky.pixels()))?;
    let movies = [&i, &q, &u];
    simulate::fill_polarized(observation, movies, Pulse::Triangle, hours, Method::Direct)?;
    Ok(lit)
}

/// A simulated movie, if any of its pixels shines: a dark one would be recovered as nothing, perfectly.
/// A truth of amplitude 0 is meant to be dark.
fn lit(truth: &Truth, movie: Frames<f64>) -> Result<Frames<f64>> {
    let brightest = movie.largest()?;
    if brightest < 1e-30 && !truth.is_dark() {
        refuse!(
            "the truth is dark in every pixel of every frame (the brightest has {brightest:e} Jy): spots must lie in the region \
             (region.r_min, r_max, z_width), be wide enough to meet rays, and shine during the movie (motion.injection_time)"
        );
    }
    Ok(movie)
}
