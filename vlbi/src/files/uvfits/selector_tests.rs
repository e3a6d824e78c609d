//! Files whose settings are not supported are refused, with name and value.

use super::super::fits::{ColumnData, binary_table, padded};
use super::tests::{of_version, random_groups, small, table_of_antennas};
use super::*;
use crate::observation::Observation;

/// Differences of a made-up file from a plain one.
struct Made {
    /// Random parameters besides those of a baseline, with their values in both groups.
    parameters: Vec<(&'static str, [f32; 2])>,
    /// Lines of the header that replace others or are more.
    header: Vec<(&'static str, String)>,
    /// Value of PTYPE1.
    u: &'static str,
    /// (u, v) in seconds.
    seconds: f32,
    /// Weights of the groups.
    weights: [f32; 2],
    /// `TIMSYS` of the antenna table.
    time_system: &'static str,
    /// Tables.
    tables: Vec<Vec<u8>>,
}

fn plain() -> Made {
    Made {
        parameters: Vec::new(),
        header: Vec::new(),
        u: "UU---SIN",
        seconds: 1e-3,
        weights: [4.0, 4.0],
        time_system: "UTC",
        tables: Vec::new(),
    }
}

/// Two groups of LL of one baseline, at 6 h and 12 h of MJD 57850, 230 GHz.
fn bytes(made: &Made) -> Vec<u8> {
    let axes = [
        ("COMPLEX", 3, 1.0, 1e9),
        ("STOKES", 1, -2.0, 1e9),
        ("FREQ", 1, 230e9, 1e9),
        ("RA", 1, 180.0, 1e9),
        ("DEC", 1, 12.0, 1e9),
    ];
    let mut names = vec![made.u, "VV---SIN", "BASELINE", "DATE", "DATE"];
    names.extend(made.parameters.iter().map(|(name, _)| *name));
    let mut cards = random_groups(-32, &axes, &names, 2, &made.header);
    cards.text("OBJECT", "MULTI");
    let mut bytes = cards.finish();
    let mut data = Vec::new();
    for group in 0..2 {
        let hour = [0.25, 0.5][group];
        let mut numbers = vec![made.seconds, 2e-3, 258.0, 2_457_850.5, hour];
        numbers.extend(made.parameters.iter().map(|(_, values)| values[group]));
        numbers.extend([1.0, -1.0, made.weights[group]]);
        data.extend(numbers.into_iter().flat_map(f32::to_be_bytes));
    }
    bytes.extend(padded(data, 0));
    bytes.extend(table_of_antennas(&["A", "B"], |cards| {
        cards.text("TIMSYS", made.time_system);
    }));
    made.tables.iter().for_each(|table| bytes.extend(table));
    bytes
}

fn read_made(made: &Made) -> Observation {
    read(&bytes(made)).unwrap()
}

fn refused(made: &Made) -> String {
    read(&bytes(made)).unwrap_err().to_string()
}

fn sources(epoch: f64) -> Vec<u8> {
    let columns = [
        ("ID. NO.", "", ColumnData::Integers(1, vec![1, 2])),
        ("SOURCE", "", ColumnData::Text(16, vec!["M87".into(), "3C279".into()])),
        ("RAEPO", "DEGREES", ColumnData::Doubles(1, vec![187.5, 195.0])),
        ("DECEPO", "DEGREES", ColumnData::Doubles(1, vec![12.4, -5.8])),
        ("EPOCH", "YEARS", ColumnData::Doubles(1, vec![epoch; 2])),
    ];
    binary_table("AIPS SU", 2, &columns, |_| ())
}

fn setups() -> Vec<u8> {
    let columns = [
        ("FRQSEL", "", ColumnData::Integers(1, vec![1, 2])),
        ("IF FREQ", "HZ", ColumnData::Doubles(1, vec![0.0, 2e9])),
    ];
    binary_table("AIPS FQ", 2, &columns, |_| ())
}

#[test]
fn exact_several_sources_are_refused_and_one_is_named() {
    let made = |values: [f32; 2], weights: [f32; 2]| Made {
        parameters: vec![("SOURCE", values)],
        weights,
        tables: vec![sources(2000.0)],
        ..plain()
    };
    let message = refused(&made([1.0, 2.0], [4.0; 2]));
    assert!(message.contains("2 sources in one file, SOURCE = 1, 2"), "{message}");
    assert!(message.contains("1 is M87, 2 is 3C279"), "{message}");
    // The other source has no data: what is left is one, of the table.
    for (values, weights) in [([2.0, 2.0], [4.0; 2]), ([1.0, 2.0], [0.0, 4.0])] {
        let one = read_made(&made(values, weights));
        let place = one.position.unwrap();
        assert_eq!((one.source.as_str(), place.ra_hours, place.dec_deg), ("3C279", 13.0, -5.8));
    }
    let old = Made { tables: vec![sources(1950.0)], ..made([1.0; 2], [4.0; 2]) };
    assert!(refused(&old).contains("EPOCH = 1950 is not allowed"));
}

#[test]
fn exact_several_setups_are_refused_and_one_tells_the_frequency() {
    let made =
        |name, values| Made { parameters: vec![(name, values)], tables: vec![setups()], ..plain() };
    assert!(refused(&made("FREQSEL", [1.0, 2.0])).contains("2 frequency setups in one file"));
    let second = read_made(&made("FREQSEL", [2.0; 2]));
    assert_eq!(second.frequency_hz, Some(232e9));
    assert!((second.rows[0].uv[0] / (f64::from(1e-3f32) * 232e9) - 1.0).abs() < 1e-12);
    // Two rows of the table, and no one tells which.
    assert!(refused(&Made { tables: vec![setups()], ..plain() }).contains("AIPS FQ table"));
    for name in ["GATEID", "FILTER", "CORR-ID"] {
        let made = |values| Made { parameters: vec![(name, values)], ..plain() };
        assert!(refused(&made([1.0, 2.0])).contains(&format!("{name} = 1, 2")));
        assert_eq!(read_made(&made([2.0; 2])).rows.len(), 2);
    }
    // The only channel is half a width above the reference.
    let made = Made { header: vec![("CRPIX4", "0.5".into())], ..plain() };
    assert_eq!(read_made(&made).frequency_hz, Some(230.5e9));
}

#[test]
fn exact_coordinates_and_units_of_others_are_refused() {
    let with =
        |key: &'static str, value: &str| Made { header: vec![(key, value.into())], ..plain() };
    for (key, value) in [
        ("BUNIT", "'UNCALIB '"),
        ("EQUINOX", "1950.0"),
        ("EPOCH", "1950.0"),
        ("EQUINOX", "'B1950   '"),
        ("RADESYS", "'FK4     '"),
        ("CROTA5", "30.0"),
        ("TIMESYS", "'TDB     '"),
    ] {
        let message = refused(&with(key, value));
        assert!(message.contains(&format!("{key} = {value} is not allowed")), "{message}");
    }
    for (key, value) in
        [("BUNIT", "'Jy      '"), ("EQUINOX", "'J2000   '"), ("EPOCH", "2000.0"), ("CROTA5", "0.0")]
    {
        assert_eq!(read_made(&with(key, value)).rows.len(), 2, "{key}");
    }
    assert!(refused(&Made { u: "UU---NCP", ..plain() }).contains("PTYPE1 = 'UU---NCP'"));
    for (key, value) in [("CRVAL4", "1e300"), ("CRVAL4", "-1.0"), ("CDELT4", "1e30")] {
        let text = String::from_utf8(bytes(&plain())[..2880].to_vec()).unwrap();
        let at = text.find(&format!("{key:<8}=")).unwrap();
        let mut file = bytes(&plain());
        file[at..at + 80].copy_from_slice(format!("{key:<8}= {value:>20}{:50}", "").as_bytes());
        let message = read(&file).unwrap_err().to_string();
        assert!(message.contains(&format!("{key} = {value} is not allowed")), "{message}");
    }
    assert!(refused(&with("PSCAL1", "0.0")).contains("PSCAL1 = 0.0 is not allowed"));
    // Wavelengths where seconds belong.
    assert!(refused(&Made { seconds: 1e9, ..plain() }).contains("up to 10000 s"));
    let gains =
        binary_table("AIPS SN", 1, &[("SOURCE", "", ColumnData::Integers(1, vec![1]))], |_| ());
    let history = read_made(&Made { tables: vec![gains], ..plain() }).history;
    assert_eq!(history, ["AIPS SN: calibration that is not applied"]);
}

/// Parameters of one name are parts of a sum; what nobody writes in parts is refused.
#[test]
fn exact_parts_of_u_and_v_are_added() {
    let parts = [("UU---SIN", [0.5e-3; 2]), ("_VV", [-1e-4, 1e-4])];
    let made = read_made(&Made { parameters: parts.to_vec(), ..plain() });
    for (row, v) in made.rows.iter().zip([1.9e-3, 2.1e-3]) {
        let seconds = row.uv.map(|x| x / 230e9);
        assert!((seconds[0] - 1.5e-3).abs() < 1e-9 && (seconds[1] - v).abs() < 1e-9, "{seconds:?}");
    }
    let twice = Made { parameters: vec![("BASELINE", [258.0; 2])], ..plain() };
    assert!(refused(&twice).contains("PTYPE6 = 'BASELINE' is not allowed"), "{}", refused(&twice));
}

/// The width of the only channel is that of the `AIPS FQ` table, as that of several is.
#[test]
fn exact_bandwidth_of_one_channel_is_of_the_table() {
    let table = |width: f32| {
        let columns = [
            ("FRQSEL", "", ColumnData::Integers(1, vec![1])),
            ("IF FREQ", "HZ", ColumnData::Doubles(1, vec![0.0])),
            ("CH WIDTH", "HZ", ColumnData::Singles(1, vec![width])),
        ];
        binary_table("AIPS FQ", 1, &columns, |_| ())
    };
    let bandwidth = |width| read_made(&Made { tables: vec![table(width)], ..plain() }).bandwidth_hz;
    assert_eq!(bandwidth(2e9), Some(2e9));
    assert_eq!((bandwidth(0.0), read_made(&plain()).bandwidth_hz), (Some(1e9), Some(1e9)));
}

/// With a centre of the array, x of antennas lies in its meridian.
#[test]
fn exact_antennas_about_a_centre_are_turned_to_its_meridian() {
    let table = binary_table(
        "AIPS AN",
        1,
        &[
            ("ANNAME", "", ColumnData::Text(8, vec!["E,B #1".into()])),
            ("STABXYZ", "METERS", ColumnData::Doubles(3, vec![100.0, 20.0, 3.0])),
            ("NOSTA", "", ColumnData::Integers(1, vec![9])),
        ],
        |cards| {
            cards.number("ARRAYX", 0.0).number("ARRAYY", -5e6).number("ARRAYZ", 4e6);
        },
    );
    let made = read_made(&Made { tables: vec![of_version(2, &table)], ..plain() });
    let station = made.stations.last().unwrap();
    // The centre is at 90° west: x points to the south of the axes, y to the east, along x of the Earth.
    let place = station.position.unwrap();
    for (is, expected) in place.into_iter().zip([20.0, -5e6 - 100.0, 4e6 + 3.0]) {
        assert!((is - expected).abs() < 1e-6, "{place:?}");
    }
    // Nothing in a name separates columns of texts.
    assert_eq!(station.name, "E_B_1");
}

/// Positions in kilometres, scaled columns, products and integrations that cannot be.
#[test]
fn exact_cards_of_tables_are_honoured_or_refused() {
    let place = ("RAEPO", "DEGREES", ColumnData::Doubles(1, vec![187.5]));
    let columns = [
        ("ID. NO.", "", ColumnData::Integers(1, vec![1])),
        place,
        ("DECEPO", "DEGREES", ColumnData::Doubles(1, vec![12.4])),
    ];
    let table = binary_table("AIPS SU", 1, &columns, |cards| {
        cards.number("TSCAL2", 0.5).number("TZERO2", 15.0);
    });
    let scaled = Made { parameters: vec![("SOURCE", [1.0; 2])], tables: vec![table], ..plain() };
    assert_eq!(read_made(&scaled).position.unwrap().ra_hours, (0.5 * 187.5 + 15.0) / 15.0);
    let replaced = |mut file: Vec<u8>, from: &str, to: &str| {
        let at = file.windows(from.len()).position(|part| part == from.as_bytes()).unwrap();
        file[at..at + to.len()].copy_from_slice(to.as_bytes());
        read(&file).unwrap_err().to_string()
    };
    let message = replaced(bytes(&plain()), "'METERS  '", "'KM      '");
    assert!(message.contains("TUNIT2 = 'KM      ' is not allowed"), "{message}");
    let message = replaced(write(&small()).unwrap(), "CDELT3  = ", "CDELT3  =  0 /");
    assert!(message.contains("each product once"), "{message}");
    let long = Made { parameters: vec![("INTTIM", [1.0, 1e30])], ..plain() };
    assert!(refused(&long).contains("s is not allowed: up to 1e9 s"), "{}", refused(&long));
    let mut km = small();
    km.stations[0].position = Some([0.0, 0.0, -6359.61]);
    let message = read(&write(&km).unwrap()).unwrap_err().to_string();
    assert!(message.contains("kilometres?"), "{message}");
}

/// TAI was 37 s ahead of UTC in 2017 (IERS Bulletin C 52).
#[test]
fn paper_times_of_tai_become_utc() {
    for system in ["IAT", "TAI"] {
        let hours = read_made(&Made { time_system: system, ..plain() }).rows[0].time_h;
        assert!((hours - (6.0 - 37.0 / 3600.0)).abs() < 1e-9, "{hours}");
    }
    assert_eq!(read_made(&plain()).rows[0].time_h, 6.0);
    assert!(refused(&Made { time_system: "GPS", ..plain() }).contains("TIMSYS = 'GPS"));
    let second = table_of_antennas(&["A", "B"], |cards| {
        cards.text("TIMSYS", "UTC");
    });
    let mixed = Made { time_system: "TAI", tables: vec![of_version(2, &second)], ..plain() };
    assert!(refused(&mixed).contains("that of the AIPS AN table before"), "{}", refused(&mixed));
}

/// The pointing of antennas is not the position that (u, v) belong to.
#[test]
fn exact_the_phase_centre_is_the_position() {
    let made = |ra: &str, dec: &str| Made {
        header: vec![("OBSRA", ra.into()), ("OBSDEC", dec.into())],
        ..plain()
    };
    for (ra, dec) in [("181.0", "12.0"), ("180.0", "12.0")] {
        let place = read_made(&made(ra, dec)).position.unwrap();
        assert_eq!((place.ra_hours, place.dec_deg), (12.0, 12.0));
    }
}
