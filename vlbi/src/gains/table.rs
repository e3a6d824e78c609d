//! Tables of gains over time, and visibilities that they are taken out of.

use crate::Complex64;
use crate::observation::Observation;
use serde::Serialize;
use std::collections::HashMap;

/// The gain of a station at a time.
#[derive(Debug, Clone, PartialEq)]
pub struct StationGain {
    /// Hours of UTC since 0 h of the observation's day.
    pub time_h: f64,
    /// Seconds before and after that time for which it holds.
    pub span_s: f64,
    /// Name of the station.
    pub station: String,
    /// g: the station's data are g times what they should be.
    pub gain: Complex64,
    /// Standard deviations of ln|g| and of arg g (radians); NaN where they are not known.
    pub errors: [f64; 2],
}

/// Gains of stations over time.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct GainTable {
    /// Gains in order of time.
    pub gains: Vec<StationGain>,
}

impl GainTable {
    /// Returns whether phases are known: those that were not solved for are 0 and have errors of 0.
    pub fn has_phases(&self) -> bool {
        self.gains.iter().any(|gain| gain.gain.arg() != 0.0 || gain.errors[1] != 0.0)
    }

    /// The gains by station, to look them up.
    pub fn by_station(&self) -> GainsByStation<'_> {
        let mut stations: HashMap<&str, Vec<&StationGain>> = HashMap::new();
        for gain in &self.gains {
            stations.entry(&gain.station).or_default().push(gain);
        }
        stations.values_mut().for_each(|gains| gains.sort_by(|a, b| a.time_h.total_cmp(&b.time_h)));
        let longest_s = self.gains.iter().fold(SAME_S, |most, gain| most.max(gain.span_s));
        GainsByStation { stations, longest_s }
    }

    /// Takes the gains out of visibilities: V becomes V/(g₁ ḡ₂), σ becomes σ/|g₁ g₂|. Rows without a gain for both of
    /// their stations are left out; their number is returned.
    pub fn take_out(&self, observation: &mut Observation) -> usize {
        let before = observation.rows.len();
        let names: Vec<String> = observation.stations.iter().map(|s| s.name.clone()).collect();
        let gains = self.by_station();
        observation.rows.retain_mut(|row| {
            let gain = |k: usize| gains.at(&names[usize::from(row.stations[k])], row.time_h);
            let (Some(first), Some(second)) = (gain(0), gain(1)) else { return false };
            let factor = first * second.conj();
            row.products.iter_mut().for_each(|product| *product /= factor);
            row.noise_sigma.iter_mut().for_each(|sigma| *sigma /= factor.norm());
            true
        });
        let solved =
            |line: &String| line == "AMPCAL: 0" || (line == "PHASECAL: 0" && self.has_phases());
        observation.history.retain(|line| !solved(line));
        observation.history.push("station gains of a table taken out".to_owned());
        before - observation.rows.len()
    }
}

/// The gains of a table by station, in order of time.
#[derive(Debug, Clone)]
pub struct GainsByStation<'a> {
    stations: HashMap<&'a str, Vec<&'a StationGain>>,
    /// No gain holds for longer before or after its time, s.
    longest_s: f64,
}

impl GainsByStation<'_> {
    /// The gain of a station at a time: the nearest of those that are not farther than their spans.
    pub fn at(&self, station: &str, time_h: f64) -> Option<Complex64> {
        let gains = self.stations.get(station)?;
        let away_s = |gain: &StationGain| 3600.0 * (gain.time_h - time_h).abs();
        let ends = [-1.0, 1.0].map(|side| time_h + side * 1.001 * self.longest_s / 3600.0);
        let [from, to] = ends.map(|end| gains.partition_point(|gain| gain.time_h < end));
        // A long span may hold where a nearer gain does not.
        let holding = gains[from..to].iter().filter(|gain| away_s(gain) <= gain.span_s.max(SAME_S));
        Some(holding.min_by(|a, b| away_s(a).total_cmp(&away_s(b)))?.gain)
    }
}

