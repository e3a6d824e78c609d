//! Made-up files: what is written comes back; what is damaged is refused.

use super::super::fits::{Cards, ColumnData, binary_table, padded};
use super::*;
use crate::interferometry::Complex64;
use crate::interferometry::array::Station;
use crate::interferometry::earth::SourcePosition;
use crate::interferometry::observation::{Basis, Measured, Observation, Row};
use rand::{Rng, RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;

/// Three stations, three rows with hands missing.
pub(in crate::interferometry::files) fn small() -> Observation {
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
        ..Row::total_intensity(
            time_h,
            stations,
            [1.5e9, -2e9],
            Measured { visibility: c(0.0, 0.0), noise_sigma: 0.0 },
        )
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

fn same(a: &Row, b: &Row) -> bool {
    let relative = |x: f64, y: f64| (x - y).abs() <= 1e-7 * x.abs() || (x.is_nan() && y.is_nan());
    a.stations == b.stations
        && a.products == b.products
        && (a.time_h - b.time_h).abs() < 1e-6
        && a.noise_sigma.iter().zip(b.noise_sigma).all(|(x, y)| relative(*x, y))
        && a.uv.iter().zip(b.uv).all(|(x, y)| relative(*x, y))
        && a.opacity == b.opacity
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
    assert!(fail(|o| o.stations[1].position = None).contains("positions"));
    assert!(fail(|o| o.rows.clear()).contains("no visibilities"));
}

/// A file as others write it: axes in another order, two IFs of two channels, dates with PZERO,
/// (u, v) with PSCAL, integers with BSCALE, a subarray, a baseline of a station with itself.
fn foreign() -> Vec<u8> {
    let mut cards = Cards::default();
    cards.value("SIMPLE", "T").value("BITPIX", 16).value("NAXIS", 5).value("NAXIS1", 0);
    for (axis, length, name) in [(2, 3, "COMPLEX"), (3, 2, "IF"), (4, 2, "FREQ"), (5, 1, "STOKES")]
    {
        cards.value(&format!("NAXIS{axis}"), length).text(&format!("CTYPE{axis}"), name);
        let value = if name == "STOKES" { -2.0 } else { 1e11 };
        cards.number(&format!("CRVAL{axis}"), value).number(&format!("CDELT{axis}"), 1e8);
        cards.number(&format!("CRPIX{axis}"), 1.0);
    }
    cards.value("GROUPS", "T").value("PCOUNT", 5).value("GCOUNT", 3).number("BSCALE", 0.5);
    let parameters = [
        ("DATE", 1.0, 2_457_850.5),
        ("UU-L-SIN", 1e-4, 0.0),
        ("VV-L-SIN", 1e-4, 0.0),
        ("BASELINE", 0.01, 0.0),
        ("_DATE", 1.0 / 1024.0, 0.0),
    ];
    for (k, (name, scale, zero)) in (1..).zip(parameters) {
        cards.text(&format!("PTYPE{k}"), name);
        cards.number(&format!("PSCAL{k}"), scale).number(&format!("PZERO{k}"), zero);
    }
    cards.number("OBSRA", 266.4).number("OBSDEC", -29.0);
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
        let columns = [
            ("ANNAME", "", ColumnData::Text(8, names.map(str::to_owned).to_vec())),
            ("STABXYZ", "METERS", ColumnData::Doubles(3, vec![1.0, 2.0, 3.0, 4.0, 5.0, 6.0])),
            ("NOSTA", "", ColumnData::Integers(1, vec![1, 2])),
        ];
        let table = binary_table("AIPS AN", 2, &columns, |_| ());
        let text = String::from_utf8_lossy(&table[..2880]).into_owned();
        let version = format!("EXTVER  = {version:>20}");
        let text = text.replace(&format!("EXTVER  = {:>20}", 1), &version);
        bytes.extend(text.into_bytes());
        bytes.extend(&table[2880..]);
    }
    bytes
}

#[test]
fn exact_files_of_others() {
    let observation = read(&foreign()).unwrap();
    assert_eq!(observation.rows.len(), 1);
    assert!(observation.history.iter().any(|line| line.contains("2 groups")));
    let row = observation.rows[0];
    assert_eq!(observation.names(&row), ["B", "C"]);
    // The day of PZERO, a quarter of it in the second part.
    assert_eq!((observation.mjd, row.time_h), (Some(57850), 6.0));
    let [u, v] = row.uv;
    assert!((u - 3e-3 * 1e11).abs() < 1e-3 && (v + 4e-3 * 1e11).abs() < 1e-3, "{u} {v}");
    // LL only: the mean of 1 with weight 1 and of 2 with weight 4; the others have none.
    let ll = row.product(1).unwrap();
    assert!((ll.visibility - Complex64::new(1.8, -1.8)).norm() < 1e-12);
    assert!((ll.noise_sigma - 0.2f64.sqrt()).abs() < 1e-12 && row.product(0).is_none());
    assert_eq!(observation.bandwidth_hz, Some(4e8));
}

/// Cut anywhere, a file is an error or, where its last table ends, still a file; never a panic.
#[test]
fn exact_truncated_at_every_byte() {
    for bytes in [write(&small()).unwrap(), foreign()] {
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
