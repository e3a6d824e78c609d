//! Coherent averages over time and channels.

use super::scans::{Intervals, SHORTEST_S};
use super::{Basis, Measured, Observation, Row};
use crate::Complex64;
use std::collections::BTreeMap;

/// Averaging of rows over time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Averaging {
    /// Length of an interval in seconds; with `in_scans` it may be infinite: whole scans.
    pub seconds: f64,
    /// True if intervals count from the start of each scan and end with it. Otherwise they start at multiples of their
    /// length since 0 h UTC.
    pub in_scans: bool,
    /// True if products count by 1/σ². Otherwise means are plain, as in eht-imaging.
    pub weighted: bool,
}

impl Averaging {
    /// Weighted by 1/σ², over intervals of the clock.
    pub fn over(seconds: f64) -> Self {
        Averaging { seconds, in_scans: false, weighted: true }
    }

    /// The range of lengths, or infinity for whole scans: shorter ones would be below the resolution of times.
    pub fn is_allowed(&self) -> bool {
        (SHORTEST_S..=1e9).contains(&self.seconds) || self.in_scans && self.seconds == f64::INFINITY
    }

    /// Describes what it did, in a line.
    fn told(&self) -> String {
        let length = match self.seconds.is_finite() {
            true => format!(" over {} s", self.seconds),
            false => String::new(),
        };
        let of = if self.in_scans { " of scans" } else { "" };
        let plain = if self.weighted { "" } else { ", plain" };
        format!("coherent averages{of}{length}{plain}")
    }
}

impl Observation {
    /// Averages every baseline and channel over intervals. All rows of an interval get one time, the mean of those of
    /// their baselines, so that baselines that were measured in different parts of an interval close.
    ///
    /// Products are means weighted by 1/σ², so that σ of a mean is 1/√(Σ 1/σ²); times and (u, v)
    /// are means weighted by integration time, which adds up, of rows that have a product. Products that were not measured
    /// ([`Measured::is_unmeasured`](super::Measured::is_unmeasured)) do not count; where other errors are zero, or
    /// without weights, means are plain and σ is √(Σσ²)/n. Rows that repeat others count as in
    /// [`with_repeats_merged`](Self::with_repeats_merged).
    #[must_use]
    pub fn averaged(&self, averaging: Averaging) -> Self {
        let merged = self.with_repeats_merged();
        let intervals = Intervals::of(&merged.rows, averaging);
        // In order: `chunk_by` below needs the baselines of an interval next to each other.
        let mut bins: BTreeMap<([i64; 2], [u16; 2], u16), Vec<Row>> = BTreeMap::new();
        for row in merged.rows.iter().filter(has_data).map(|row| merged.ordered(row)) {
            bins.entry((intervals.at(row.time_h), row.stations, row.channel))
                .or_default()
                .push(row);
        }
        let mut observation = merged.clone_without_rows();
        let all: Vec<_> = bins.iter().collect();
        for interval in all.chunk_by(|((a, ..), _), ((b, ..), _)| a == b) {
            let mut rows: Vec<Row> =
                interval.iter().map(|(_, rows)| mean(rows, averaging.weighted)).collect();
            let time_h = rows.iter().map(|row| row.time_h).sum::<f64>() / rows.len() as f64;
            rows.iter_mut().for_each(|row| row.time_h = time_h);
            observation.rows.extend(rows);
        }
        observation.history.push(averaging.told());
        observation
    }

    /// A row with its stations in the array's order.
    pub(super) fn ordered(&self, row: &Row) -> Row {
        if row.stations[0] <= row.stations[1] { *row } else { row.swapped(self.basis) }
    }

