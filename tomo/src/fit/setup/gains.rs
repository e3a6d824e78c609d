//! Gains of stations: priors of those that observe, and what a fit found.

use super::leakage::observing;
use super::polarized::is_polarized;
use super::{FitData, Result};
use crate::fit::settings::{InstrumentSettings, Loss, LossKind, refuse};
use kerrlight_vlbi::Complex64;
use kerrlight_vlbi::data_terms::GainTerm;
use kerrlight_vlbi::gains::{GainPriors, GainTable, ScanGains, StationGain};
use kerrlight_vlbi::observation::Observation;

/// Priors of the gains that a fit solves for, if it does.
///
/// # Errors
/// If a station has none, or no loss has gains, or two of them.
pub(super) fn priors(
    instrument: Option<&InstrumentSettings>,
    losses: &[Loss],
    observation: &Observation,
) -> Result<Option<GainPriors>> {
    let Some(settings) = instrument.and_then(|instrument| instrument.gains.as_ref()) else {
        return Ok(None);
    };
    let of_gains = |loss: &&Loss| loss.data.is_visibilities() || loss.data == LossKind::Amplitudes;
    match losses.iter().filter(of_gains).count() {
        0 => refuse!(
            "instrument.gains needs a loss of visibilities or of amplitudes: closure quantities do not change with gains"
        ),
        1 => {}
        _ => refuse!(
            "instrument.gains: losses of visibilities and of amplitudes would each have gains of their own; give one of \
             them"
        ),
    }
    // A station without Stokes I has no part in losses of total intensity.
    let observing = match is_polarized(losses) {
        true => observing(observation),
        false => observing(&observation.total_intensity()),
    };
    let kept = observation.stations.iter().zip(&observing).filter(|(_, observes)| **observes);
    let kept: Vec<String> = kept.map(|(station, _)| station.name.clone()).collect();
    let some = settings.priors(&kept)?;
    let mut sigma = some.amplitude_sigma.iter();
    // Stations that do not observe have no gains.
    let of = |observes: &bool| observes.then(|| sigma.next().copied()).flatten().unwrap_or(0.0);
    let amplitude_sigma = observing.iter().map(of).collect();
    Ok(Some(GainPriors { amplitude_sigma, ..some }))
}

impl FitData {
    /// The gains of every frame that explain the data best beside visibilities of a model, those of all rows that have
    /// Stokes I in their order; none if gains are not solved for.
    ///
    /// # Errors
    /// If data make no term.
    pub fn gains(&self, losses: &[Loss], model: &[Complex64]) -> Result<Option<GainTable>> {
        let (Some(priors), Some((observation, frames))) = (&self.gains, &self.visibilities) else {
            return Ok(None);
        };
        let seen = observation.rows.iter().zip(frames);
        let seen = seen.filter(|(row, _)| row.stokes_i(observation.basis).is_some());
        let seen: Vec<_> = seen.zip(model).map(|((row, frame), v)| (*frame, *row, *v)).collect();
        let mut table = GainTable::default();
        for scan in seen.chunk_by(|a, b| a.0 == b.0) {
            let rows = scan.iter().map(|(_, row, _)| *row).collect();
            let part = Observation { rows, ..observation.clone() };
            let term = match losses.iter().any(|loss| loss.data == LossKind::Visibilities) {
                true => GainTerm::visibilities(&part, priors)?,
                false => GainTerm::amplitudes(&part, priors)?,
            };
            let model: Vec<Complex64> = scan.iter().map(|(.., v)| *v).collect();
            let (gains, errors) = term.gains(&model);
            add(&mut table, term.stations(), gains, errors, &part);
        }
        Ok(Some(table))
    }

    /// The gains of every frame that explain all products best beside images of I, Q and U of all frames, with the leakage
    /// that was found last; none if gains are not solved for.
    ///
    /// # Errors
    /// If data make no term.
    pub fn polarized_gains(&self, movie: &[f32]) -> Result<Option<GainTable>> {
        let mut table = GainTable::default();
        for scan in self.beside(movie)? {
            let Some((stations, gains, errors)) = scan.term.gains(&scan.model) else {
                return Ok(None);
            };
            add(&mut table, stations, gains, errors, &self.part(scan.frame)?.0);
        }
        Ok(Some(table))
    }
}

/// The gains of the stations of a scan, with their errors.
fn add(
    table: &mut GainTable,
    stations: &[u16],
    gains: ScanGains,
    errors: ScanGains,
    part: &Observation,
) {
    let span_s = part.rows.iter().fold(0.0f64, |most, row| most.max(row.integration_s));
    for (k, station) in stations.iter().enumerate() {
        table.gains.push(StationGain {
            time_h: part.rows[0].time_h,
            span_s,
            station: part.stations[usize::from(*station)].name.clone(),
            gain: gains.gain(k),
            errors: [errors.log_amplitude[k], errors.phase[k]],
        });
    }
}
