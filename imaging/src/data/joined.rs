//! Data of several files as those of one static image.

use crate::Error;
use crate::settings::StrengthSettings;
use kerrlight_tomo::fit::settings::{FitError, refuse};
use kerrlight_tomo::fit::setup::{FitData, LeakageUnknown};
use kerrlight_vlbi::gains::GainPriors;
use kerrlight_vlbi::observation::{Observation, Row};
use kerrlight_vlbi::polarimetry::{SharedLeakage, feed_rotation};
use std::collections::BTreeMap;

/// Degrees within which two positions are one.
const SAME_DEG: f64 = 0.01;

/// Frequencies may differ by this part: an image changes with frequency.
const SAME_FREQUENCY: f64 = 0.05;

/// Data of several files, each with what it is called in messages, as those of one static image, in order of the hour of UTC. Frames
/// and stations of a file are its own: no gain is shared between files, and nothing closes across them. From the second
/// file on ` (2)`, ` (3)` … stand behind the names of stations. `table` is that of the strength, for messages.
///
/// # Errors
/// If there are none, files contradict each other, or there are too few frames for the strength.
pub fn joined(
    parts: Vec<(String, FitData)>,
    table: &str,
    strength: Option<&StrengthSettings>,
) -> Result<FitData, Error> {
    let mut parts = parts.into_iter();
    let Some((first, mut all)) = parts.next() else {
        refuse!("data.visibilities.path = [] is not allowed: one file or more");
    };
    all.files = vec![0; all.times.len()];
    for (file, (name, part)) in parts.enumerate() {
        join(&mut all, (&first, &name), part, file + 1)?;
    }
    in_order(&mut all);
    let instants = instants(&all.times, &all.files).last().map_or(0, |last| last + 1);
    check_folds(table, strength, instants)?;
    all.check_resolved()?;
    Ok(all)
}

fn join(all: &mut FitData, names: (&str, &str), part: FitData, file: usize) -> Result<(), Error> {
    let (Some((seen, of_rows)), Some((other, of_others))) =
        (&mut all.visibilities, part.visibilities)
    else {
        return Ok(());
    };
    if let Some(why) = contradiction(seen, &other) {
        refuse!("{} and {} cannot be one image: {why}", names.0, names.1);
    }
    if all.leakage.is_some() && seen.mjd != other.mjd {
        refuse!(
            "{} and {} are of two days: leakage is solved for within one, by which the sky turns",
            names.0,
            names.1
        );
    }
    let (stations, frames) = (seen.stations.len() as u16, all.times.len());
    seen.stations.extend(other.stations.into_iter().map(|mut station| {
        // Published rotations are looked up by the name that goes.
        station.feed_rotation = Some(feed_rotation(&station));
        station.name = format!("{} ({})", station.name, file + 1);
        station
    }));
    let own = |row: Row| Row { stations: row.stations.map(|k| k + stations), ..row };
    seen.rows.extend(other.rows.into_iter().map(own));
    of_rows.extend(of_others.into_iter().map(|frame| frame + frames));
    all.files.extend(part.times.iter().map(|_| file));
    all.times.extend(part.times);
    if let (Some(GainPriors { amplitude_sigma, .. }), Some(more)) = (&mut all.gains, part.gains) {
        amplitude_sigma.extend(more.amplitude_sigma);
    }
    if let Some(LeakageUnknown { shared, .. }) = &mut all.leakage {
        // Leakage is looked up by the number of a station among those of all files.
        *shared = SharedLeakage::none(seen.stations.len());
    }
    Ok(())
}

/// Puts frames in order of time, those of one time in the order of their files.
fn in_order(all: &mut FitData) {
    let mut order: Vec<usize> = (0..all.times.len()).collect();
    order.sort_by(|a, b| all.times[*a].total_cmp(&all.times[*b]));
    let mut place = vec![0; order.len()];
    order.iter().enumerate().for_each(|(new, old)| place[*old] = new);
    all.times = order.iter().map(|old| all.times[*old]).collect();
    all.files = order.iter().map(|old| all.files[*old]).collect();
    let Some((seen, of_rows)) = &mut all.visibilities else { return };
    let mut rows: Vec<(usize, Row)> =
        of_rows.iter().zip(&seen.rows).map(|(frame, row)| (place[*frame], *row)).collect();
    rows.sort_by_key(|(frame, _)| *frame);
    (*of_rows, seen.rows) = rows.into_iter().unzip();
}

/// Least distance of two frames of one file, hours; infinite where each has one.
pub fn cadence(times: &[f64], files: &[usize]) -> f64 {
    let mut last: BTreeMap<usize, f64> = BTreeMap::new();
    let apart = times.iter().enumerate().filter_map(|(frame, time)| {
        let file = files.get(frame).copied().unwrap_or(0);
        last.insert(file, *time).map(|before| time - before)
    });
    apart.fold(f64::INFINITY, f64::min)
}