    /// Averages every baseline and time over all spectral channels, with the same weights; (u, v)
    /// are those of `frequency_hz`, as in eht-imaging. Without channels nothing changes.
    #[must_use]
    pub fn averaged_over_channels(&self) -> Self {
        let mut observation = self.clone_without_rows();
        let (Some(reference), false) = (self.frequency_hz, self.channels.is_empty()) else {
            return self.clone();
        };
        // Bits of positive doubles are ordered as they are, those of negative ones consistently.
        let mut bins: BTreeMap<(u64, [u16; 2]), Vec<Row>> = BTreeMap::new();
        let merged = self.with_repeats_merged();
        for mut row in merged.rows.iter().filter(has_data).map(|row| self.ordered(row)) {
            let scale = self.frequency_of(&row).map_or(1.0, |frequency| reference / frequency);
            row.uv = row.uv.map(|x| x * scale);
            row.channel = 0;
            bins.entry((row.time_h.to_bits(), row.stations)).or_default().push(row);
        }
        // Channels are measured at one time: their integrations do not add up.
        let mean_of = |rows: &Vec<Row>| {
            let Row { time_h, integration_s, .. } = rows[0];
            Row { time_h, integration_s, ..mean(rows, true) }
        };
        observation.rows = bins.values().map(mean_of).collect();
        observation.channels.clear();
        let count = self.channels.len();
        observation.history.push(format!("mean of {count} spectral channels"));
        observation.sort();
        observation
    }

    /// The data with Stokes I as both parallel hands, RR = LL = I, each with σ√2: how the EHT
    /// publishes total intensity. There are no cross hands.
    #[must_use]
    pub fn as_equal_hands(&self) -> Self {
        let mut observation = self.clone_without_rows();
        observation.basis = Basis::Circular;
        let none = Complex64::new(0.0, 0.0);
        observation.rows = self
            .stokes_i()
            .map(|(row, i)| {
                let sigma = i.noise_sigma * core::f64::consts::SQRT_2;
                Row {
                    products: [i.visibility, i.visibility, none, none],
                    noise_sigma: [sigma, sigma, f64::NAN, f64::NAN],
                    ..*row
                }
            })
            .collect();
        observation
    }
}

/// Returns whether a row has a product: one that is flagged altogether takes no part in times and (u, v) of a mean.
pub(super) fn has_data(row: &&Row) -> bool {
    (0..4).any(|k| row.product(k).is_some())
}

/// The mean of rows of one baseline.
pub(super) fn mean(rows: &[Row], weighted: bool) -> Row {
    let total: f64 = rows.iter().map(|row| row.integration_s).sum();
    // Integration times that a file does not tell are 0: rows then count the same.
    let weight = |row: &Row| {
        if total > 0.0 { row.integration_s / total } else { 1.0 / rows.len() as f64 }
    };
    let over_time = |value: fn(&Row) -> f64| rows.iter().map(|r| weight(r) * value(r)).sum::<f64>();
    // A mean of instants is about as long as they lie apart.
    let ends = rows.iter().fold([f64::INFINITY, f64::NEG_INFINITY], |[first, last], row| {
        [first.min(row.time_h), last.max(row.time_h)]
    });
    let mut result = Row {
        time_h: over_time(|r| r.time_h),
        integration_s: if total > 0.0 { total } else { 3600.0 * (ends[1] - ends[0]) },
        uv: [over_time(|r| r.uv[0]), over_time(|r| r.uv[1])],
        ..rows[0]
    };
    for k in 0..4 {
        (result.products[k], result.noise_sigma[k]) = mean_product(rows, k, weighted);
    }
    result
}

fn mean_product(rows: &[Row], k: usize, weighted: bool) -> (Complex64, f64) {
    let all = || rows.iter().filter_map(|row| row.product(k));
    // A mean of nothing measured is not measured either.
    let only_unmeasured = all().all(|m| m.is_unmeasured());
    let present: Vec<Measured> = all().filter(|m| only_unmeasured || !m.is_unmeasured()).collect();
    if present.is_empty() {
        return (Complex64::new(0.0, 0.0), f64::NAN);
    }
    let weighted = weighted && present.iter().all(|m| m.noise_sigma > 0.0);
    if weighted { weighted_mean(&present) } else { plain_mean(&present) }
}

