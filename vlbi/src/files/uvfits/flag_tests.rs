//! Flags: what each column of a row leaves of a file.

use super::super::fits::{ColumnData, binary_table, padded};
use super::read;
use super::tests::{random_groups, table_of_antennas};

/// A row of the table: ANTS, TIME RANGE, IFS, CHANS, PFLAGS, SOURCE.
#[derive(Clone)]
struct Row {
    antennas: [i32; 2],
    days: [f32; 2],
    bands: [i32; 2],
    channels: [i32; 2],
    products: u8,
    source: i32,
}

const ALL: Row = Row {
    antennas: [0; 2],
    days: [0.0, 2.0],
    bands: [0; 2],
    channels: [0; 2],
    products: 0b1111_0000,
    source: 0,
};

fn table(rows: &[Row], version: u8) -> Vec<u8> {
    let pairs = |of: fn(&Row) -> [i32; 2]| rows.iter().flat_map(of).collect();
    let columns = [
        ("SOURCE", "", ColumnData::Integers(1, rows.iter().map(|row| row.source).collect())),
        ("SUBARRAY", "", ColumnData::Integers(1, vec![0; rows.len()])),
        ("ANTS", "", ColumnData::Integers(2, pairs(|row| row.antennas))),
        ("TIME RANGE", "DAYS", ColumnData::Singles(2, rows.iter().flat_map(|r| r.days).collect())),
        ("IFS", "", ColumnData::Integers(2, pairs(|row| row.bands))),
        ("CHANS", "", ColumnData::Integers(2, pairs(|row| row.channels))),
        ("PFLAGS", "", ColumnData::Bits(4, rows.iter().map(|row| row.products).collect())),
    ];
    let table = binary_table("AIPS FG", rows.len(), &columns, |_| ());
    let text = String::from_utf8(table[..2880].to_vec()).unwrap();
    let first = "EXTVER  =                    1";
    assert!(text.contains(first));
    let text = text.replace(first, &format!("EXTVER  =                    {version}"));
    [text.as_bytes(), &table[2880..]].concat()
}

/// Baselines 1-2, 1-3 and 2-3 at 6 h and 12 h of 2017 April 7, of RR and LL in two channels of two IFs; the value of each
/// datum is its number.
fn bytes(tables: &[Vec<u8>], date: &str) -> Vec<u8> {
    let axes = [
        ("COMPLEX", 3, 1.0, 1.0),
        ("STOKES", 2, -1.0, -1.0),
        ("FREQ", 2, 230e9, 1e9),
        ("IF", 2, 1.0, 1.0),
        ("RA", 1, 180.0, 1.0),
        ("DEC", 1, 12.0, 1.0),
    ];
    let parameters = ["UU---SIN", "VV---SIN", "BASELINE", "DATE", "DATE", "SOURCE"];
    let mut cards = random_groups(-32, &axes, &parameters, 6, &[]);
    cards.text("OBJECT", "M87").text("DATE-OBS", date);
    let mut bytes = cards.finish();
    let mut numbers: Vec<f32> = Vec::new();
    for group in 0..6 {
        let baseline = [258.0, 259.0, 515.0][group % 3];
        let hour = [0.25, 0.5][group / 3];
        numbers.extend([1e-3, 2e-3, baseline, 2_457_850.5, hour, 1.0]);
        numbers.extend((0..8).flat_map(|k| [(8 * group + k) as f32, 0.0, 1.0]));
    }
    bytes.extend(padded(numbers.into_iter().flat_map(f32::to_be_bytes).collect(), 0));
    bytes.extend(table_of_antennas(&["A", "B", "C"], |_| ()));
    let columns = [
        ("FRQSEL", "", ColumnData::Integers(1, vec![1])),
        ("IF FREQ", "HZ", ColumnData::Doubles(2, vec![0.0, 2e9])),
        ("CH WIDTH", "HZ", ColumnData::Singles(2, vec![1e9; 2])),
    ];
    bytes.extend(binary_table("AIPS FQ", 1, &columns, |_| ()));
    tables.iter().for_each(|table| bytes.extend(table));
    bytes
}

/// The numbers of the data that are left.
fn left(tables: &[Vec<u8>]) -> Vec<usize> {
    let rows = read(&bytes(tables, "2017-04-07")).unwrap().rows;
    let data = rows.iter().flat_map(|row| row.products.iter().zip(row.noise_sigma));
    let mut numbers: Vec<usize> =
        data.filter(|(_, sigma)| !sigma.is_nan()).map(|(value, _)| value.re as usize).collect();
    numbers.sort_unstable();
    numbers
}

/// Tests a datum by its number: product, channel, IF, baseline and hour.
#[test]
fn exact_flags_leave_out_what_they_name() {
    let kept = |is_flagged: fn([usize; 5]) -> bool| {
        let parts = |k: usize| [k % 2, k / 2 % 2, k / 4 % 2, k / 8 % 3, k / 24];
        (0..48).filter(|k| !is_flagged(parts(*k))).collect::<Vec<_>>()
    };
    assert_eq!(left(&[]), kept(|_| false));
    let one = |row: Row| left(&[table(&[row], 1)]);
    // Antenna 2 is in baselines 1-2 and 2-3.
    assert_eq!(one(Row { antennas: [2, 0], ..ALL }), kept(|[.., b, _]| b != 1));
    assert_eq!(one(Row { antennas: [3, 1], ..ALL }), kept(|[.., b, _]| b == 1));
    assert_eq!(one(Row { days: [0.2, 0.3], ..ALL }), kept(|[.., hour]| hour == 0));
    assert_eq!(one(Row { days: [0.5, 0.5], ..ALL }), kept(|[.., hour]| hour == 1));
    assert_eq!(one(Row { days: [1.2, 1.3], ..ALL }), kept(|_| false));
    assert_eq!(one(Row { bands: [2, 2], ..ALL }), kept(|[_, _, band, ..]| band == 1));
    assert_eq!(one(Row { channels: [1, 1], ..ALL }), kept(|[_, channel, ..]| channel == 0));
    assert_eq!(one(Row { products: 0b0100_0000, ..ALL }), kept(|[product, ..]| product == 1));
    assert_eq!(one(Row { source: 2, ..ALL }), kept(|_| false));
    let both = Row { antennas: [1, 0], channels: [2, 0], source: 1, ..ALL };
    assert_eq!(one(both), kept(|[_, channel, _, b, _]| channel == 1 && b != 2));
    let rows = [Row { bands: [1, 1], ..ALL }, Row { products: 0b1000_0000, ..ALL }];
    assert_eq!(left(&[table(&rows, 1)]), kept(|[p, _, band, ..]| band == 0 || p == 0));
    // The table of the highest version counts.
    let versions = [table(&[Row { bands: [1, 1], ..ALL }], 2), table(&[ALL], 1)];
    assert_eq!(left(&versions), kept(|[_, _, band, ..]| band == 0));
}

#[test]
fn exact_flags_are_told() {
    let flags = [table(&[Row { bands: [1, 1], ..ALL }], 1)];
    for date in ["2017-04-07T00:00:00.0", "2017-04-07"] {
        let read = read(&bytes(&flags, date)).unwrap();
        assert_eq!(read.history, ["flags of AIPS FG applied: 1"]);
    }
    let error = read(&bytes(&flags, "")).unwrap_err().to_string();
    assert!(error.contains("DATE-OBS") && error.contains("AIPS FG"), "{error}");
    let error = read(&bytes(&[table(&[ALL], 1)], "2017-04-07")).unwrap_err().to_string();
    assert!(error.contains("none with valid data"), "{error}");
}
