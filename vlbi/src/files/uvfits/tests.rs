//! Made-up files: what is written comes back; what is damaged is refused.

use super::super::fits::{Cards, ColumnData, binary_table, padded};
use super::*;
use crate::Complex64;
use crate::array::{Station, built_in};
use crate::earth::{Frame, SourcePosition};
use crate::observation::{Averaging, Basis, Channel, Observation, Row};
use crate::schedule::tests::{SCHEDULE, SETUP};
use crate::schedule::{Schedule, Setup, observe};
use rand::{Rng, RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;

/// Three stations, three rows with hands missing.
pub(in crate::files) fn small() -> Observation {
    let mut observation = Observation {
        source: "M 1".into(),
        position: Some(SourcePosition { ra_hours: 17.76, dec_deg: -0.25 }),
        mjd: Some(57850),
        frequency_hz: Some(230e9),
        bandwidth_hz: Some(2e9),
        ..Observation::empty(Basis::Circular)
    };
    let station = |name: &str, x: f64| Station::new(name, [x, 2.5e6, -5.0e6], 90.0);
    observation.stations = vec![station("AA", 1.0e6), station("BB", 1.5e6), station("CC", 0.5)];
    observation.stations[1].sefd[1] = 100.0;
    let none = f64::NAN;
    let c = Complex64::new;
    let row = |time_h: f64, stations, products, noise_sigma| Row {
        products,
        noise_sigma,
        integration_s: 10.0,
        opacity: [0.25, 0.5],
        ..Row::empty(time_h, stations, [1.5e9, -2e9])
    };
    let zero = c(0.0, 0.0);
    observation.rows = vec![
        row(
            4.5,
            [0, 1],
            [c(1.0, 2.0), c(1.5, 2.5), c(0.5, 0.0), c(0.0, -0.5)],
            [0.5, 0.25, 1.0, 2.0],
        ),
        row(4.5, [0, 2], [c(1.0, -2.0), zero, zero, zero], [0.5, none, none, none]),
        row(6.0, [1, 2], [zero, c(3.0, 0.25), zero, zero], [none, 0.125, none, none]),
    ];
    observation
}

/// Scans of Sgr A* by the array of 2017, between two hours of UTC of MJD 57850.
pub(super) fn observed(frame: Frame, [start_h, stop_h]: [f64; 2], scans: u32) -> Observation {
    let schedule = Schedule { start_h, stop_h, scans, ..SCHEDULE };
    let setup = Setup { elevation_deg: [0.0, 90.0], frame, ..SETUP };
    observe(&built_in("EHT2017").unwrap(), SourcePosition::SGR_A, &schedule, &setup).unwrap()
}

fn same(a: &Row, b: &Row) -> bool {
    let relative = |x: f64, y: f64| (x - y).abs() <= 1e-7 * x.abs() || (x.is_nan() && y.is_nan());
    a.stations == b.stations
        && a.products == b.products
        && (a.time_h - b.time_h).abs() < 1e-6
        && a.noise_sigma.iter().zip(b.noise_sigma).all(|(x, y)| relative(*x, y))
        && a.uv.iter().zip(b.uv).all(|(x, y)| relative(*x, y))
        && a.opacity == b.opacity
        && relative(a.integration_s, b.integration_s)
}

#[test]
fn exact_round_trip() {
    let observation = small();
    let back = read(&write(&observation).unwrap()).unwrap();
    assert_eq!(back.rows.len(), 3);
    assert!(observation.rows.iter().zip(&back.rows).all(|(a, b)| same(a, b)), "{:?}", back.rows);
    assert_eq!((&back.stations, &back.source), (&observation.stations, &observation.source));
    assert_eq!((back.mjd, back.frequency_hz), (observation.mjd, observation.frequency_hz));
    assert!((back.position.unwrap().ra_hours - 17.76).abs() < 1e-14);
    // Single precision has been reached: from now on nothing changes, to the bit.
    assert_eq!(write(&back).unwrap(), write(&read(&write(&back).unwrap()).unwrap()).unwrap());
}

/// Rows in the wrong order, stations exchanged: the file has both right, errors of RL and LR too.
#[test]
fn exact_swapped_baselines() {
    let mut observation = small();
    observation.rows[0] = observation.rows[0].swapped(Basis::Circular);
    observation.rows.swap(0, 2);
    let back = read(&write(&observation).unwrap()).unwrap();
    assert!(small().rows.iter().zip(&back.rows).all(|(a, b)| same(a, b)), "{:?}", back.rows);
}

#[test]
fn exact_stokes_i_alone_is_written_as_two_hands() {
    let observation = small().total_intensity();
    let back = read(&write(&observation).unwrap()).unwrap();
    assert_eq!(back.basis, Basis::Circular);
    for ((_, a), (_, b)) in observation.stokes_i().zip(back.stokes_i()) {
        assert!((a.visibility - b.visibility).norm() < 1e-7);
        assert!((a.noise_sigma / b.noise_sigma - 1.0).abs() < 1e-7);
    }
}

#[test]
fn exact_what_is_not_known_is_asked_for() {
    let fail = |change: fn(&mut Observation)| {
        let mut observation = small();
        change(&mut observation);
        write(&observation).unwrap_err().to_string()
    };
    assert!(fail(|o| o.position = None).contains("right ascension"));
    assert!(fail(|o| o.mjd = None).contains("MJD"));
    let unknown = |o: &mut Observation| o.stations.iter_mut().for_each(|s| s.position = None);
    assert!(fail(unknown).contains("positions"));
    assert!(fail(|o| o.rows.clear()).contains("no visibilities"));
}

/// Header of random groups: axes with names, lengths, first values and steps, parameters by their names; of the cards of the
/// same name those of `own` count.
pub(super) fn random_groups(
    bits: i32,
    axes: &[(&str, usize, f64, f64)],
    parameters: &[&str],
    groups: usize,
    own: &[(&str, String)],
) -> Cards {
    let mut cards = Cards::default();
    cards.value("SIMPLE", "T").value("BITPIX", bits);
    cards.value("NAXIS", axes.len() + 1).value("NAXIS1", 0);
    for (key, value) in own {
        cards.value(key, value);
    }
    for (k, (name, length, value, step)) in (2..).zip(axes) {
        cards.value(&format!("NAXIS{k}"), length).text(&format!("CTYPE{k}"), name);
        cards.number(&format!("CRVAL{k}"), *value).number(&format!("CDELT{k}"), *step);
        cards.number(&format!("CRPIX{k}"), 1.0);
    }
    for (k, name) in (1..).zip(parameters) {
        cards.text(&format!("PTYPE{k}"), name);
    }
    cards.value("GROUPS", "T").value("PCOUNT", parameters.len()).value("GCOUNT", groups);
    cards
}

/// Table of antennas with these names.
pub(super) fn table_of_antennas(names: &[&str], more: impl FnOnce(&mut Cards)) -> Vec<u8> {
    let count = names.len();
    let columns = [
        ("ANNAME", "", ColumnData::Text(8, names.iter().map(|name| (*name).to_owned()).collect())),
        ("STABXYZ", "METERS", ColumnData::Doubles(3, (1..=3 * count).map(|x| x as f64).collect())),
        ("NOSTA", "", ColumnData::Integers(1, (1..=count as i32).collect())),
    ];
    binary_table("AIPS AN", count, &columns, more)
}

/// A table as another version of its kind.
pub(super) fn of_version(version: u32, table: &[u8]) -> Vec<u8> {
    let text = String::from_utf8_lossy(&table[..2880]).into_owned();
    let version = format!("EXTVER  = {version:>20}");
    let text = text.replace(&format!("EXTVER  = {:>20}", 1), &version);
    [text.as_bytes(), &table[2880..]].concat()
}

/// Returns axes without an `AIPS FQ` table: IFs then have no frequencies of their own; channels
/// have.
fn foreign_axes() -> &'static str {
    "no AIPS FQ table: all IFs counted at the reference frequency"
}

