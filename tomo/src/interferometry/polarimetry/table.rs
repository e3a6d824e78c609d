//! Tables of leakage.

use super::Leakage;
use crate::interferometry::Complex64;
use crate::interferometry::array::Station;

/// Leakage of a station.
#[derive(Debug, Clone, PartialEq)]
pub struct StationLeakage {
    /// Its name.
    pub station: String,
    /// d_R and d_L.
    pub terms: [Complex64; 2],
    /// Standard deviations of the real parts of both (those of the imaginary parts are about the same); NaN where they are
    /// not known.
    pub errors: [f64; 2],
}

/// Leakage of all stations that observe.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct LeakageTable {
    /// In the order of the observation.
    pub stations: Vec<StationLeakage>,
}

/// How far leakage is from the true one.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LeakageDistance {
    /// Root mean square of |d − d_true|.
    pub rms: f64,
    /// The largest |d − d_true|.
    pub largest: f64,
    /// Root mean square of |d_true|.
    pub size: f64,
    /// Terms that were compared.
    pub count: usize,
}

impl LeakageTable {
    /// Of stations for which `observes` holds.
    pub fn new(
        stations: &[Station],
        leakage: &Leakage,
        errors: &[[f64; 2]],
        observes: impl Fn(usize) -> bool,
    ) -> Self {
        let of = |k: usize| StationLeakage {
            station: stations[k].name.clone(),
            terms: leakage[k],
            errors: errors.get(k).copied().unwrap_or([f64::NAN; 2]),
        };
        let seen = (0..stations.len()).filter(|k| observes(*k));
        Self { stations: seen.map(of).collect() }
    }

    /// d_R and d_L of a station; none if it is not in the table.
    pub fn of(&self, station: &str) -> Option<[Complex64; 2]> {
        self.stations.iter().find(|s| s.station == station).map(|s| s.terms)
    }

    /// How far this leakage is from the true one; none if no station is in both.
    pub fn distance(&self, truth: &Self) -> Option<LeakageDistance> {
        let pairs = self.stations.iter().filter_map(|s| Some((s.terms, truth.of(&s.station)?)));
        let all: Vec<(Complex64, Complex64)> =
            pairs.flat_map(|(a, b)| [(a[0], b[0]), (a[1], b[1])]).collect();
        let count = all.len();
        let rms = |of: fn(&(Complex64, Complex64)) -> f64| {
            (all.iter().map(|pair| of(pair).powi(2)).sum::<f64>() / count as f64).sqrt()
        };
        (count > 0).then(|| LeakageDistance {
            rms: rms(|(a, b)| (a - b).norm()),
            largest: all.iter().fold(0.0, |most: f64, (a, b)| most.max((a - b).norm())),
            size: rms(|(_, b)| b.norm()),
            count,
        })
    }
}