/// Errors and amplitudes whose squares are within the range of numbers, however many there are.
fn have_squares(data: &[Measured]) -> bool {
    let is_usual = |x: f64| x == 0.0 || (1e-100..=1e100).contains(&x);
    data.iter().all(|m| is_usual(m.noise_sigma) && m.visibility.norm() <= 1e100)
}

fn weighted_mean(data: &[Measured]) -> (Complex64, f64) {
    if have_squares(data) {
        let weight: f64 = data.iter().map(|m| m.noise_sigma.powi(-2)).sum();
        let sum: Complex64 = data.iter().map(|m| m.visibility * m.noise_sigma.powi(-2)).sum();
        return (sum / weight, weight.sqrt().recip());
    }
    // In units of the least error no weight leaves the range of numbers.
    let least = data.iter().fold(f64::INFINITY, |least, m| least.min(m.noise_sigma));
    let share = |m: &Measured| (least / m.noise_sigma).powi(2);
    let weight: f64 = data.iter().map(share).sum();
    let mean = data.iter().map(|m| m.visibility * (share(m) / weight)).sum();
    (mean, least / weight.sqrt())
}

fn plain_mean(data: &[Measured]) -> (Complex64, f64) {
    let count = data.len() as f64;
    if have_squares(data) {
        let sum: Complex64 = data.iter().map(|m| m.visibility).sum();
        let variance: f64 = data.iter().map(|m| m.noise_sigma.powi(2)).sum();
        return (sum / count, variance.sqrt() / count);
    }
    // In units of the largest error no square leaves the range; it divides, so not 0.
    let most = data.iter().fold(f64::MIN_POSITIVE, |most, m| most.max(m.noise_sigma));
    let squares: f64 = data.iter().map(|m| (m.noise_sigma / most).powi(2)).sum();
    (data.iter().map(|m| m.visibility / count).sum(), most * (squares.sqrt() / count))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exact_means_and_errors() {
        let row = |time_h: f64, re: f64, noise_sigma: f64, stations: [u16; 2]| Row {
            integration_s: 10.0,
            ..Row::total_intensity(
                time_h,
                stations,
                if stations[0] < stations[1] { [time_h, 0.0] } else { [-time_h, 0.0] },
                Measured { visibility: Complex64::new(re, 1.0), noise_sigma },
            )
        };
        let mut observation = Observation::empty(Basis::Stokes);
        // Two rows of one minute, one of them with its stations exchanged; then the next minute.
        observation.rows = vec![
            row(1.001, 3.0, 1.0, [0, 1]),
            row(1.003, 6.0, 0.5, [1, 0]),
            row(1.02, 9.0, 1.0, [0, 1]),
        ];
        let rows = observation.averaged(Averaging::over(60.0)).rows;
        assert_eq!(rows.len(), 2);
        let i = rows[0].product(0).unwrap();
        assert!((i.visibility - Complex64::new(27.0 / 5.0, -3.0 / 5.0)).norm() < 1e-15);
        assert!((i.noise_sigma - 0.2f64.sqrt()).abs() < 1e-15);
        assert!((rows[0].time_h - 1.002).abs() < 1e-15 && (rows[0].uv[0] - 1.002).abs() < 1e-15);
        assert_eq!((rows[0].integration_s, rows[0].stations), (20.0, [0, 1]));
        assert!(rows[0].noise_sigma[1].is_nan());
    }

    /// Tests two scans, whose baselines were measured in different parts of them.
    #[test]
    fn exact_one_time_a_scan() {
        let i = Measured { visibility: Complex64::new(1.0, 0.0), noise_sigma: 0.1 };
        let row = |seconds: f64, stations| {
            Row::total_intensity(seconds / 3600.0, stations, [1.0, 0.0], i)
        };
        let mut observation = Observation::empty(Basis::Stokes);
        observation.rows =
            vec![row(301.0, [0, 1]), row(590.0, [0, 2]), row(599.0, [1, 2]), row(601.0, [0, 1])];
        let rows = observation.averaged(Averaging::over(300.0)).rows;
        let seconds: Vec<f64> = rows.iter().map(|row| row.time_h * 3600.0).collect();
        let mean = (301.0 + 590.0 + 599.0) / 3.0;
        for (found, expected) in seconds.iter().zip([mean, mean, mean, 601.0]) {
            assert!((found - expected).abs() < 1e-9, "{seconds:?}");
        }
        assert!(rows[..3].iter().all(|row| row.time_h == rows[0].time_h));
    }

    /// Hands that were not measured change neither Stokes I nor a mean.
    #[test]
    fn exact_unmeasured_products_do_not_count() {
        let hand = |re: f64| Complex64::new(re, 0.0);
        let row = |time_h: f64, rr: (f64, f64), ll: (f64, f64)| Row {
            products: [hand(rr.0), hand(ll.0), hand(0.0), hand(0.0)],
            noise_sigma: [rr.1, ll.1, 0.0, f64::NAN],
            ..Row::empty(time_h, [0, 1], [1.0, 0.0])
        };
        let one = row(1.001, (3.0, 0.3), (0.0, 0.0)).stokes_i(Basis::Circular).unwrap();
        assert_eq!((one.visibility.re, one.noise_sigma), (3.0, 0.3));
        assert!(row(1.0, (0.0, 0.0), (0.0, 0.0)).stokes_i(Basis::Circular).is_none());
        let mut observation = Observation::empty(Basis::Circular);
        observation.rows =
            vec![row(1.001, (3.0, 0.3), (0.0, 0.0)), row(1.002, (3.0, 0.3), (1.0, 0.4))];
        let mean = observation.averaged(Averaging::over(60.0)).rows[0];
        let [rr, ll] = mean.parts_of_i(Basis::Circular).map(Option::unwrap);
        assert!((rr.noise_sigma - 0.3 / 2f64.sqrt()).abs() < 1e-15);
        assert_eq!((ll.visibility.re, ll.noise_sigma), (1.0, 0.4));
        assert!(mean.product(2).unwrap().is_unmeasured() && mean.product(3).is_none());
    }

    /// Errors whose squares no double holds give means as others do, in units of their own.
    #[test]
    fn exact_means_of_any_size() {
        let row = |time_h: f64, size: f64, re: f64, sigma: f64| {
            let i =
                Measured { visibility: Complex64::new(re * size, 0.0), noise_sigma: sigma * size };
            Row::total_intensity(time_h, [0, 1], [1.0, 0.0], i)
        };
        for size in [1e-300, 1e-160, 1.0, 1e160, 1e300] {
            for weighted in [true, false] {
                let mut observation = Observation::empty(Basis::Stokes);
                observation.rows = vec![row(1.0, size, 3.0, 1.0), row(1.001, size, 6.0, 0.5)];
                let averaging = Averaging { weighted, ..Averaging::over(60.0) };
                let mean = observation.averaged(averaging).rows[0].product(0).unwrap();
                let [value, sigma] =
                    if weighted { [5.4, 0.2f64.sqrt()] } else { [4.5, 1.25f64.sqrt() / 2.0] };
                assert!((mean.visibility.re / size / value - 1.0).abs() < 1e-14, "{size} {mean:?}");
                assert!((mean.noise_sigma / size / sigma - 1.0).abs() < 1e-14, "{size} {mean:?}");
            }
        }
    }

    #[test]
    fn exact_equal_hands_give_stokes_i_back() {
        let mut observation = Observation::empty(Basis::Stokes);
        let i = Measured { visibility: Complex64::new(0.25, -0.5), noise_sigma: 0.03 };
        observation.rows = vec![Row::total_intensity(1.0, [0, 1], [1.0, 2.0], i)];
        let hands = observation.as_equal_hands();
        let back = hands.rows[0].stokes_i(hands.basis).unwrap();
        assert_eq!(back.visibility, i.visibility);
        assert!((back.noise_sigma - 0.03).abs() < 1e-16);
    }
}
