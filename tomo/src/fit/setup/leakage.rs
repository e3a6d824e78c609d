//! Leakage that is not known.

use super::Result;
use crate::fit::settings::{InstrumentSettings, LeakageSettings, refuse};
use kerrlight_vlbi::observation::{Basis, Observation};
use kerrlight_vlbi::polarimetry::SharedLeakage;

/// Leakage that is not known.
#[derive(Clone, Debug)]
pub struct LeakageUnknown {
    /// Settings of leakage: its prior, and how often it is solved for.
    pub settings: LeakageSettings,
    /// Leakage that was found last; terms of the loss see it.
    pub shared: SharedLeakage,
}

/// The leakage that a fit solves for, if it does.
///
/// # Errors
/// If data are no products of circular feeds.
pub(super) fn unknown(
    instrument: Option<&InstrumentSettings>,
    observation: &Observation,
) -> Result<Option<LeakageUnknown>> {
    let Some(settings) = instrument.and_then(|instrument| instrument.leakage) else {
        return Ok(None);
    };
    if observation.basis != Basis::Circular {
        refuse!(
            "instrument.leakage needs the products of circular feeds (RR, LL, RL, LR): these data are I, Q, U, V"
        );
    }
    let shared = SharedLeakage::none(observation.stations.len());
    Ok(Some(LeakageUnknown { settings, shared }))
}

/// Returns whether each station has any rows.
pub(super) fn observing(observation: &Observation) -> Vec<bool> {
    let mut observes = vec![false; observation.stations.len()];
    for station in observation.rows.iter().flat_map(|row| row.stations) {
        observes[usize::from(station)] = true;
    }
    observes
}