/// A file as others write it: axes in another order, two IFs of two channels, dates with PZERO,
/// (u, v) with PSCAL, integers with BSCALE, a subarray, a baseline of a station with itself.
fn foreign() -> Vec<u8> {
    let axes = [
        ("COMPLEX", 3, 1e11, 1e8),
        ("IF", 2, 1e11, 1e8),
        ("FREQ", 2, 1e11, 1e8),
        ("STOKES", 1, -2.0, 1e8),
    ];
    let parameters = [
        ("DATE", 1.0, 2_457_850.5),
        ("UU-L-SIN", 1e-4, 0.0),
        ("VV-L-SIN", 1e-4, 0.0),
        ("BASELINE", 0.01, 0.0),
        ("_DATE", 1.0 / 1024.0, 0.0),
    ];
    let mut cards = random_groups(16, &axes, &parameters.map(|(name, ..)| name), 3, &[]);
    for (k, (_, scale, zero)) in (1..).zip(parameters) {
        cards.number(&format!("PSCAL{k}"), scale).number(&format!("PZERO{k}"), zero);
    }
    cards.number("BSCALE", 0.5).number("OBSRA", 266.4).number("OBSDEC", -29.0);
    let mut bytes = cards.finish();
    // Values are halved by BSCALE: weights of 2 are 1, of 8 are 4.
    let group = |baseline: i16, weights: [i16; 4]| {
        let mut numbers = vec![0, 30, -40, baseline, 256];
        for (k, weight) in (1..).zip(weights) {
            numbers.extend([2 * k, -2 * k, weight]);
        }
        numbers.into_iter().flat_map(i16::to_be_bytes).collect::<Vec<u8>>()
    };
    let groups = [group(25801, [2, 8, 0, -2]), group(25700, [2; 4]), group(25800, [0; 4])];
    bytes.extend(padded(groups.concat(), 0));
    for (version, names) in [(1, ["A", "B"]), (2, ["B", "C"])] {
        bytes.extend(of_version(version, &table_of_antennas(&names, |_| ())));
    }
    bytes
}

