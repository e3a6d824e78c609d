//! Rows of the same baseline, channel and time as others.

use super::average::{has_data, mean};
use super::{Observation, Row};
use std::borrow::Cow;
use std::collections::HashMap;

/// Rows that have the baseline, the channel and the time of an earlier one.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Repeats {
    /// Number of rows.
    pub rows: usize,
    /// Number of copies of an earlier one among them, to the last bit.
    pub copies: usize,
}

/// Key that rows which belong together have in common.
type Place = (u64, [u16; 2], u16);

impl Observation {
    /// Counts the rows that repeat the baseline, channel and time of another.
    pub fn repeats(&self) -> Repeats {
        let Some(groups) = self.groups() else { return Repeats::default() };
        let kept: usize = groups.iter().map(|rows| distinct(rows).len()).sum();
        Repeats { rows: self.rows.len() - groups.len(), copies: self.rows.len() - kept }
    }

    /// The observation with one row for each baseline, channel and time: copies are dropped, other repeats
    /// are averaged, weighted by 1/σ². The history says how many there were.
    #[must_use]
    pub fn with_repeats_merged(&self) -> Cow<'_, Self> {
        let Some(groups) = self.groups() else { return Cow::Borrowed(self) };
        let one = |rows: &Vec<Row>| {
            let (with, without): (Vec<Row>, Vec<Row>) = rows.iter().partition(has_data);
            let rows = if with.is_empty() { without } else { with };
            Row { time_h: rows[0].time_h, ..mean(&distinct(&rows), true) }
        };
        let rows = groups.iter().map(|rows| if rows.len() > 1 { one(rows) } else { rows[0] });
        let mut merged = Observation { rows: rows.collect(), ..self.clone_without_rows() };
        let Repeats { rows, copies } = self.repeats();
        merged.history.push(format!(
            "{rows} rows of the baseline, channel and time of another merged with it, {copies} of them copies"
        ));
        Cow::Owned(merged)
    }

    /// Rows of the same place, stations in the array's order; none where every row has a place of its own.
    fn groups(&self) -> Option<Vec<Vec<Row>>> {
        let place = |row: &Row| {
            let [a, b] = row.stations;
            (row.time_h.to_bits(), [a.min(b), a.max(b)], row.channel)
        };
        let mut numbers: HashMap<Place, usize> = HashMap::with_capacity(self.rows.len());
        let mut of_rows = Vec::with_capacity(self.rows.len());
        for row in &self.rows {
            let next = numbers.len();
            of_rows.push(*numbers.entry(place(row)).or_insert(next));
        }
        // Without repeats rows need not be copied.
        if numbers.len() == self.rows.len() {
            return None;
        }
        let mut groups = vec![Vec::new(); numbers.len()];
        for (row, group) in self.rows.iter().zip(of_rows) {
            groups[group].push(self.ordered(row));
        }
        Some(groups)
    }
}

/// Rows of one place without copies of earlier ones.
fn distinct(rows: &[Row]) -> Vec<Row> {
    let mut kept: Vec<Row> = Vec::new();
    for row in rows {
        if !kept.iter().any(|other| is_copy(other, row)) {
            kept.push(*row);
        }
    }
    kept
}

/// Returns whether two rows have the same products and errors, where these are there.
fn is_copy(a: &Row, b: &Row) -> bool {
    (0..4).all(|k| a.product(k) == b.product(k))
}

#[cfg(test)]
mod tests {
    use super::super::{Basis, Measured};
    use super::*;
    use crate::Complex64;

    #[test]
    fn exact_copies_count_once_and_repeats_are_averaged() {
        let row = |time_h: f64, stations: [u16; 2], re: f64, noise_sigma: f64| {
            let i = Measured { visibility: Complex64::new(re, 0.0), noise_sigma };
            Row::total_intensity(time_h, stations, [1.0, 0.0], i)
        };
        let mut observation = Observation::empty(Basis::Stokes);
        let once = [row(1.0, [0, 1], 3.0, 1.0), row(1.0, [0, 2], 4.0, 1.0)];
        observation.rows = once.to_vec();
        assert!(matches!(observation.with_repeats_merged(), Cow::Borrowed(_)));
        assert_eq!(observation.repeats(), Repeats::default());
        // A copy with its stations exchanged, and another measurement of the second one.
        observation.rows.extend([once[0].swapped(Basis::Stokes), row(1.0, [2, 0], 9.0, 0.5)]);
        observation.rows.push(row(1.0 + 1e-9, [0, 1], 3.0, 1.0));
        assert_eq!(observation.repeats(), Repeats { rows: 2, copies: 1 });
        let rows = observation.with_repeats_merged().into_owned().rows;
        assert_eq!(rows.len(), 3);
        assert_eq!(rows[0].product(0), once[0].product(0));
        let mean = rows[1].product(0).unwrap();
        assert!(
            (mean.visibility.re - 8.0).abs() < 1e-15
                && (mean.noise_sigma - 0.2f64.sqrt()).abs() < 1e-15
        );
        assert_eq!((rows[1].time_h, rows[1].stations), (1.0, [0, 2]));
    }
}
