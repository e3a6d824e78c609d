//! Data that are simulated from a truth.

use super::gains;
use super::imported::frames;
use super::leakage;
use super::light_curve;
use super::observed::{Spoiled, schedule_of, spoil};
use super::polarized::{self, is_polarized};
use super::world::seen_in_truth;
use super::{Instrument, Measured, Result, Truth, hours_per_m, motion, sky};
use crate::fit::settings::{FitFile, PixelShape, Within, refuse};
use kerrlight_common::frames::Frames;
use kerrlight_vlbi::array::Array;
use kerrlight_vlbi::observation::Observation;
use kerrlight_vlbi::operator::{ImageGrid, Method, Pulse};
use kerrlight_vlbi::simulate::{self, Movie, StokesMovie};

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
        let instrument = seen_in_truth(file, &world, instrument)?;
        simulate(&world, file, &instrument, array)
    }
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
        pulse: pulse(fit),
        truth,
        gains,
        true_gains,
        leakage,
        true_leakage,
        ..Measured::empty()
    })
}

/// What the pixels of a simulation are to its visibilities.
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
        simulate::fill_from(observation, (sky, &images), pulse, hours)?;
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
