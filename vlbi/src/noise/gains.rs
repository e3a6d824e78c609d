//! Errors of station gains.

use super::generator;
use crate::Complex64;
use crate::gains::{GainTable, StationGain};
use crate::observation::Observation;
use core::f64::consts::PI;
use rand::RngExt;
use rand_distr::StandardNormal;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Random gains: V₁₂ becomes g₁ ḡ₂ V₁₂, the same for all hands.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct GainErrors {
    /// Standard deviation of ln |g|, one draw a station.
    #[schemars(range(min = 0.0, max = 10.0), extend("unit" = "a standard deviation of ln |g|"))]
    pub constant_amplitude: f64,
    /// Standard deviation of ln |g|, one draw a station and scan.
    #[schemars(range(min = 0.0, max = 10.0), extend("unit" = "a standard deviation of ln |g|"))]
    pub scan_amplitude: f64,
    /// True if phases are uniform, drawn again for every scan.
    pub random_phases: bool,
    /// Stations whose `scan_amplitude` differs, such as `{ LMT = 0.6 }`.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    #[schemars(extend("additionalProperties" = {"minimum": 0.0, "maximum": 10.0}, "unit" = "a standard deviation of ln |g|"))]
    pub stations: BTreeMap<String, f64>,
}

impl GainErrors {
    /// The first name of `stations` that the observation does not have.
    pub fn unknown_station(&self, observation: &Observation) -> Option<&str> {
        let has = |name: &str| observation.stations.iter().any(|station| station.name == name);
        self.stations.keys().map(String::as_str).find(|name| !has(name))
    }
}

/// Multiplies visibilities by random gains, and says by which. Scans are times of rows.
pub fn apply_gains(observation: &mut Observation, errors: &GainErrors, seed: u64) -> GainTable {
    let stations = observation.stations.len();
    let names: Vec<&str> = observation.stations.iter().map(|s| s.name.as_str()).collect();
    let scatter =
        |k: usize| errors.stations.get(names[k]).copied().unwrap_or(errors.scan_amplitude);
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
                // Drawn also where it is not used, so that amplitudes do not depend on it.
                let phase: f64 = random.random_range(-PI..PI);
                let amplitude = (constant[k] + scatter(k) * amplitude).exp();
                Complex64::from_polar(amplitude, if errors.random_phases { phase } else { 0.0 })
            })
            .collect();
    }
    let table = table(&times, &names);
    for row in &mut observation.rows {
        let gains = &times[&row.time_h.to_bits()];
        let [first, second] = row.stations.map(|k| gains[usize::from(k)]);
        row.products.iter_mut().for_each(|product| *product *= first * second.conj());
    }
    table
}

/// The gains of all stations at all times.
fn table(times: &BTreeMap<u64, Vec<Complex64>>, names: &[&str]) -> GainTable {
    let of_time = |(time, gains): (&u64, &Vec<Complex64>)| {
        let of = |(name, gain): (&&str, &Complex64)| StationGain {
            time_h: f64::from_bits(*time),
            span_s: 0.0,
            station: (*name).to_owned(),
            gain: *gain,
            errors: [0.0; 2],
        };
        names.iter().zip(gains).map(of).collect::<Vec<_>>()
    };
    GainTable { gains: times.iter().flat_map(of_time).collect() }
}
