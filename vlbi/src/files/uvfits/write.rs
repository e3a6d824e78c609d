//! Writing: an IF a channel, four products, as eht-imaging, AIPS and CASA read it.

use super::super::fits::{Cards, padded};
use super::super::{FileError, check_numbers};
use super::{antenna_table, frequencies, w_coordinate};
use crate::Error;
use crate::earth::{MJD_ZERO, SourcePosition};
use crate::observation::{Basis, Channel, MissingMetadata, Observation, Row};
use std::borrow::Cow;

const PARAMETERS: [&str; 9] =
    ["UU---SIN", "VV---SIN", "WW---SIN", "BASELINE", "DATE", "DATE", "INTTIM", "TAU1", "TAU2"];

/// Part of a baseline that single precision does not hold.
const SAME_BASELINE: f64 = 1e-6;

/// Facts that the format needs.
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
/// there are no rows, more than 255 stations, rows of a channel that is not listed, or visibilities
/// beyond single precision.
pub fn write(observation: &Observation) -> Result<Vec<u8>, Error> {
    let frequency_hz = observation.frequency_hz.ok_or(MissingMetadata("the frequency"))?;
    let bandwidth_hz = observation.bandwidth_hz.ok_or(MissingMetadata("the bandwidth"))?;
    let only = vec![Channel { frequency_hz, bandwidth_hz }];
    let several = !observation.channels.is_empty();
    let mut facts = Facts {
        position: observation
            .position
            .ok_or(MissingMetadata("the source's right ascension and declination"))?,
        mjd: observation.mjd.ok_or(MissingMetadata("the date (MJD)"))?,
        frequency_hz,
        channels: if several { observation.channels.clone() } else { only },
        uv_scale: 1.0,
    };
    // One of several may be a spacecraft, which tables have at 0 0 0.
    if observation.stations.iter().all(|station| station.position.is_none()) {
        return Err(MissingMetadata("the stations' positions (an array)").into());
    }
    if observation.stations.len() > 255 {
        let count = observation.stations.len();
        return Err(FileError::whole(format!("{count} stations: UVFITS numbers 255")).into());
    }
    let listed = observation.channels.len().max(1);
    if observation.rows.iter().any(|row| usize::from(row.channel) >= listed) {
        return Err(FileError::whole("a row of a spectral channel that is not listed").into());
    }
    check_numbers(observation)?;
    check_precision(observation)?;
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
    // What is stored then is wavelengths, which single precision holds to the bit.
    if !several && observation.rows.iter().all(is_single_in_wavelengths) {
        facts.uv_scale = facts.frequency_hz.recip();
    }
    let groups = groups(&observation.rows, &facts);
    let w = w_coordinate::w_seconds(&observation, groups.iter().map(|rows| &rows[0]));
    let mut bytes = primary_header(&observation, groups.len(), &facts);
    bytes.extend(group_bytes(&groups, &w, &facts));
    bytes.extend(antenna_table::table(
        &observation.stations,
        facts.mjd,
        &facts.channels,
        frequency_hz,
    )?);
    bytes.extend(frequencies::table(&facts.channels, facts.frequency_hz));
    Ok(bytes)
}

/// Refuses what single precision would turn into infinity, or into no datum: a weight 1/σ² of 0.
fn check_precision(observation: &Observation) -> Result<(), FileError> {
    let fits = |value: f64| (value as f32).is_finite();
    for row in &observation.rows {
        for (k, product) in (0..4).filter_map(|k| Some((k, row.product(k)?))) {
            let [re, im, weight] = datum(row, k);
            let sigma = product.noise_sigma;
            if !(fits(re) && fits(im) && (sigma == 0.0 || fits(weight) && weight as f32 > 0.0)) {
                let [a, b] = observation.names(row);
                return Err(FileError::whole(format!(
                    "{a}-{b} at {} h: visibility {:e} Jy with sigma {sigma:e} Jy: UVFITS has single precision",
                    row.time_h, product.visibility
                )));
            }
        }
    }
    Ok(())
}

/// Returns whether (u, v) came from single precision numbers in wavelengths, as some files have
/// them: then they are kept to the bit.
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
    cards
        .number("MJD", facts.mjd.into())
        .text("DATE-OBS", &antenna_table::calendar_date(facts.mjd));
    cards.number("BSCALE", 1.0).number("BZERO", 0.0).text("BUNIT", "JY");
    // AIPS and Difmap ask for numbers; pyuvdata refuses the RADESYS of the FITS standard.
    cards.number("EQUINOX", 2000.0).number("EPOCH", 2000.0);
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

/// Rows that belong to one group: of the same time and baseline, each of a channel of its own. A group has one baseline in
/// seconds of light: means of channels that were flagged at different times have several.
fn groups<'a>(rows: &'a [Row], facts: &Facts) -> Vec<&'a [Row]> {
    let seconds = |row: &Row| {
        let frequency_hz = facts.channels[usize::from(row.channel)].frequency_hz;
        row.uv.map(|x| x / frequency_hz)
    };
    let same = |a: &Row, b: &Row| {
        let ([u, v], [other_u, other_v]) = (seconds(a), seconds(b));
        a.time_h == b.time_h
            && a.stations == b.stations
            && a.channel < b.channel
            && (u - other_u).hypot(v - other_v) <= SAME_BASELINE * u.hypot(v)
    };
    rows.chunk_by(same).collect()
}

fn group_bytes(groups: &[&[Row]], w_seconds: &[f64], facts: &Facts) -> Vec<u8> {
    let numbers = PARAMETERS.len() + 12 * facts.channels.len();
    let mut bytes = Vec::with_capacity(4 * numbers * groups.len());
    for (rows, w_seconds) in groups.iter().zip(w_seconds) {
        let row = &rows[0];
        let antennas = row.stations.map(|k| f64::from(k) + 1.0);
        let frequency_hz = facts.channels[usize::from(row.channel)].frequency_hz;
        let [u, v] = row.uv.map(|x| x / frequency_hz / facts.uv_scale);
        let baseline = 256.0 * antennas[0] + antennas[1];
        // Single precision holds a Julian date to a quarter of a day: its fraction is stored apart.
        let day = MJD_ZERO + f64::from(facts.mjd);
        let w = w_seconds / facts.uv_scale;
        let parameters = [u, v, w, baseline, day, row.time_h / 24.0, row.integration_s];
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
