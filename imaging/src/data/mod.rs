//! Measured visibilities as the data of a static image.

mod joined;
mod redrawn;

pub(crate) use joined::{cadence, instants};
pub use joined::{joined, station_of_file};
pub use redrawn::redrawn;

use crate::Error;
use crate::settings::{StaticImageFile, StaticPolarization};
use core::f64::consts::{FRAC_1_SQRT_2, SQRT_2};
use kerrlight_tomo::fit::settings::{
    GainPhases, InstrumentSettings, LossKind, Variability, refuse,
};
use kerrlight_tomo::fit::setup::{FitData, Reduction};
use kerrlight_vlbi::observation::{Basis, Observation};

/// Measured visibilities as the data of a static image, whose frames have hours of UTC for times. `name` is what they are
/// called in messages.
///
/// # Errors
/// If a visibility has no error, none is left, or the kernel of scattering needs a frequency that is not known.
pub fn total_intensity(
    file: &StaticImageFile,
    observation: Observation,
    name: &str,
) -> Result<FitData, Error> {
    let variability = file.data.visibilities.variability;
    let observation = cropped(observation, file.data.visibilities.utc_h)?;
    let observation = reduction(file, variability).of(observation, &file.loss, name)?;
    let instrument =
        file.instrument.clone().map(|known| InstrumentSettings { leakage: None, ..known });
    let sky = file.image.grid()?;
    let measured = FitData::of_frames(sky, observation, &file.loss, instrument.as_ref())?;
    let average_s = file.data.visibilities.average_s;
    Ok(FitData { average_s, has_intrinsic_variability: variability.is_some(), ..measured })
}

/// The data of the polarisation of a static image, with all products of the feeds; none if no polarisation is asked for.
///
/// # Errors
/// As [`total_intensity`], or if Q and U were not measured.
pub fn polarized(
    file: &StaticImageFile,
    observation: Observation,
    name: &str,
) -> Result<Option<FitData>, Error> {
    let Some(polarization) = &file.polarization else { return Ok(None) };
    let (data, losses) = (&file.data.visibilities, [polarization.loss()]);
    let observation = cropped(observation, data.utc_h)?;
    let mut observation = reduction(file, None).of(observation, &losses, name)?;
    // The frames are those of total intensity.
    let basis = observation.basis;
    observation.rows.retain(|row| row.stokes_i(basis).is_some());
    if !observation.is_polarized() {
        refuse!("{name}: there is no RL or LR (nor Q and U): remove the table [polarization]");
    }
    polarized_errors(&mut observation, data.variability, polarization);
    let instrument = file.instrument.clone().map(|instrument| with_phases(instrument, file));
    let sky = file.image.grid()?;
    let measured = FitData::of_frames(sky, observation, &losses, instrument.as_ref())?;
    let has_intrinsic_variability =
        data.variability.is_some() || polarization.variability.is_some();
    Ok(Some(FitData { average_s: data.average_s, has_intrinsic_variability, ..measured }))
}

fn reduction(file: &StaticImageFile, variability: Option<Variability>) -> Reduction {
    let data = &file.data.visibilities;
    Reduction {
        average_s: data.average_s,
        uv_min: data.uv_min,
        systematic: data.systematic,
        scattering: data.scattering,
        variability,
    }
}

/// Rows between two hours of UTC.
fn cropped(mut observation: Observation, utc_h: Option<[f64; 2]>) -> Result<Observation, Error> {
    let Some([from, to]) = utc_h else { return Ok(observation) };
    observation.rows.retain(|row| (from..=to).contains(&row.time_h));
    if observation.rows.is_empty() {
        refuse!("data.visibilities.utc_h = [{from}, {to}] leaves no visibilities");
    }
    Ok(observation)
}

/// Phases that total intensity was fitted without are not known to polarisation either. In ratios all gains cancel.
fn with_phases(mut instrument: InstrumentSettings, file: &StaticImageFile) -> InstrumentSettings {
    let knows = file.loss.iter().any(|loss| loss.data == LossKind::Visibilities);
    if let (Some(gains), false) = (&mut instrument.gains, knows) {
        gains.phases = GainPhases::Free;
    }
    let cancel =
        file.polarization.as_ref().is_some_and(|of| of.data == LossKind::PolarimetricRatios);
    if cancel {
        instrument.gains = None;
    }
    instrument
}

/// Adds to errors of products what the source varies, and leakage that calibration has left: a part of Stokes I from each
/// station.
fn polarized_errors(
    observation: &mut Observation,
    of_light: Option<Variability>,
    polarization: &StaticPolarization,
) {
    let basis = observation.basis;
    // Q and U are each half of the sum or the difference of RL and LR.
    let (crossed, share) = match basis {
        Basis::Circular => (2..4, 1.0),
        Basis::Stokes => (1..3, FRAC_1_SQRT_2),
    };
    for row in &mut observation.rows {
        let length = row.uv[0].hypot(row.uv[1]);
        let light = row.stokes_i(basis).map_or(0.0, |i| i.visibility.norm());
        let has_intrinsic_variability =
            |law: Option<Variability>| law.map_or(0.0, |law| law.sigma(length));
        // Half of the sum of two hands has the error that the law says.
        let hands = row.parts_of_i(basis).iter().flatten().count().max(1) as f64;
        let of_light = has_intrinsic_variability(of_light) * hands.sqrt();
        // √2: both stations of a baseline leak, and not the same.
        let leaked = SQRT_2 * polarization.leakage_left * light;
        let of_polarized =
            share * has_intrinsic_variability(polarization.variability).hypot(leaked);
        // What was not measured has no error, and must not get one.
        let is_measured =
            [0, 1, 2, 3].map(|k| row.product(k).is_some_and(|of| !of.is_unmeasured()));
        for (k, sigma) in row.noise_sigma.iter_mut().enumerate().filter(|(k, _)| is_measured[*k]) {
            *sigma = sigma.hypot(if crossed.contains(&k) { of_polarized } else { of_light });
        }
    }
}