/// The number of the instant of each frame, in order of time: bands of a night may be seconds apart, and are of one as long as
/// half of the cadence within a file is more. Files with a frame each have none: every hour is an instant.
pub fn instants(times: &[f64], files: &[usize]) -> Vec<usize> {
    let apart = Some(0.5 * cadence(times, files)).filter(|apart| apart.is_finite()).unwrap_or(0.0);
    let mut all = vec![0; times.len()];
    let mut began = times.first().copied().unwrap_or_default();
    for frame in 1..times.len() {
        let is_next = times[frame] - began > apart;
        all[frame] = all[frame - 1] + usize::from(is_next);
        began = if is_next { times[frame] } else { began };
    }
    all
}

/// Refuses more parts than half of the instants.
fn check_folds(
    table: &str,
    strength: Option<&StrengthSettings>,
    instants: usize,
) -> Result<(), Error> {
    let Some(strength) = strength.filter(|strength| instants < 2 * strength.folds) else {
        return Ok(());
    };
    let allowed = format!("{} at most, half of the frames at different times", instants / 2);
    let key = format!("{table}strength.folds");
    Err(FitError::range(key, strength.folds, &allowed).into())
}

/// The name of a station of joined data without what [`joined`] has put behind it, and which file it is of.
pub fn station_of_file(name: &str) -> (&str, usize) {
    let split = name.rsplit_once(" (").and_then(|(own, file)| {
        let file: usize = file.strip_suffix(')')?.parse().ok()?;
        Some((own, file.checked_sub(1)?))
    });
    split.unwrap_or((name, 0))
}

/// Explains why two observations are not of one image.
fn contradiction(a: &Observation, b: &Observation) -> Option<String> {
    if a.basis != b.basis {
        return Some("one has products of feeds, the other Stokes parameters".to_owned());
    }
    match (a.position, b.position) {
        (Some(here), Some(there)) => {
            // The short way round: right ascensions on both sides of 0 h are neighbours.
            let turn = (here.ra_hours - there.ra_hours + 12.0).rem_euclid(24.0) - 12.0;
            let east = 15.0 * turn * here.dec_deg.to_radians().cos();
            if east.hypot(here.dec_deg - there.dec_deg) > SAME_DEG {
                let place = |o: &Observation, at: kerrlight_vlbi::earth::SourcePosition| {
                    format!("{} at {:.4} h, {:.4}°", o.source.trim(), at.ra_hours, at.dec_deg)
                };
                return Some(format!("they observe {} and {}", place(a, here), place(b, there)));
            }
        }
        _ if !a.source.trim().eq_ignore_ascii_case(b.source.trim()) => {
            return Some(format!("they observe {} and {}", a.source.trim(), b.source.trim()));
        }
        _ => {}
    }
    let mean = |o: &Observation| {
        let all: Option<Vec<f64>> = o.rows.iter().map(|row| o.frequency_of(row)).collect();
        all.map(|all| all.iter().sum::<f64>() / all.len() as f64)
    };
    let (here, there) = match (mean(a), mean(b)) {
        (Some(here), Some(there)) => (here, there),
        (None, None) => return None,
        _ => {
            return Some(
                "the frequency of one of them is not known (`# frequency_hz: 230e9` above a table)"
                    .to_owned(),
            );
        }
    };
    ((there / here).ln().abs() > SAME_FREQUENCY)
        .then(|| format!("they are of {:.1} and {:.1} GHz", here * 1e-9, there * 1e-9))
}

#[cfg(test)]
mod tests {
    use super::*;
    use kerrlight_tomo::fit::settings::LeakageSettings;
    use kerrlight_vlbi::Complex64;
    use kerrlight_vlbi::array::Station;
    use kerrlight_vlbi::earth::SourcePosition;
    use kerrlight_vlbi::observation::{Basis, Measured as Datum};
    use kerrlight_vlbi::operator::ImageGrid;
    use kerrlight_vlbi::products::{ClosureKind, ClosureSet};

    /// Three stations at two times, with gains of this prior.
    fn file(frequency_hz: f64, position: SourcePosition, sigma: f64) -> FitData {
        let mut seen = Observation::empty(Basis::Stokes);
        seen.stations = ["A", "B", "C"].map(Station::named).to_vec();
        (seen.frequency_hz, seen.position) = (Some(frequency_hz), Some(position));
        let i = Datum { visibility: Complex64::new(1.0, 0.0), noise_sigma: 0.1 };
        for time_h in [1.0, 2.0] {
            for stations in [[0, 1], [1, 2], [0, 2]] {
                seen.rows.push(Row::total_intensity(time_h, stations, [1e9, 0.0], i));
            }
        }
        let gains = Some(GainPriors { free_phases: false, amplitude_sigma: vec![sigma; 3] });
        let sky = ImageGrid::new(8, 8, 1e-9).unwrap();
        FitData { gains, ..FitData::of_frames(sky, seen, &[], None).unwrap() }
    }

