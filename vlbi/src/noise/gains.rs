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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::array::Station;
    use crate::observation::{Basis, Measured, Row};

    const UNIT: Complex64 = Complex64::new(1.0, 0.0);

    /// Scans of two stations that see 1 Jy.
    fn observed(scans: usize) -> Observation {
        let mut observation = Observation::empty(Basis::Stokes);
        observation.stations = ["A", "B"].map(Station::named).to_vec();
        let i = Measured { visibility: UNIT, noise_sigma: 0.1 };
        let row = |k: usize| Row::total_intensity(k as f64, [0, 1], [1e9, 0.0], i);
        observation.rows = (0..scans).map(row).collect();
        observation
    }

    /// ln |g| of a station.
    fn logs(table: &GainTable, name: &str) -> Vec<f64> {
        let own = table.gains.iter().filter(|gain| gain.station == name);
        own.map(|gain| gain.gain.norm().ln()).collect()
    }

    /// Asserts mean 0 and a standard deviation, within five standard errors.
    fn scatter_is(logs: &[f64], sigma: f64) {
        let count = logs.len() as f64;
        let mean = logs.iter().sum::<f64>() / count;
        let variance = logs.iter().map(|x| x * x).sum::<f64>() / count;
        assert!(mean.abs() < 5.0 * sigma / count.sqrt(), "{mean}");
        let error = 5.0 * (2.0 / count).sqrt();
        assert!((variance / sigma.powi(2) - 1.0).abs() < error, "{sigma}: {variance}");
    }

    /// Amplitudes scatter from scan to scan as the settings say, or as they say of one station; phases do not.
    #[test]
    fn exact_scatter_over_scans() {
        let stations = BTreeMap::from([("B".to_owned(), 0.4)]);
        let errors = GainErrors { scan_amplitude: 0.1, stations, ..Default::default() };
        let table = apply_gains(&mut observed(20_000), &errors, 7);
        assert_eq!(table.gains.len(), 40_000);
        scatter_is(&logs(&table, "A"), 0.1);
        scatter_is(&logs(&table, "B"), 0.4);
        assert!(table.gains.iter().all(|gain| gain.gain.im == 0.0));
    }

    /// Constant gains are the same in all scans, and scatter from seed to seed and between stations.
    #[test]
    fn exact_constant_gains() {
        let errors = GainErrors { constant_amplitude: 0.2, ..Default::default() };
        let mut all = Vec::new();
        for seed in 0..5000 {
            let table = apply_gains(&mut observed(3), &errors, seed);
            let [a, b] = ["A", "B"].map(|name| logs(&table, name));
            for of_scans in [&a, &b] {
                assert!(of_scans.len() == 3 && of_scans.iter().all(|x| *x == of_scans[0]));
            }
            assert_ne!(a[0], b[0]);
            all.extend([a[0], b[0]]);
        }
        scatter_is(&all, 0.2);
    }

    /// V₁₂ becomes g₁ ḡ₂ V₁₂.
    #[test]
    fn exact_gains_of_a_baseline() {
        let mut observation = observed(4);
        let errors = GainErrors { scan_amplitude: 0.3, random_phases: true, ..Default::default() };
        let table = apply_gains(&mut observation, &errors, 1);
        for (row, gains) in observation.rows.iter().zip(table.gains.chunks(2)) {
            assert_eq!(row.time_h, gains[0].time_h);
            let expected = gains[0].gain * gains[1].gain.conj();
            assert!((row.products[0] - expected).norm() < 1e-15 && expected.im != 0.0);
        }
    }
}
