//! w of baselines: (u, v) come with the data, w from where the stations are.

use crate::earth::{Frame, Ut1, View};
use crate::observation::{Observation, Row};
use kerrlight_common::units::SPEED_OF_LIGHT;

/// (u, v) of the frame are off by less than this part of baselines, or positions are not those of the data.
const LARGEST_MISS: f64 = 0.01;

/// Number of rows that decide about the frame.
const TRIAL: usize = 64;

/// w of rows in seconds of light, in the frame whose (u, v) are nearest to those of the rows; 0 for all of them where
/// positions, source or day are not known, or do not make the (u, v) of the data.
pub fn w_seconds<'a>(observation: &Observation, rows: impl Iterator<Item = &'a Row>) -> Vec<f64> {
    let rows: Vec<&Row> = rows.collect();
    known(observation, &rows).unwrap_or_else(|| vec![0.0; rows.len()])
}

fn known(observation: &Observation, rows: &[&Row]) -> Option<Vec<f64>> {
    let (source, mjd) = (observation.position?, observation.mjd?);
    let positions = observation.stations.iter().map(|station| station.position);
    let positions: Vec<[f64; 3]> = positions.collect::<Option<_>>()?;
    // In seconds of light.
    let uvw = |rows: &[&Row], frame| -> Option<Vec<[f64; 3]>> {
        let mut view_at = View::of_day(source, mjd, Ut1::Table, frame);
        let uvw = |row: &&Row| {
            let [first, second] = row.stations.map(|k| positions[usize::from(k)]);
            Some(view_at(row.time_h).ok()?.uvw(first, second, SPEED_OF_LIGHT))
        };
        rows.iter().map(uvw).collect()
    };
    let step = rows.len().div_ceil(TRIAL).max(1);
    let trial: Vec<&Row> = rows.iter().step_by(step).copied().collect();
    // Root mean square distance of (u, v) from those of the rows, over the root mean square of the latter.
    let miss = |frame| -> Option<(f64, Frame)> {
        let (mut distance, mut length) = (0.0, 0.0);
        for (row, [u, v, _]) in trial.iter().zip(uvw(&trial, frame)?) {
            let frequency_hz = observation.frequency_of(row)?;
            let [a, b] = row.uv.map(|x| x / frequency_hz);
            distance += (a - u).powi(2) + (b - v).powi(2);
            length += a * a + b * b;
        }
        Some(((distance / length).sqrt(), frame))
    };
    let frames = [Frame::Catalogue, Frame::OfDate].into_iter().filter_map(miss);
    let (miss, frame) = frames.min_by(|a, b| a.0.total_cmp(&b.0))?;
    let uvw = (miss < LARGEST_MISS).then(|| uvw(rows, frame))??;
    Some(uvw.into_iter().map(|[_, _, w]| w).collect())
}

#[cfg(test)]
mod tests {
    use super::super::tests::observed;
    use super::*;

    /// Hours of UTC in which some stations see the source.
    const NIGHT: [f64; 2] = [4.0, 15.5];

    /// The length of a baseline does not depend on where it is seen from.
    #[test]
    fn exact_lengths_of_baselines() {
        for frame in [Frame::Catalogue, Frame::OfDate] {
            let observation = observed(frame, NIGHT, 16);
            let w = w_seconds(&observation, observation.rows.iter());
            for (row, w) in observation.rows.iter().zip(w) {
                let [u, v] = row.uv.map(|x| x / 226_191_789_062.5);
                let [a, b] =
                    row.stations.map(|k| observation.stations[usize::from(k)].position.unwrap());
                let length = kerrlight_geodesic::vector::distance(a, b) / SPEED_OF_LIGHT;
                let found = (u * u + v * v + w * w).sqrt();
                // The square of the Earth's velocity.
                assert!((found / length - 1.0).abs() < 2e-8, "{frame:?}: {found} {length}");
            }
        }
    }

    #[test]
    fn exact_no_w_where_positions_do_not_make_the_uv() {
        let mut observation = observed(Frame::Catalogue, NIGHT, 16);
        let w = |observation: &Observation| w_seconds(observation, observation.rows.iter());
        assert!(w(&observation).iter().any(|w| w.abs() > 0.01));
        for row in &mut observation.rows {
            row.uv.swap(0, 1);
        }
        assert!(w(&observation).iter().all(|w| *w == 0.0));
        observation.mjd = None;
        assert!(w(&observation).iter().all(|w| *w == 0.0));
    }
}