    /// Two bands of one night: as many closure phases as in both, none across, and gains of a file with its own priors.
    #[test]
    fn exact_files_share_neither_closures_nor_gains() {
        let of = |hz, sigma| file(hz, SourcePosition::M87, sigma);
        let parts = vec![("lo".to_owned(), of(227e9, 0.1)), ("hi".to_owned(), of(229e9, 0.2))];
        let all = joined(parts, "", None).unwrap();
        assert_eq!(
            (&all.times[..], &all.files[..]),
            (&[1.0, 1.0, 2.0, 2.0][..], &[0, 1, 0, 1][..])
        );
        assert_eq!(all.gains.as_ref().unwrap().amplitude_sigma, [0.1, 0.1, 0.1, 0.2, 0.2, 0.2]);
        let (seen, of_rows) = all.visibilities.as_ref().unwrap();
        assert_eq!(of_rows[..], [0, 0, 0, 1, 1, 1, 2, 2, 2, 3, 3, 3]);
        let sets = ClosureSet::of(seen, ClosureKind::Phase, 0.0);
        let closures: Vec<_> = sets.iter().flat_map(|set| &set.closures).collect();
        assert_eq!(closures.len(), 4);
        for closure in closures {
            let of = closure.legs.iter().map(|leg| {
                let name = &seen.stations[usize::from(seen.rows[leg.visibility].stations[0])].name;
                station_of_file(name).1
            });
            let of: Vec<usize> = of.collect();
            assert!(of.iter().all(|file| *file == of[0]), "{of:?}");
        }
        assert_eq!(station_of_file(&seen.stations[4].name), ("B", 1));
        // A band that is not told may be another.
        let mut unknown = of(229e9, 0.2);
        unknown.visibilities.as_mut().unwrap().0.frequency_hz = None;
        let parts = vec![("lo".to_owned(), of(227e9, 0.1)), ("hi".to_owned(), unknown)];
        let refused = joined(parts, "", None).err().unwrap().to_string();
        assert!(refused.contains("the frequency of one of them is not known"), "{refused}");
        // Four frames at two instants are too few for two parts.
        let parts = vec![("lo".to_owned(), of(227e9, 0.1)), ("hi".to_owned(), of(229e9, 0.2))];
        let strength = StrengthSettings { values: vec![1.0, 2.0], folds: 2 };
        let refused = joined(parts, "", Some(&strength)).err().unwrap().to_string();
        assert!(refused.starts_with("strength.folds = 2"), "{refused}");
        assert_eq!(station_of_file("LMT (x)"), ("LMT (x)", 0));
    }

    /// Feeds of the second file turn as published for their stations, whatever these are called beside those of the first;
    /// leakage is of one day.
    #[test]
    fn exact_feeds_of_all_files_turn_as_published() {
        let part = |name: &str, mjd| {
            let mut data = file(229e9, SourcePosition::M87, 0.1);
            let (seen, _) = data.visibilities.as_mut().unwrap();
            seen.mjd = Some(mjd);
            seen.stations = ["AA", "SM", "LM"].map(Station::named).to_vec();
            let shared = SharedLeakage::none(3);
            let settings = LeakageSettings { amplitude: 0.1, rounds: 1 };
            data.leakage = Some(LeakageUnknown { settings, shared });
            (name.to_owned(), data)
        };
        let all = joined(vec![part("a", 57849), part("b", 57849)], "", None).unwrap();
        let seen = all.visibilities.unwrap().0;
        for (here, there) in seen.stations[..3].iter().zip(&seen.stations[3..]) {
            assert_eq!(feed_rotation(here), feed_rotation(there), "{}", there.name);
        }
        let refused = joined(vec![part("a", 57849), part("b", 57850)], "", None).err().unwrap();
        assert!(refused.to_string().starts_with("a and b are of two days"), "{refused}");
    }

    #[test]
    fn exact_files_of_other_sources_and_frequencies_are_refused() {
        let m87 = || ("a".to_owned(), file(229e9, SourcePosition::M87, 0.1));
        for (other, says) in [
            (file(229e9, SourcePosition::SGR_A, 0.1), "a and b cannot be one image: they observe"),
            (file(86e9, SourcePosition::M87, 0.1), "they are of 229.0 and 86.0 GHz"),
        ] {
            let error = joined(vec![m87(), ("b".to_owned(), other)], "", None);
            let error = error.err().unwrap().to_string();
            assert!(error.contains(says), "{error}");
        }
    }
}
