//! Data that are simulated from a truth.

use super::drawn::{FINER, OtherModel, binned, fine_images, is_drawn, is_drawn_elsewhere};
use super::gains;
use super::imported::even_times;
use super::instrument::ring;
use super::leakage;
use super::light_curve;
use super::observed::{Spoiled, schedule_of, spoil};
use super::polarized::{self, is_polarized};
use super::{FitData, Instrument, Result, Truth, hours_per_m, known_geometry, motion, sky};
use crate::fit::geometry::Geometry;
use crate::fit::settings::{FitError, FitFile, PixelShape, Within, refuse};
use kerrlight_common::frames::Frames;
use kerrlight_vlbi::array::Array;
use kerrlight_vlbi::observation::Observation;
use kerrlight_vlbi::operator::{ImageGrid, Method, Pulse};
use kerrlight_vlbi::simulate::{self, Movie, StokesMovie};

impl FitData {
    /// Simulates the data of settings that have a truth, seen by `array` where they have an observation.
    ///
    /// # Errors
    /// If settings are missing or contradict each other, or the truth shines in no pixel.
    pub fn simulated(
        file: &FitFile,
        instrument: &Instrument,
        array: Option<&Array>,
    ) -> Result<Self> {
        let simulated = file.simulated()?;
        if simulated == *file {
            return simulate(file, file, instrument, array, None);
        }
        let mut seen = simulated.clone();
        if is_drawn(file) {
            let rays = ring(&seen)?.map(|rays| (DENSER * rays.count).min(MOST_RAYS));
            seen.screen.ring_rays = rays.or(seen.screen.ring_rays);
        }
        let instrument = Instrument::new(&seen).within("simulation")?;
        simulate(&simulated, file, &instrument, array, None)
    }

    /// The same, where a geometry that is drawn is one of matter on circular geodesics by another forward model than that of the
    /// fit: images as means over many rays, visibilities as sums over as many fine pixels.
    ///
    /// # Errors
    /// As [`simulated`](Self::simulated), and those of the other model.
    pub fn simulated_by(
        other: OtherModel<'_>,
        file: &FitFile,
        instrument: &Instrument,
        array: Option<&Array>,
    ) -> Result<Self> {
        if !is_drawn_elsewhere(file)? {
            return Self::simulated(file, instrument, array);
        }
        let drawn = file.simulated()?;
        let geometry = known_geometry(&drawn);
        simulate(&drawn, file, instrument, array, Some((other, geometry)))
    }
}

fn simulate(
    file: &FitFile,
    fit: &FitFile,
    instrument: &Instrument,
    array: Option<&Array>,
    other: Option<(OtherModel<'_>, Geometry)>,
) -> Result<FitData> {
    if let Some(settings) = file.simulated_curve() {
        return light_curve::simulate(file, fit, instrument, settings);
    }
    let truth = Truth::new(file)?;
    let Some(seen) = file.observation() else {
        let times = times_of_images(file)?;
        let movie = match other {
            None => truth.movie(file, instrument, &times)?,
            Some((model, geometry)) => {
                let images = fine_images(file, &geometry, &truth, &times, model)?;
                binned(&images, file.screen.pixels)
            }
        };
        let movie = Some(lit(&truth, movie)?);
        let sky = sky(file).ok();
        return Ok(FitData { times, movie, sky, truth: Some(truth), ..FitData::default() });
    };
    let sky = sky(file)?;
    let (mut observation, hours) = schedule_of(seen, array)?;
    let per_m = hours_per_m(file)?;
    let times: Vec<f64> = hours.iter().map(|h| seen.first_time + (h - hours[0]) / per_m).collect();
    let (movie, pulse) = match other {
        None => {
            let from = (file, fit, instrument);
            (fill(&mut observation, from, &truth, (&hours, &times), sky)?, pulse(fit))
        }
        Some((model, geometry)) => {
            let images = fine_images(file, &geometry, &truth, &times, model)?;
            let pixels = FINER * file.screen.pixels;
            let pixel_rad = sky.pixel_rad / FINER as f64;
            let grid = ImageGrid { width: pixels, height: pixels, pixel_rad };
            let fine = Frames::of(images.concat(), pixels * pixels);
            simulate::fill_from(&mut observation, grid, &fine, Pulse::Delta, &hours)?;
            let movie = lit(&truth, binned(&images, file.screen.pixels))?;
            (movie, fit.screen.pulse.map_or(Pulse::Delta, PixelShape::pulse))
        }
    };
    let Spoiled { gains: true_gains, leakage: true_leakage } =
        spoil(file, fit, seen, &mut observation)?;
    let gains = gains::priors(fit.instrument.as_ref(), &fit.loss, &observation)?;
    let leakage = leakage::unknown(fit.instrument.as_ref(), &observation)?;
    // Rows have the hour of their scan up to rounding, which is far below 4 µs.
    let frame = |time: f64| hours.partition_point(|hour| *hour < time - 1e-9).min(hours.len() - 1);
    let of_rows = observation.rows.iter().map(|row| frame(row.time_h)).collect();
    let visibilities = Some((observation, of_rows));
    let (movie, sky, truth) = (Some(movie), Some(sky), Some(truth));
    Ok(FitData {
        times,
        movie,
        visibilities,
        sky,
        pulse,
        truth,
        gains,
        true_gains,
        leakage,
        true_leakage,
        ..FitData::default()
    })
}

/// Times of simulated images, M.
fn times_of_images(file: &FitFile) -> Result<Vec<f64>> {
    let missing = || {
        FitError::missing(
            "simulation.movie",
            "images need times; add a table [simulation.movie] with `frames = …`, their number, and `from = …` and \
             `to = …`, the times of the first and the last in M; or [simulation.observation]",
        )
    };
    let movie = file.simulation.as_ref().and_then(|simulation| simulation.movie.as_ref());
    let movie = movie.ok_or_else(missing)?;
    even_times("simulation.movie", movie.frames, [movie.from, movie.to])
}

/// Ratio of the rays near the critical curve of a simulation whose geometry is drawn to those of a fit, up to [`MOST_RAYS`]:
/// data do not know rays.
const DENSER: usize = 16;
/// Largest number of rays of a pixel.
const MOST_RAYS: usize = 1024;

/// Returns the shape of the pixels of a simulation in its visibilities.
fn pulse(fit: &FitFile) -> Pulse {
    fit.screen.pulse.unwrap_or(PixelShape::Triangle).pulse()
}

/// Fills an observation with the visibilities of a truth: its images of total intensity.
fn fill(
    observation: &mut Observation,
    (file, fit, instrument): (&FitFile, &FitFile, &Instrument),
    truth: &Truth,
    (hours, times): (&[f64], &[f64]),
    sky: ImageGrid,
) -> Result<Frames<f64>> {
    let pulse = pulse(fit);
    if !is_polarized(&fit.loss) {
        let images = lit(truth, truth.movie(file, instrument, times)?)?;
        simulate::fill_from(observation, sky, &images, pulse, hours)?;
        return Ok(images);
    }
    let mut model = instrument.forward::<f64>(&motion(file, times.to_vec())?)?;
    let mut all = truth.movie_through(&mut model);
    truth.rings.add_to(&mut all, &polarized::PARAMETERS);
    let [i, q, u] = polarized::split(&all, sky.pixels());
    let lit = lit(truth, Frames::of(i.clone(), sky.pixels()))?;
    let i = Movie { grid: sky, pixels: i };
    let movie = StokesMovie { i, polarized: [Some(q), Some(u), None] };
    simulate::fill_stokes(observation, &movie, pulse, hours, Method::Direct)?;
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
