//! Data that were measured: what is taken from images and visibilities.

use super::gains;
use super::leakage;
use super::medium;
use super::observed::add_systematic;
use super::polarized::is_polarized;
use super::truth::SPOT;
use super::visibilities::{VisibilitySettings, all_products, frames_of, prepared};
use super::{Measured, Result, hours_per_m, sky};
use crate::fit::settings::{
    DataFiles, FitError, FitFile, GainPhases, InstrumentSettings, LossKind, PixelShape,
    StaticImageFile, StrengthSettings, Within, refuse,
};
use kerrlight_common::frames::Frames;
use kerrlight_vlbi::observation::Observation;

/// What to write where there are no data.
pub(super) const FILE: &str = "a table [data.visibilities] or [data.movie] with `path = \"FILE\"` (`kerrlight fit --init FILE` writes \
     all of it)";

impl Measured {
    /// Refuses settings that name both a truth and data, or neither.
    ///
    /// # Errors
    /// Says what to write.
    pub fn check_origin(file: &FitFile) -> Result<()> {
        match (&file.data, &file.simulation) {
            (Some(_), Some(_)) => {
                refuse!("simulation and data exclude each other: give one of them")
            }
            (None, None) => {
                refuse!("there is neither a simulation nor data (to read): {SPOT}; or {FILE}")
            }
            _ if file.instrument.is_some() && !file.has_visibilities() => refuse!(
                "instrument needs visibilities: [data.visibilities] or [simulation.observation]"
            ),
            _ => Ok(()),
        }
    }

    /// Takes images of this width and height as the data. `name` is what the movie is called in messages.
    ///
    /// # Errors
    /// If it has other pixels than the settings, or its times are not those of images.
    pub fn of_movie(
        file: &FitFile,
        (movie, [width, height]): (Frames<f64>, [usize; 2]),
        name: &str,
    ) -> Result<Self> {
        let (times, n) = (times_of_images(file, movie.count())?, file.screen.pixels);
        if [width, height] != [n, n] {
            refuse!("{name} has {width} x {height} pixels, but screen.pixels says {n} x {n}");
        }
        let (movie, sky) = (Some(movie), sky(file).ok());
        Ok(Measured { times, movie, sky, ..Measured::empty() })
    }

    /// Takes measured visibilities as the data. `name` is what they are called in messages.
    ///
    /// # Errors
    /// If a visibility has no error, none is left, or mass, distance or the frequency of scattered light are missing.
    pub fn of_visibilities(file: &FitFile, observation: Observation, name: &str) -> Result<Self> {
        let Some(DataFiles::Visibilities {
            average_s,
            systematic,
            first_time,
            uv_min,
            scattering,
            variability,
            ..
        }) = file.data
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
        medium::correct(&mut observation, &file.loss, (scattering, variability), name)?;
        let (hours, of_rows) = frames_of(&mut observation);
        let per_m = hours_per_m(file)?;
        let times = hours.iter().map(|h| first_time + (h - hours[0]) / per_m).collect();
        let gains = gains::priors(file.instrument.as_ref(), &file.loss, &observation)?;
        let leakage = leakage::unknown(file.instrument.as_ref(), &observation)?;
        let (visibilities, sky) = (Some((observation, of_rows)), Some(sky(file)?));
        let varies = variability.is_some();
        let pulse = file.screen.pulse.unwrap_or(PixelShape::Delta).pulse();
        Ok(Measured {
            times,
            visibilities,
            varies,
            sky,
            pulse,
            gains,
            leakage,
            ..Measured::empty()
        })
    }

    /// Takes measured visibilities as the data of a static image, whose frames have hours of UTC for times. `name` is
    /// what they are called in messages.
    ///
    /// # Errors
    /// If a visibility has no error, none is left, or the kernel of scattering needs a frequency that is not known.
    pub fn of_static(file: &StaticImageFile, observation: Observation, name: &str) -> Result<Self> {
        let data = &file.data.visibilities;
        let settings = VisibilitySettings { average_s: data.average_s, uv_min: data.uv_min };
        let observation = cropped(observation, data.utc_h)?;
        let mut observation = prepared(observation, &settings).within(name)?;
        let losses = (&mut observation, &file.loss[..]);
        add_systematic("data.visibilities.systematic", data.systematic, losses)?;
        let sky = (data.scattering, data.variability);
        medium::correct(&mut observation, &file.loss, sky, name)?;
        let (times, of_rows) = frames_of(&mut observation);
        let gains = gains::priors(file.instrument.as_ref(), &file.loss, &observation)?;
        let (visibilities, sky) = (Some((observation, of_rows)), Some(file.image.grid()?));
        let varies = data.variability.is_some();
        Ok(Measured { times, visibilities, varies, sky, gains, ..Measured::empty() })
    }

