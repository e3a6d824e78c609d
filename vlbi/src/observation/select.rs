//! Selections of an observation.

use super::{Observation, Row};

/// Data to throw away.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Flags {
    /// Stations by name, of which no baseline is kept.
    pub stations: Vec<String>,
    /// Intervals of UTC hours, ends included. One that ends before it starts goes over midnight, of every
    /// day: [20, 10] is from 20 h to 24 h and from 0 h to 10 h by the clock.
    pub times_h: Vec<[f64; 2]>,
    /// Baselines shorter than this many wavelengths.
    pub shorter_than: Option<f64>,
    /// Baselines longer than this many wavelengths.
    pub longer_than: Option<f64>,
}

impl Flags {
    /// Names that no station of the observation has.
    pub fn unknown_stations<'a>(&'a self, observation: &Observation) -> Vec<&'a str> {
        let known = |name: &str| observation.stations.iter().any(|s| s.name == name);
        self.stations.iter().map(String::as_str).filter(|name| !known(name)).collect()
    }

    /// The observation without what is flagged. Stations stay in its list.
    pub fn apply(&self, observation: &Observation) -> Observation {
        let rows: Vec<Row> =
            observation.rows.iter().filter(|row| !self.hits(observation, row)).copied().collect();
        Observation { rows, ..observation.clone_without_rows() }
    }

    fn hits(&self, observation: &Observation, row: &Row) -> bool {
        let length = row.uv[0].hypot(row.uv[1]);
        observation
            .names(row)
            .iter()
            .any(|name| self.stations.iter().any(|flagged| flagged == name))
            || self.times_h.iter().any(|interval| is_within(row.time_h, *interval))
            || self.shorter_than.is_some_and(|least| length < least)
            || self.longer_than.is_some_and(|most| length > most)
    }
}

/// Returns whether an hour is in an interval of [`Flags::times_h`].
fn is_within(time_h: f64, [from, to]: [f64; 2]) -> bool {
    if from <= to {
        return (from..=to).contains(&time_h);
    }
    let clock = time_h.rem_euclid(24.0);
    clock >= from || clock <= to
}

#[cfg(test)]
mod tests {
    use super::super::{Basis, Measured};
    use super::*;
    use crate::{Complex64, array::Station};

    #[test]
    fn exact_flags_of_every_kind() {
        let mut all = Observation::empty(Basis::Stokes);
        all.stations = ["A", "B", "C"].map(Station::named).to_vec();
        let i = Measured { visibility: Complex64::new(1.0, 0.0), noise_sigma: 0.1 };
        all.rows = [(1.0, [0, 1], 10.0), (2.0, [0, 2], 100.0), (3.0, [1, 2], 1000.0)]
            .map(|(time, stations, u)| Row::total_intensity(time, stations, [u, 0.0], i))
            .to_vec();
        let kept = |flags: Flags| {
            flags.apply(&all).rows.iter().map(|row| row.time_h as i32).collect::<Vec<_>>()
        };
        assert_eq!(kept(Flags::default()), [1, 2, 3]);
        assert_eq!(kept(Flags { stations: vec!["A".into()], ..Flags::default() }), [3]);
        assert_eq!(kept(Flags { times_h: vec![[1.5, 2.0]], ..Flags::default() }), [1, 3]);
        assert_eq!(kept(Flags { shorter_than: Some(50.0), ..Flags::default() }), [2, 3]);
        assert_eq!(kept(Flags { longer_than: Some(500.0), ..Flags::default() }), [1, 2]);
        assert_eq!(kept(Flags { times_h: vec![[22.0, 2.0]], ..Flags::default() }), [3]);
        for (time, interval, expected) in [
            (23.0, [20.0, 10.0], true),
            (26.0, [20.0, 10.0], true),
            (-2.0, [20.0, 10.0], true),
            (15.0, [20.0, 10.0], false),
            (35.0, [20.0, 10.0], false),
            (26.0, [25.0, 27.0], true),
            (2.0, [25.0, 27.0], false),
        ] {
            assert_eq!(is_within(time, interval), expected, "{time} h in {interval:?}");
        }
        let odd = Flags { stations: vec!["A".into(), "X".into()], ..Flags::default() };
        assert_eq!(odd.unknown_stations(&all), ["X"]);
    }
}