/// Times closer than this many seconds are one.
const SAME_S: f64 = 0.5;

/// Distance of gains from true ones, apart from what no data know: one factor on all amplitudes, which the flux takes up,
/// and a phase that all stations of a time share.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct GainDistance {
    /// The factor on all amplitudes, taken out.
    pub scale: f64,
    /// Root mean square of |g/g_true − 1|.
    pub rms: f64,
    /// Median of |g/g_true − 1|.
    pub median: f64,
    /// Gains that were compared.
    pub count: usize,
}

impl GainTable {
    /// Returns the distance of these gains from true ones; none if no gain is in both.
    pub fn distance(&self, truth: &GainTable) -> Option<GainDistance> {
        let truth: HashMap<(u64, &str), Complex64> = truth
            .gains
            .iter()
            .map(|g| ((g.time_h.to_bits(), g.station.as_str()), g.gain))
            .collect();
        let mut ratios: Vec<Complex64> = Vec::new();
        for scan in self.gains.chunk_by(|a, b| a.time_h == b.time_h) {
            let ratio = |g: &StationGain| {
                Some(g.gain / truth.get(&(g.time_h.to_bits(), g.station.as_str()))?)
            };
            let of_scan: Vec<Complex64> = scan.iter().filter_map(ratio).collect();
            // The mean direction: amplitudes have no weight in the phase that all share.
            let turn: Complex64 = of_scan.iter().map(|r| r / r.norm()).sum();
            ratios.extend(of_scan.iter().map(|r| r * turn.conj() / turn.norm()));
        }
        let count = ratios.len();
        let mean = ratios.iter().map(|r| r.norm().ln()).sum::<f64>() / count as f64;
        let scale = mean.exp();
        let mut misses: Vec<f64> = ratios.iter().map(|r| (r / scale - 1.0).norm()).collect();
        misses.sort_by(f64::total_cmp);
        let rms = (misses.iter().map(|x| x * x).sum::<f64>() / count as f64).sqrt();
        Some(GainDistance { scale, rms, median: *misses.get(count / 2)?, count })
    }

    /// Names of the stations, each once, in order of appearance.
    pub fn stations(&self) -> Vec<&str> {
        let mut names: Vec<&str> = Vec::new();
        for gain in &self.gains {
            if !names.contains(&gain.station.as_str()) {
                names.push(&gain.station);
            }
        }
        names
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Scale and common phase, which no data constrain, do not count; the rest does.
    #[test]
    fn exact_distances_leave_scale_and_common_phases_out() {
        let gain = |time_h: f64, station: &str, gain: Complex64| StationGain {
            time_h,
            span_s: 0.0,
            station: station.to_owned(),
            gain,
            errors: [0.0; 2],
        };
        let of = |turn: f64, scale: f64, off: f64| {
            let all = (0..3).flat_map(|time| {
                ["A", "B", "C"].map(|name| {
                    let phase = f64::from(time) * turn + name.len() as f64;
                    let amplitude = scale * if name == "B" { 1.0 + off } else { 1.0 };
                    gain(f64::from(time), name, Complex64::from_polar(amplitude, phase))
                })
            });
            GainTable { gains: all.collect() }
        };
        let alike = of(0.7, 1.3, 0.0).distance(&of(0.0, 1.0, 0.0)).unwrap();
        assert!(alike.rms < 1e-12 && (alike.scale - 1.3).abs() < 1e-12 && alike.count == 9);
        let off = of(0.7, 1.3, 0.03).distance(&of(0.0, 1.0, 0.0)).unwrap();
        assert!((0.01..0.02).contains(&off.rms), "{off:?}");
        assert_eq!(GainTable::default().distance(&of(0.0, 1.0, 0.0)), None);
        assert_eq!(of(0.0, 1.0, 0.0).stations(), ["A", "B", "C"]);
    }
}
