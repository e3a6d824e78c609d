//! Gains of stations: priors of those that observe, and what a fit found.

use super::{Measured, Result};
use crate::fit::settings::{InstrumentSettings, Loss, LossKind, refuse};
use crate::interferometry::Complex64;
use crate::interferometry::data_terms::GainTerm;
use crate::interferometry::gains::{GainPriors, GainTable, StationGain};
use crate::interferometry::observation::Observation;

/// Priors of the gains that a fit solves for, if it does.
///
/// # Errors
/// If a station has none, or no loss has gains, or two of them.
pub(super) fn priors(
    instrument: Option<&InstrumentSettings>,
    losses: &[Loss],
    observation: &Observation,
) -> Result<Option<GainPriors>> {
    let Some(instrument) = instrument else { return Ok(None) };
    let has = |kind| losses.iter().any(|loss| loss.data == kind);
    match (has(LossKind::Visibilities), has(LossKind::Amplitudes)) {
        (true, true) => refuse!(
            "instrument.gains: losses of visibilities and of amplitudes would each have gains of their own; give one of \
             them"
        ),
        (false, false) => refuse!(
            "instrument.gains needs a loss of visibilities or of amplitudes: closure quantities do not change with gains"
        ),
        _ => {}
    }
    let names: Vec<String> = observation.stations.iter().map(|s| s.name.clone()).collect();
    let observes = |k: usize| {
        let is = |s: &u16| usize::from(*s) == k;
        observation.stokes_i().any(|(row, _)| row.stations.iter().any(is))
    };
    let observing: Vec<bool> = (0..names.len()).map(observes).collect();
    let kept = names.iter().zip(&observing).filter(|(_, observes)| **observes);
    let kept: Vec<String> = kept.map(|(name, _)| name.clone()).collect();
    let some = instrument.gains.priors(&kept)?;
    let mut sigma = some.amplitude_sigma.iter();
    // Stations that do not observe have no gains.
    let of = |observes: &bool| observes.then(|| sigma.next().copied()).flatten().unwrap_or(0.0);
    let amplitude_sigma = observing.iter().map(of).collect();
    Ok(Some(GainPriors { amplitude_sigma, ..some }))
}

impl Measured {
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
            add(&mut table, &term, &model, &part);
        }
        Ok(Some(table))
    }
}

/// The gains of a scan.
fn add(table: &mut GainTable, term: &GainTerm, model: &[Complex64], part: &Observation) {
    let (gains, errors) = term.gains(model);
    let span_s = part.rows.iter().fold(0.0f64, |most, row| most.max(row.integration_s));
    for (k, station) in term.stations().iter().enumerate() {
        table.gains.push(StationGain {
            time_h: part.rows[0].time_h,
            span_s,
            station: part.stations[usize::from(*station)].name.clone(),
            gain: gains.gain(k),
            errors: [errors.log_amplitude[k], errors.phase[k]],
        });
    }
}
