//! Writing: an IF a channel, four products, as eht-imaging, AIPS and CASA read it.

use super::super::FileError;
use super::super::fits::{Cards, ColumnData, binary_table, padded};
use super::frequencies;
use crate::Error;
use crate::interferometry::array::Station;
use crate::interferometry::earth::{SourcePosition, ut1_minus_utc};
use crate::interferometry::observation::{Basis, Channel, Observation, Row, Unknown};
use std::borrow::Cow;

const PARAMETERS: [&str; 9] =
    ["UU---SIN", "VV---SIN", "WW---SIN", "BASELINE", "DATE", "DATE", "INTTIM", "TAU1", "TAU2"];

/// What the format needs.
struct Facts {
    position: SourcePosition,
    mjd: i32,
    frequency_hz: f64,
    /// One at least.
    channels: Vec<Channel>,
    /// PSCAL of (u, v): what is stored is multiplied by it to become seconds.
    uv_scale: f64,
}

/// The bytes of a UVFITS file. Stokes I alone is written as both parallel hands, each with σ√2.
///
/// Numbers are single precision, as everyone expects: (u, v) keep 7 digits, times 3 ms.
///
/// # Errors
/// If the source's position, date, frequency, bandwidth or a station's position is not known, or
/// there are no rows, more than 255 stations, or rows of a channel that is not listed.
pub fn write(observation: &Observation) -> Result<Vec<u8>, Error> {
    let frequency_hz = observation.frequency_hz.ok_or(Unknown("the frequency"))?;
    let bandwidth_hz = observation.bandwidth_hz.ok_or(Unknown("the bandwidth"))?;
    let only = vec![Channel { frequency_hz, bandwidth_hz }];
    let several = !observation.channels.is_empty();
    let mut facts = Facts {
        position: observation
            .position
            .ok_or(Unknown("the source's right ascension and declination"))?,
        mjd: observation.mjd.ok_or(Unknown("the date (MJD)"))?,
        frequency_hz,
        channels: if several { observation.channels.clone() } else { only },
        uv_scale: 1.0,
    };
    if observation.stations.iter().any(|station| station.position.is_none()) {
        return Err(Unknown("the stations' positions (an array)").into());
    }
    if observation.stations.len() > 255 {
        let count = observation.stations.len();
        return Err(FileError::whole(format!("{count} stations: UVFITS numbers 255")).into());
    }
    let listed = observation.channels.len().max(1);
    if observation.rows.iter().any(|row| usize::from(row.channel) >= listed) {
        return Err(FileError::whole("a row of a spectral channel that is not listed").into());
    }
    let only_i = |row: &Row| row.noise_sigma[1..].iter().all(|sigma| sigma.is_nan());
    let mut observation = match observation.basis {
        Basis::Stokes if observation.rows.iter().all(only_i) => {
            Cow::Owned(observation.as_equal_hands())
        }
        _ => Cow::Borrowed(observation),
    };
    if observation.rows.is_empty() {
        return Err(FileError::whole("there are no visibilities to write").into());
    }
    let ordered = |row: &Row| row.stations[0] < row.stations[1];
    let sorted = observation.rows.is_sorted_by(|a, b| a.time_h <= b.time_h);
    if several || !sorted || !observation.rows.iter().all(ordered) {
        // The header promises order of time and baseline.
        observation.to_mut().sort();
    }
    if !several && observation.rows.iter().all(is_single_in_wavelengths) {
        facts.uv_scale = facts.frequency_hz.recip();
    }
    let groups = groups(&observation.rows);
    let mut bytes = primary_header(&observation, groups.len(), &facts);
    bytes.extend(group_bytes(&groups, &facts));
    bytes.extend(antenna_table(&observation.stations, &facts));
    bytes.extend(frequencies::table(&facts.channels, facts.frequency_hz));
    Ok(bytes)
}

/// Whether (u, v) came from single precision numbers in wavelengths, as some files have them: then
/// they are kept to the bit.
fn is_single_in_wavelengths(row: &Row) -> bool {
    row.uv.iter().all(|x| (f64::from(*x as f32) - x).abs() <= 1e-12 * x.abs())
}

