//! Measured visibilities, as a fit takes them.

use super::Result;
use crate::fit::settings::refuse;
use kerrlight_vlbi::observation::{Averaging, Flags, Observation, Row};
use std::collections::HashSet;

/// Stokes I of an observation, averaged, in order of time.
///
/// # Errors
/// If a visibility has no error, or none is left.
pub fn prepared(
    observation: Observation,
    average_s: f64,
    uv_min: Option<f64>,
) -> Result<Observation> {
    let mut observation = averaged(observation, average_s, uv_min)?.total_intensity();
    observation.sort();
    Ok(observation)
}

/// All products of an observation without baselines shorter than `uv_min` (wavelengths), averaged over this many seconds; 0
/// keeps all rows.
///
/// # Errors
/// If a visibility has no error, or none is left.
pub(super) fn averaged(
    observation: Observation,
    average_s: f64,
    uv_min: Option<f64>,
) -> Result<Observation> {
    check_errors(&observation)?;
    let observation = long_enough(observation, uv_min)?;
    Ok(match average_s > 0.0 {
        true => observation.averaged(Averaging::over(average_s)),
        false => observation.with_repeats_merged().into_owned(),
    })
}

fn long_enough(observation: Observation, uv_min: Option<f64>) -> Result<Observation> {
    let flags = Flags { shorter_than: uv_min, ..Flags::default() };
    let kept = flags.apply(&observation);
    let has_any = |data: &Observation| data.stokes_i().next().is_some();
    match uv_min {
        _ if has_any(&kept) => Ok(kept),
        Some(least) if has_any(&observation) => {
            refuse!("data.visibilities.uv_min = {least} leaves no visibilities")
        }
        _ => refuse!("there are no visibilities of Stokes I"),
    }
}

/// A visibility without an error would count for more than all others together. Products that do not
/// enter Stokes I may have any.
fn check_errors(observation: &Observation) -> Result<()> {
    let is_exact = |row: &&Row| {
        let parts = row.parts_of_i(observation.basis);
        parts.iter().flatten().any(|part| part.noise_sigma <= 0.0)
    };
    let Some(row) = observation.rows.iter().find(is_exact) else { return Ok(()) };
    let [a, b] = observation.names(row);
    refuse!("visibility of {a}-{b} at {:.6} h: sigma = 0 Jy is not allowed: above 0", row.time_h)
}

/// Times closer than this many seconds are one.
const SAME_S: f64 = 0.5;

/// Hours of the frames and the frame of every row; rows of a frame get its time, so that closure
/// quantities find each other. A frame has a row at most of each baseline and channel.
pub fn frames_of(observation: &mut Observation) -> (Vec<f64>, Vec<usize>) {
    let mut hours: Vec<f64> = Vec::new();
    let mut of_rows = Vec::with_capacity(observation.rows.len());
    let mut seen: HashSet<([u16; 2], u16)> = HashSet::new();
    for row in &mut observation.rows {
        let [a, b] = row.stations;
        let place = ([a.min(b), a.max(b)], row.channel);
        match hours.last() {
            Some(last) if (row.time_h - last) * 3600.0 < SAME_S && seen.insert(place) => {
                row.time_h = *last;
            }
            _ => {
                hours.push(row.time_h);
                seen = HashSet::from([place]);
            }
        }
        of_rows.push(hours.len() - 1);
    }
    (hours, of_rows)
}

#[cfg(test)]
mod tests {
    use super::*;
    use kerrlight_vlbi::Complex64;
    use kerrlight_vlbi::array::Station;
    use kerrlight_vlbi::observation::{Basis, Measured};
    use kerrlight_vlbi::products::{ClosureKind, ClosureSet};

    /// Three stations that see 1 Jy at these seconds, baselines a hundredth of a second apart.
    fn triangles(seconds: &[f64]) -> Observation {
        let mut observation = Observation::empty(Basis::Stokes);
        observation.stations = ["A", "B", "C"].map(Station::named).to_vec();
        let i = Measured { visibility: Complex64::new(1.0, 0.0), noise_sigma: 0.1 };
        for time in seconds {
            for (k, stations) in [[0, 1], [2, 0], [1, 2]].into_iter().enumerate() {
                let time_h = (time + 0.01 * k as f64) / 3600.0;
                observation.rows.push(Row::total_intensity(time_h, stations, [1e9, 0.0], i));
            }
        }
        observation
    }

    /// Rows within half a second are one frame only as long as no baseline is there twice: all of them close.
    #[test]
    fn exact_short_integrations_are_frames_of_their_own() {
        let seconds = [0.0, 0.3, 0.6, 0.9, 20.0];
        let mut observation = prepared(triangles(&seconds), 0.0, None).unwrap();
        let (hours, of_rows) = frames_of(&mut observation);
        assert_eq!((hours.len(), of_rows.len()), (5, 15));
        assert_eq!(ClosureSet::of(&observation, ClosureKind::Phase, 0.0).len(), 5);
    }

    /// Rows that are there twice count once, and close.
    #[test]
    fn exact_copies_of_rows_count_once() {
        let mut twice = triangles(&[0.0, 10.0]);
        twice.rows.extend(triangles(&[0.0, 10.0]).rows);
        for average_s in [0.0, 5.0] {
            let mut observation = prepared(twice.clone(), average_s, None).unwrap();
            let (hours, _) = frames_of(&mut observation);
            assert_eq!((hours.len(), observation.rows.len()), (2, 6));
            assert!(observation.rows.iter().all(|row| (row.noise_sigma[0] - 0.1).abs() < 1e-15));
            assert_eq!(ClosureSet::of(&observation, ClosureKind::Phase, 0.0).len(), 2);
        }
    }
}