/// A name that two antennas share would make one station of them.
#[test]
fn exact_a_name_is_of_one_antenna() {
    let mut renamed = write(&small()).unwrap();
    let find = |bytes: &[u8], from: usize, name: &[u8]| {
        from + bytes[from..].windows(name.len()).position(|window| window == name).unwrap()
    };
    let header = find(&renamed, 0, b"AIPS AN");
    let names = find(&renamed, header, b"END     ");
    let [first, second] = [b"AA", b"BB"].map(|name| find(&renamed, names, name));
    renamed.copy_within(first..first + 2, second);
    let error = read(&renamed).unwrap_err().to_string();
    assert!(error.contains("row 2: AA is the name of two antennas"), "{error}");
}

#[test]
fn exact_files_of_others() {
    let observation = read(&foreign()).unwrap();
    // Two of four channels have positive weights.
    assert_eq!(observation.rows.len(), 2);
    assert!(observation.history.iter().any(|line| line.contains("2 groups")));
    assert!(observation.history.iter().any(|line| line == foreign_axes()));
    for (row, (value, weight)) in observation.rows.iter().zip([(1.0, 1.0), (2.0, 4.0f64)]) {
        assert_eq!(observation.names(row), ["B", "C"]);
        // The day of PZERO, a quarter of it in the second part.
        assert_eq!((observation.mjd, row.time_h), (Some(57850), 6.0));
        let [u, v] = row.uv;
        assert!((u - 3e-3 * 1e11).abs() < 1e-3 && (v + 4e-3 * 1e11).abs() < 1e-3, "{u} {v}");
        let ll = row.product(1).unwrap();
        assert_eq!(ll.visibility, Complex64::new(value, -value));
        assert!((ll.noise_sigma - weight.sqrt().recip()).abs() < 1e-12 && row.product(0).is_none());
    }
    // Their mean has weight 5.
    let mean = observation.averaged_over_channels();
    let ll = mean.rows[0].product(1).unwrap();
    assert!((ll.visibility - Complex64::new(1.8, -1.8)).norm() < 1e-12 && mean.rows.len() == 1);
    assert!((ll.noise_sigma - 0.2f64.sqrt()).abs() < 1e-12 && mean.channels.is_empty());
    assert_eq!(observation.bandwidth_hz, Some(4e8));
}

/// `small` in two IFs of two channels: an IF of the upper and one of the lower sideband.
fn channels() -> Observation {
    let mut observation = small();
    let frequencies = [229.0e9, 229.5e9, 232.0e9, 231.25e9];
    let widths = [0.5e9, 0.5e9, 0.75e9, 0.75e9];
    let channel = |(frequency_hz, bandwidth_hz)| Channel { frequency_hz, bandwidth_hz };
    observation.channels = frequencies.into_iter().zip(widths).map(channel).collect();
    observation.frequency_hz = Some(229e9);
    observation.bandwidth_hz = Some(2.5e9);
    let of_row = |row: &Row| {
        let row = *row;
        (0..4).map(move |channel: u16| {
            let scale = frequencies[usize::from(channel)] / 230e9;
            Row {
                channel,
                uv: row.uv.map(|x| x * scale),
                products: row.products.map(|v| v * f64::from(channel + 1)),
                ..row
            }
        })
    };
    observation.rows = observation.rows.iter().flat_map(of_row).collect();
    // One channel of the last baseline is missing.
    observation.rows.remove(9);
    observation
}