fn primary_header(observation: &Observation, groups: usize, facts: &Facts) -> Vec<u8> {
    let mut cards = Cards::default();
    cards.value("SIMPLE", "T").value("BITPIX", -32).value("NAXIS", 7).value("NAXIS1", 0);
    let bands = facts.channels.len();
    for (axis, length) in [(2, 3), (3, 4), (4, 1), (5, bands), (6, 1), (7, 1)] {
        cards.value(&format!("NAXIS{axis}"), length);
    }
    cards.value("EXTEND", "T").value("GROUPS", "T").value("PCOUNT", PARAMETERS.len());
    cards.value("GCOUNT", groups);
    let (ra, dec) = (facts.position.ra_hours * 15.0, facts.position.dec_deg);
    cards.number("OBSRA", ra).number("OBSDEC", dec).text("OBJECT", &observation.source);
    cards.number("MJD", facts.mjd.into()).text("DATE-OBS", &calendar_date(facts.mjd));
    cards.number("BSCALE", 1.0).number("BZERO", 0.0).text("BUNIT", "JY").text("EQUINOX", "J2000");
    cards.text("TELESCOP", "VLBA").text("INSTRUME", "VLBA").text("OBSERVER", "EHT");
    let (first, step) = match observation.basis {
        Basis::Circular => (-1.0, -1.0),
        Basis::Stokes => (1.0, 1.0),
    };
    let axes = [
        (2, "COMPLEX", 1.0, 1.0),
        (3, "STOKES", first, step),
        (4, "FREQ", facts.frequency_hz, facts.channels[0].bandwidth_hz),
        (5, "IF", 1.0, 1.0),
        (6, "RA", ra, 1.0),
        (7, "DEC", dec, 1.0),
    ];
    for (axis, name, value, step) in axes {
        cards.text(&format!("CTYPE{axis}"), name).number(&format!("CRVAL{axis}"), value);
        cards.number(&format!("CDELT{axis}"), step).number(&format!("CRPIX{axis}"), 1.0);
        cards.number(&format!("CROTA{axis}"), 0.0);
    }
    for (k, name) in (1..).zip(PARAMETERS) {
        cards.text(&format!("PTYPE{k}"), name);
        let scale = if k <= 3 { facts.uv_scale } else { 1.0 };
        cards.number(&format!("PSCAL{k}"), scale).number(&format!("PZERO{k}"), 0.0);
    }
    cards.history("AIPS SORT ORDER='TB'");
    observation.history.iter().for_each(|line| {
        cards.history(line);
    });
    cards.finish()
}

fn calendar_date(mjd: i32) -> String {
    match sofars::cal::jd2cal(2_400_000.5, mjd.into()) {
        Ok((year, month, day, _)) => format!("{year:04}-{month:02}-{day:02}"),
        Err(_) => String::new(),
    }
}

/// Rows that belong to one group: of the same time and baseline, each of a channel of its own.
fn groups(rows: &[Row]) -> Vec<&[Row]> {
    let same = |a: &Row, b: &Row| {
        a.time_h == b.time_h && a.stations == b.stations && a.channel < b.channel
    };
    rows.chunk_by(same).collect()
}

fn group_bytes(groups: &[&[Row]], facts: &Facts) -> Vec<u8> {
    let numbers = PARAMETERS.len() + 12 * facts.channels.len();
    let mut bytes = Vec::with_capacity(4 * numbers * groups.len());
    for rows in groups {
        let row = &rows[0];
        let antennas = row.stations.map(|k| f64::from(k) + 1.0);
        let frequency_hz = facts.channels[usize::from(row.channel)].frequency_hz;
        let [u, v] = row.uv.map(|x| x / frequency_hz / facts.uv_scale);
        let baseline = 256.0 * antennas[0] + antennas[1];
        let day = 2_400_000.5 + f64::from(facts.mjd);
        let parameters = [u, v, 0.0, baseline, day, row.time_h / 24.0, row.integration_s];
        let opacity = row.opacity.map(f64::from);
        let mut data = vec![[0.0; 3]; 4 * facts.channels.len()];
        for row in *rows {
            let cells = &mut data[4 * usize::from(row.channel)..][..4];
            cells.iter_mut().enumerate().for_each(|(k, cell)| *cell = datum(row, k));
        }
        for value in parameters.into_iter().chain(opacity).chain(data.into_iter().flatten()) {
            bytes.extend((value as f32).to_be_bytes());
        }
    }
    padded(bytes, 0)
}

