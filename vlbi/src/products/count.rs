//! Numbers of closure quantities of data.

use super::{ClosureKind, ClosureSet};
use crate::observation::{Averaging, Observation};
use serde::Serialize;

/// Numbers of independent closure quantities of one kind.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub struct ClosureCount {
    /// Number of those of baselines that are strong enough.
    pub used: usize,
    /// Number of those of all baselines.
    pub possible: usize,
    /// Number of those of all baselines, each averaged over its scans, where these are more than `possible`:
    /// baselines of a scan have times of their own then.
    pub of_scans: Option<usize>,
}

impl ClosureCount {
    /// Counts those of an observation, with baselines stronger than `least_snr` times their noise.
    pub fn of(observation: &Observation, kind: ClosureKind, least_snr: f64) -> Self {
        let used = count(observation, kind, least_snr);
        let possible = if least_snr > 0.0 { count(observation, kind, 0.0) } else { used };
        ClosureCount { used, possible, of_scans: of_scans(observation, kind, possible) }
    }
}

fn count(observation: &Observation, kind: ClosureKind, least_snr: f64) -> usize {
    ClosureSet::of(observation, kind, least_snr).iter().map(|set| set.closures.len()).sum()
}

fn of_scans(observation: &Observation, kind: ClosureKind, possible: usize) -> Option<usize> {
    let n = observation.stations.len();
    let sets = observation.scans() * observation.channels.len().max(1);
    // (n − 1)(n − 2)/2 triangles are the most of n stations: averages cannot add any.
    if possible >= sets * (n * n.saturating_sub(3) / 2 + 1) {
        return None;
    }
    let scans = Averaging { in_scans: true, ..Averaging::over(f64::INFINITY) };
    let of_scans = count(&observation.total_intensity().averaged(scans), kind, 0.0);
    Some(of_scans).filter(|count| *count > possible)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Complex64;
    use crate::array::Station;
    use crate::observation::{Basis, Measured, Row};

    /// Four stations at two times, their baselines so many seconds apart; one station is weak.
    fn observation(apart_s: f64) -> Observation {
        let mut observation = Observation::empty(Basis::Stokes);
        observation.stations = ["A", "B", "C", "D"].map(Station::named).to_vec();
        for time in [0.0, 20.0] {
            let pairs = (0..4u16).flat_map(|a| (a + 1..4).map(move |b| [a, b]));
            for (k, stations) in pairs.enumerate() {
                let noise_sigma = if stations[1] == 3 { 1.0 } else { 0.1 };
                let i = Measured { visibility: Complex64::new(1.0, 0.0), noise_sigma };
                let time_h = (time + apart_s * k as f64) / 3600.0;
                observation.rows.push(Row::total_intensity(time_h, stations, [1e9, 0.0], i));
            }
        }
        observation
    }

    #[test]
    fn exact_counts_of_data_that_close_and_that_do_not() {
        let phases = |apart_s| ClosureCount::of(&observation(apart_s), ClosureKind::Phase, 3.0);
        assert_eq!(phases(0.0), ClosureCount { used: 2, possible: 6, of_scans: None });
        assert_eq!(phases(1.0), ClosureCount { used: 0, possible: 0, of_scans: Some(3) });
        let logs = ClosureCount::of(&observation(0.0), ClosureKind::LogAmplitude, 0.0);
        assert_eq!(logs, ClosureCount { used: 4, possible: 4, of_scans: None });
    }
}