/// Every channel keeps its own (u, v), through the file and back.
#[test]
fn exact_channels_are_rows_of_their_own() {
    let observation = channels();
    let back = read(&write(&observation).unwrap()).unwrap();
    assert_eq!(back.rows.len(), 11);
    assert!(
        observation.rows.iter().zip(&back.rows).all(|(a, b)| same(a, b) && a.channel == b.channel)
    );
    assert_eq!(back.bandwidth_hz, Some(2.5e9));
    for (a, b) in observation.channels.iter().zip(&back.channels) {
        assert!((a.frequency_hz - b.frequency_hz).abs() < 1e-3, "{a:?} {b:?}");
        assert_eq!(a.bandwidth_hz, b.bandwidth_hz);
    }
    assert_eq!(write(&back).unwrap(), write(&read(&write(&back).unwrap()).unwrap()).unwrap());
    // Averaged in time every channel stays alone; over channels (u, v) are those of the reference.
    assert_eq!(observation.averaged(Averaging::over(60.0)).rows.len(), 11);
    let mean = back.averaged_over_channels();
    assert_eq!((mean.rows.len(), mean.rows[0].uv), (3, mean.rows[1].uv));
    assert!((mean.rows[0].uv[0] / (1.5e9 * 229.0 / 230.0) - 1.0).abs() < 1e-7);
    assert!((mean.rows[0].products[0] - Complex64::new(2.5, 5.0)).norm() < 1e-12);
    assert_eq!(mean.rows[0].noise_sigma[0], 0.25);
    // The last baseline has channels 1, 3 and 4 only.
    assert!((mean.rows[2].products[1] - Complex64::new(8.0, 2.0 / 3.0)).norm() < 1e-12);
}

/// Two IFs of two channels, frequencies by the FQ table: memo 117's axes, sidebands of both kinds.
#[test]
fn exact_aips_memo_117_frequencies() {
    let mut bytes = foreign();
    let columns = [
        ("FRQSEL", "", ColumnData::Integers(1, vec![1])),
        ("IF FREQ", "HZ", ColumnData::Doubles(2, vec![0.0, 5e9])),
        ("CH WIDTH", "HZ", ColumnData::Singles(2, vec![1e8, 2e8])),
        ("SIDEBAND", "", ColumnData::Integers(2, vec![1, -1])),
    ];
    bytes.extend(binary_table("AIPS FQ", 1, &columns, |_| ()));
    let observation = read(&bytes).unwrap();
    let found: Vec<f64> = observation.channels.iter().map(|c| c.frequency_hz / 1e9).collect();
    // IF is the inner axis of that file.
    assert_eq!(found, [100.0, 105.0, 100.1, 104.8]);
    assert_eq!(observation.bandwidth_hz, Some(6e8));
    let row = observation.rows[1];
    assert_eq!(row.channel, 1);
    assert!((row.uv[0] / (3e-3 * 105e9) - 1.0).abs() < 1e-12);
    assert!(!observation.history.iter().any(|line| line == foreign_axes()));
}

/// Cut anywhere, a file is an error or, where its last table ends, still a file; never a panic.
#[test]
fn exact_truncated_at_every_byte() {
    for bytes in [write(&small()).unwrap(), write(&channels()).unwrap(), foreign()] {
        for end in 0..bytes.len() {
            if let Ok(rest) = read(&bytes[..end]) {
                assert!(end % 2880 == 0 && end > 5760 && !rest.rows.is_empty(), "{end}");
            }
        }
    }
}

/// Any bytes changed, in headers and data: an error or data, never a panic.
#[test]
fn exact_mutations_do_not_panic() {
    let mut random = Pcg64Mcg::seed_from_u64(5);
    let originals = [write(&small()).unwrap(), foreign()];
    let tokens: [&[u8]; 8] = [
        b"-1",
        b"99999999999999999999",
        b"0",
        b"1E308",
        b"NaN",
        b"T",
        b"'",
        b"-9223372036854775808",
    ];
    let mut errors = 0;
    for round in 0..20_000 {
        let mut bytes = originals[round % 2].clone();
        for _ in 0..random.random_range(1..4) {
            let at = random.random_range(0..bytes.len());
            if random.random::<bool>() {
                bytes[at] = random.random();
            } else {
                // The value of some header line.
                let at = at / 80 * 80 + 10;
                let token = tokens[random.random_range(0..tokens.len())];
                let end = (at + token.len()).min(bytes.len());
                if at < end {
                    bytes[at..end].copy_from_slice(&token[..end - at]);
                }
            }
        }
        errors += usize::from(read(&bytes).is_err());
    }
    assert!(errors > 2000, "{errors}");
    let mut noise = vec![0; 6000];
    random.fill_bytes(&mut noise);
    assert!(read(&noise).is_err() && read(&[]).is_err());
}