/// Real part, imaginary part, weight 1/σ²; all 0 where there is none.
fn datum(row: &Row, k: usize) -> [f64; 3] {
    row.product(k).map_or([0.0; 3], |m| [m.visibility.re, m.visibility.im, m.noise_sigma.powi(-2)])
}

fn antenna_table(stations: &[Station], facts: &Facts) -> Vec<u8> {
    let count = stations.len();
    let same = |letter: &str| vec![letter.to_owned(); count];
    let singles = |value: f32| ColumnData::Singles(1, vec![value; count]);
    let width = stations.iter().map(|s| s.name.len()).max().unwrap_or(0).max(8);
    let positions = stations.iter().flat_map(|s| s.position.unwrap_or_default()).collect();
    let sefd = |feed: usize| stations.iter().map(|s| s.sefd[feed]).collect();
    let columns = [
        ("ANNAME", "", ColumnData::Text(width, stations.iter().map(|s| s.name.clone()).collect())),
        ("STABXYZ", "METERS", ColumnData::Doubles(3, positions)),
        ("ORBPARM", "", ColumnData::Doubles(0, Vec::new())),
        ("NOSTA", "", ColumnData::Integers(1, (1..).take(count).collect())),
        ("MNTSTA", "", ColumnData::Integers(1, vec![0; count])),
        ("STAXOF", "METERS", singles(0.0)),
        ("POLTYA", "", ColumnData::Text(1, same("R"))),
        ("POLAA", "DEGREES", singles(0.0)),
        ("POLCALA", "", ColumnData::Singles(3, vec![0.0; 3 * count])),
        ("POLTYB", "", ColumnData::Text(1, same("L"))),
        ("POLAB", "DEGREES", singles(90.0)),
        ("POLCALB", "", ColumnData::Singles(3, vec![0.0; 3 * count])),
        ("SEFD", "", ColumnData::Doubles(1, sefd(0))),
        ("SEFDL", "", ColumnData::Doubles(1, sefd(1))),
    ];
    binary_table("AIPS AN", count, &columns, |cards| antenna_header(cards, facts))
}

fn antenna_header(cards: &mut Cards, facts: &Facts) {
    let mjd = f64::from(facts.mjd);
    let ut1_utc = ut1_minus_utc(mjd).unwrap_or(0.0);
    // Terrestrial time would change the sidereal time by less than the format keeps.
    let day = 2_400_000.5;
    let sidereal = sofars::erst::gst06a(day, mjd + ut1_utc / 86400.0, day, mjd + 69.0 / 86400.0);
    cards.number("ARRAYX", 0.0).number("ARRAYY", 0.0).number("ARRAYZ", 0.0);
    cards.text("RDATE", &calendar_date(facts.mjd)).number("GSTIA0", sidereal.to_degrees());
    cards.number("DEGPDY", 360.985_644_97).number("UT1UTC", ut1_utc).number("DATUTC", 0.0);
    cards.text("TIMESYS", "UTC").number("FREQ", facts.frequency_hz);
    cards.number("POLARX", 0.0).number("POLARY", 0.0).text("ARRNAM", "VLBA");
    cards.text("XYZHAND", "RIGHT").text("FRAME", "????").value("NUMORB", 0);
    cards.value("NO_IF", facts.channels.len());
    cards.value("NOPCAL", 0).text("POLTYPE", "VLBI").value("FREQID", 1);
}
