//! Scans, told by the gaps between them, and intervals of time.

use super::Averaging;
use super::{Observation, Row};

/// A scan ends where nothing was measured for longer than this, seconds; a minute, but for rounded times.
const GAP_S: f64 = 60.5;

/// Times of files are rounded: that much early, seconds, is in time.
const ROUNDING_S: f64 = 0.01;

/// Shorter intervals are this long, seconds: below the resolution of times.
pub(super) const SHORTEST_S: f64 = 1e-3;

/// Hours of UTC of the first row of every scan, in order. A scan ends where no row has been measured for a minute, from
/// the end of one integration to the start of the next.
fn starts_h(rows: &[Row]) -> Vec<f64> {
    let half_h = |row: &Row| row.integration_s / 7200.0;
    let mut spans: Vec<[f64; 3]> =
        rows.iter().map(|r| [r.time_h - half_h(r), r.time_h, r.time_h + half_h(r)]).collect();
    spans.sort_by(|a, b| a[0].total_cmp(&b[0]));
    let mut starts: Vec<f64> = Vec::new();
    let mut last_end = f64::NEG_INFINITY;
    for [from, middle, to] in spans {
        match starts.last_mut().filter(|_| (from - last_end) * 3600.0 <= GAP_S) {
            // Spans are in order of their starts: a short one may have the earlier middle.
            Some(start) => *start = start.min(middle),
            None => starts.push(middle),
        }
        // A long integration may outlast those that begin after it.
        last_end = last_end.max(to);
    }
    starts
}

impl Observation {
    /// Returns the number of scans, told by gaps of a minute.
    pub fn scans(&self) -> usize {
        starts_h(&self.rows).len()
    }
}

/// The intervals of an average.
pub(super) struct Intervals {
    averaging: Averaging,
    /// Starts of the scans, where intervals belong to scans.
    starts_h: Vec<f64>,
}

impl Intervals {
    pub fn of(rows: &[Row], averaging: Averaging) -> Self {
        let starts_h = if averaging.in_scans { starts_h(rows) } else { Vec::new() };
        Intervals { averaging, starts_h }
    }

    /// The scan and the interval of it that a time of a row is in. Saturates for times beyond reason.
    pub fn at(&self, time_h: f64) -> [i64; 2] {
        let Averaging { seconds, in_scans, .. } = self.averaging;
        let seconds = seconds.max(SHORTEST_S);
        // Files of single precision tell a full minute as a little less.
        let early = ROUNDING_S.min(0.5 * seconds);
        let interval = |since_s: f64| ((since_s + early) / seconds).floor() as i64;
        if !in_scans {
            return [0, interval(time_h * 3600.0)];
        }
        let scan = self.starts_h.partition_point(|start| *start <= time_h).max(1) - 1;
        [scan as i64, interval((time_h - self.starts_h[scan]) * 3600.0)]
    }
}

impl Averaging {
    /// The interval of the clock that a time (hours of UTC) is in: its middle, hours, and half of its length, seconds.
    pub fn interval_at(&self, time_h: f64) -> (f64, f64) {
        let seconds = self.seconds.max(SHORTEST_S);
        let early = ROUNDING_S.min(0.5 * seconds);
        let number = ((time_h * 3600.0 + early) / seconds).floor();
        (((number + 0.5) * seconds - early) / 3600.0, 0.5 * seconds)
    }
}

#[cfg(test)]
mod tests {
    use super::super::{Basis, Measured};
    use super::*;
    use crate::Complex64;

    /// Rows of two baselines at these seconds, integrated for so long.
    fn observation(seconds: &[f64], integration_s: f64) -> Observation {
        let i = Measured { visibility: Complex64::new(1.0, 0.0), noise_sigma: 0.1 };
        let row = |time: f64, stations| Row {
            integration_s,
            ..Row::total_intensity(time / 3600.0, stations, [1.0, 0.0], i)
        };
        let mut observation = Observation::empty(Basis::Stokes);
        observation.rows =
            seconds.iter().flat_map(|t| [row(*t, [0, 1]), row(*t + 5.0, [0, 2])]).collect();
        observation
    }

    /// All times of an interval are nearer to its middle than its half length, and those of the next one are not.
    #[test]
    fn exact_intervals_hold_their_times() {
        let averaging = Averaging::over(300.0);
        let intervals = Intervals::of(&[], averaging);
        for seconds in [3600.0, 3600.5, 3700.0, 3899.0, 3899.995, 3900.0, 3950.0, 4199.9] {
            let (middle_h, half_s) = averaging.interval_at(seconds / 3600.0);
            assert!((seconds - 3600.0 * middle_h).abs() <= half_s + 1e-9, "{seconds}");
            assert_eq!(intervals.at(seconds / 3600.0), intervals.at(middle_h), "{seconds}");
        }
    }

    #[test]
    fn exact_scans_by_their_gaps() {
        let every = |step: f64, count: u32| -> Vec<f64> {
            (0..count).map(|k| 1000.0 + step * f64::from(k)).collect()
        };
        // Of 10 s and of a minute, without gaps; every ten minutes for one of them.
        assert_eq!(observation(&every(10.0, 40), 10.0).scans(), 1);
        assert_eq!(observation(&every(60.0, 40), 0.0).scans(), 1);
        assert_eq!(observation(&every(300.0, 40), 300.0).scans(), 1);
        assert_eq!(observation(&every(600.0, 7), 60.0).scans(), 7);
        let two = [every(10.0, 24), every(10.0, 24).iter().map(|t| t + 2000.0).collect()].concat();
        assert_eq!(observation(&two, 10.0).scans(), 2);
    }

    #[test]
    fn exact_averages_of_scans_and_of_pieces_of_them() {
        let seconds = [1000.0, 1010.0, 1020.0, 1299.9999, 1310.0, 5000.0, 5010.0];
        let mut observation = observation(&seconds, 300.0);
        observation.rows.reverse();
        let times = |seconds: f64| {
            let averaging = Averaging { in_scans: true, ..Averaging::over(seconds) };
            let rows = observation.averaged(averaging).rows;
            assert!(rows.chunks(2).all(|pair| pair[0].time_h == pair[1].time_h));
            rows.iter()
                .step_by(2)
                .map(|row| (row.time_h * 36000.0).round() / 10.0)
                .collect::<Vec<_>>()
        };
        assert_eq!(times(f64::INFINITY), [1130.5, 5007.5]);
        assert_eq!(times(14400.0), [1130.5, 5007.5]);
        assert_eq!(times(300.0), [1012.5, 1307.5, 5007.5]);
    }
}
