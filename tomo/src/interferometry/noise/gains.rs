//! Errors of station gains.

use super::generator;
use crate::interferometry::Complex64;
use crate::interferometry::observation::Observation;
use core::f64::consts::PI;
use rand::RngExt;
use rand_distr::StandardNormal;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Random gains: V₁₂ becomes g₁ ḡ₂ V₁₂, the same for all hands.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct GainErrors {
    /// Standard deviation of ln|g|, dimensionless, one number a station for the whole observation.
    pub constant_amplitude: f64,
    /// Standard deviation of ln|g|, dimensionless, another number a station and scan.
    pub scan_amplitude: f64,
    /// Whether arg g is random, uniform on the circle, for every station and scan, as the
    /// atmosphere makes it at millimetre wavelengths.
    pub random_phases: bool,
}

/// Multiplies visibilities by random gains. Scans are times of rows.
pub fn apply_gains(observation: &mut Observation, errors: GainErrors, seed: u64) {
    let stations = observation.stations.len();
    let mut constant = generator(seed, 2);
    let constant: Vec<f64> = (0..stations)
        .map(|_| errors.constant_amplitude * constant.sample::<f64, _>(StandardNormal))
        .collect();
    let mut times: BTreeMap<u64, Vec<Complex64>> = BTreeMap::new();
    // In order of time, so that the order of rows does not matter. Bits of positive doubles are
    // ordered as they are; those of negative ones at least consistently.
    observation.rows.iter().for_each(|row| {
        times.entry(row.time_h.to_bits()).or_default();
    });
    let mut random = generator(seed, 3);
    for gains in times.values_mut() {
        *gains = (0..stations)
            .map(|k| {
                let amplitude: f64 = random.sample(StandardNormal);
                let phase: f64 = random.random_range(-PI..PI);
                let amplitude = (constant[k] + errors.scan_amplitude * amplitude).exp();
                Complex64::from_polar(amplitude, if errors.random_phases { phase } else { 0.0 })
            })
            .collect();
    }
    for row in &mut observation.rows {
        let gains = &times[&row.time_h.to_bits()];
        let [first, second] = row.stations.map(|k| gains[usize::from(k)]);
        row.products.iter_mut().for_each(|product| *product *= first * second.conj());
    }
}