    /// The data of the polarisation of a static image, with all products of the feeds; none if no polarisation is asked for.
    ///
    /// # Errors
    /// As [`of_static`](Self::of_static), or if Q and U were not measured.
    pub fn of_static_polarized(
        file: &StaticImageFile,
        observation: Observation,
        name: &str,
    ) -> Result<Option<Self>> {
        let Some(polarization) = &file.polarization else { return Ok(None) };
        let (data, losses) = (&file.data.visibilities, [polarization.loss()]);
        let settings = VisibilitySettings { average_s: data.average_s, uv_min: data.uv_min };
        let observation = cropped(observation, data.utc_h)?;
        let mut observation = all_products(observation, &settings).within(name)?;
        // The frames are those of total intensity.
        let basis = observation.basis;
        observation.rows.retain(|row| row.stokes_i(basis).is_some());
        if !observation.is_polarized() {
            refuse!("{name}: there is no RL or LR (nor Q and U): remove the table [polarization]");
        }
        let seen = (&mut observation, &losses[..]);
        add_systematic("data.visibilities.systematic", data.systematic, seen)?;
        medium::correct(&mut observation, &losses, (data.scattering, None), name)?;
        medium::polarized_errors(&mut observation, data.variability, polarization);
        let (times, of_rows) = frames_of(&mut observation);
        let instrument = file.instrument.clone().map(|instrument| with_phases(instrument, file));
        let gains = match polarization.data {
            // They cancel.
            LossKind::PolarimetricRatios => None,
            _ => gains::priors(instrument.as_ref(), &losses, &observation)?,
        };
        let leakage = leakage::unknown(instrument.as_ref(), &observation)?;
        let (visibilities, sky) = (Some((observation, of_rows)), Some(file.image.grid()?));
        let varies = data.variability.is_some() || polarization.variability.is_some();
        let empty = Measured::empty();
        Ok(Some(Measured { times, visibilities, varies, sky, gains, leakage, ..empty }))
    }
}

/// Rows between two hours of UTC.
fn cropped(mut observation: Observation, utc_h: Option<[f64; 2]>) -> Result<Observation> {
    let Some([from, to]) = utc_h else { return Ok(observation) };
    observation.rows.retain(|row| (from..=to).contains(&row.time_h));
    if observation.rows.is_empty() {
        refuse!("data.visibilities.utc_h = [{from}, {to}] leaves no visibilities");
    }
    Ok(observation)
}

/// Phases that total intensity was fitted without are not known to polarisation either.
fn with_phases(mut instrument: InstrumentSettings, file: &StaticImageFile) -> InstrumentSettings {
    let knows = file.loss.iter().any(|loss| loss.data == LossKind::Visibilities);
    if let (Some(gains), false) = (&mut instrument.gains, knows) {
        gains.phases = GainPhases::Free;
    }
    instrument
}

/// Refuses more parts than half of the frames.
pub(super) fn check_folds(
    table: &str,
    strength: Option<&StrengthSettings>,
    frames: usize,
) -> Result<()> {
    let Some(strength) = strength.filter(|strength| frames < 2 * strength.folds) else {
        return Ok(());
    };
    let allowed = format!("{} at most, half of the frames", frames / 2);
    let key = format!("{table}strength.folds");
    Err(FitError::range(key, strength.folds, &allowed).into())
}

/// Times of images that are read, M.
fn times_of_images(file: &FitFile, frames: usize) -> Result<Vec<f64>> {
    let Some(DataFiles::Movie { from, to, .. }) = file.data else {
        refuse!("images are read, and there is no [data.movie]")
    };
    even_times("data.movie", frames, [from, to])
}

/// Times of frames at equal steps, M; `key` is the table that says the first and the last.
pub(super) fn even_times(key: &str, frames: usize, [from, to]: [f64; 2]) -> Result<Vec<f64>> {
    if !(from.is_finite() && to.is_finite() && (frames == 1 || to > from)) {
        refuse!("{key}: from = {from}, to = {to} are not allowed: from must be below to");
    }
    let step = (to - from) / (frames.max(2) - 1) as f64;
    Ok((0..frames).map(|k| from + step * k as f64).collect())
}
