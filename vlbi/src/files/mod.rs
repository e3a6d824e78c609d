//! Files of visibilities (UVFITS, eht-imaging's text, tables of total intensity) and FITS images. Codecs work
//! on bytes; what they hold in memory is a small multiple of the file.

mod comments;
mod eht_table;
mod fits;
mod fits_axes;
mod fits_image;
mod gains;
pub mod images;
mod leakage;
mod light_curve;
mod obs_text;
mod table;
mod text_image;
mod uvfits;

pub use comments::write as observation_comments;
pub use eht_table::{EhtTable, to_eht_table};
pub use fits_image::{read as read_fits_image, write as write_fits_image};
pub use gains::{COLUMNS as GAIN_COLUMNS, parse as parse_gains, to_csv as gains_to_csv};
pub use leakage::{parse as parse_leakage, to_csv as leakage_to_csv};
pub use light_curve::{
    is_light_curve, parse as parse_light_curve, parse_times, to_csv as light_curve_to_csv,
};
pub use obs_text::{parse as parse_obs_text, to_text as to_obs_text};
pub use table::{COLUMNS as TABLE_COLUMNS, parse as parse_table, to_csv};
pub use text_image::{is_text_image, parse as parse_text_image};
pub use uvfits::{read as read_uvfits, write as write_uvfits};

use super::array::{self, MOST_STATIONS, Station};
use super::earth::SourcePosition;
use super::observation::Observation;
use crate::Error;
use std::collections::HashMap;

/// Reason why a file cannot be read, or data not be written.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum FileError {
    /// An error at a line of a text.
    #[error("line {line}: {message}")]
    Line {
        /// Counted from 1.
        line: usize,
        /// Reason for the refusal.
        message: String,
    },
    /// An error at a byte of a binary file.
    #[error("byte {offset}: {message}")]
    Byte {
        /// Counted from 0.
        offset: usize,
        /// Reason for the refusal.
        message: String,
    },
    /// An error of the file as a whole.
    #[error("{0}")]
    Whole(String),
}

impl FileError {
    /// Refusal of the file as a whole.
    pub fn whole(message: impl Into<String>) -> Self {
        FileError::Whole(message.into())
    }

    fn line(line: usize, message: impl Into<String>) -> Self {
        FileError::Line { line, message: message.into() }
    }

    fn byte(offset: usize, message: impl Into<String>) -> Self {
        FileError::Byte { offset, message: message.into() }
    }
}

/// Reads an observation from a file in any of the formats, told apart by how it begins: UVFITS, eht-imaging text, or a
/// table of visibilities (kerrlight's CSV, the EHT's public csv and txt); with the name of the format.
///
/// # Errors
/// If it begins like none of them, or is damaged.
pub fn decode(bytes: &[u8]) -> Result<(&'static str, Observation), Error> {
    if bytes.starts_with(b"SIMPLE  =") {
        return Ok(("UVFITS", read_uvfits(bytes)?));
    }
    let text = core::str::from_utf8(bytes).map_err(|error| {
        FileError::byte(error.valid_up_to(), "neither UVFITS nor a text of visibilities")
    })?;
    let text = without_mark(text);
    if obs_text::is_obs_text(text) {
        return Ok(("eht-imaging text", parse_obs_text(text)?));
    }
    Ok(("table of visibilities", parse_table(text)?))
}

/// Refuses to write what is no number, and names it.
fn check_numbers(observation: &Observation) -> Result<(), FileError> {
    for row in &observation.rows {
        let [a, b] = observation.names(row);
        let refuse = |what: &str, value: String| {
            let message =
                format!("{what} of {a}-{b} at {} h = {value} is not a finite number", row.time_h);
            Err(FileError::whole(message))
        };
        if !(row.time_h.is_finite() && row.uv.iter().all(|x| x.is_finite())) {
            return refuse("(u, v)", format!("{:?}", row.uv));
        }
        for product in (0..4).filter_map(|k| row.product(k)) {
            if !product.visibility.is_finite() {
                return refuse("the visibility", product.visibility.to_string());
            }
            if !product.noise_sigma.is_finite() {
                return refuse("sigma", product.noise_sigma.to_string());
            }
        }
    }
    Ok(())
}

/// The cells of a line: between commas, or between blanks where there is none; 64 at most, no known writer has more.
fn cells(line: &str) -> Vec<&str> {
    match line.contains(',') {
        true => between(',', line),
        false => line.split_whitespace().take(64).collect(),
    }
}

/// The cells between separators, without blanks and quotation marks around them.
fn between<'a>(separator: char, line: &'a str) -> Vec<&'a str> {
    let unquoted = |cell: &'a str| {
        let cell = cell.trim();
        cell.strip_prefix('"').and_then(|cell| cell.strip_suffix('"')).unwrap_or(cell)
    };
    line.split(separator).map(unquoted).take(64).collect()
}

/// Returns whether single tabs stand between the names of columns: cells of the lines below may then be empty.
fn has_tabs(line: &str, names: usize) -> bool {
    !line.contains(',') && names > 1 && line.trim().split('\t').count() == names
}

/// The cells of a line below a heading of `names`.
///
/// # Errors
/// If blanks separate cells and some are missing: it is not known which.
fn cells_below(line: &str, names: usize, tabs: bool) -> Result<Vec<&str>, String> {
    if tabs && !line.contains(',') && line.contains('\t') {
        let mut cells = between('\t', line);
        // Tabs at the ends of a line stand beside no column.
        while cells.len() > names && cells.last() == Some(&"") {
            cells.pop();
        }
        if cells.len() > names && cells.first() == Some(&"") {
            cells.remove(0);
        }
        return Ok(cells);
    }
    let cells = cells(line);
    if cells.len() < names && !line.contains(',') {
        return Err(format!("{} columns, but {names} names", cells.len()));
    }
    Ok(cells)
}

/// Counts hours on where they begin anew at midnight: they fall once, by more than half a day, and those after midnight come
/// before all others on a clock. Tables of several telescopes, one after the other, are none of these.
fn over_midnight<T>(rows: &mut [T], hour: impl Fn(&mut T) -> &mut f64) {
    let hours: Vec<f64> = rows.iter_mut().map(|row| *hour(row)).collect();
    let falls: Vec<usize> = (1..hours.len()).filter(|k| hours[*k] < hours[k - 1]).collect();
    let [midnight] = falls[..] else { return };
    if hours[midnight - 1] - hours[midnight] > 12.0 && hours[hours.len() - 1] < hours[0] {
        rows[midnight..].iter_mut().for_each(|row| *hour(row) += 24.0);
    }
}

/// A text without the byte order mark that spreadsheets and editors of Windows put before it.
pub(crate) fn without_mark(text: &str) -> &str {
    text.strip_prefix('\u{feff}').unwrap_or(text)
}

/// Refuses several spectral channels, for which a format has no column.
fn one_channel(observation: &Observation) -> Result<(), FileError> {
    match observation.channels.len() {
        0 | 1 => Ok(()),
        n => Err(FileError::whole(format!(
            "this format has no column for {n} spectral channels: average them first"
        ))),
    }
}

/// Numbers for station names, in order of appearance.
struct Names {
    stations: Vec<Station>,
    numbers: HashMap<String, u16>,
}

impl Names {
    fn new(stations: Vec<Station>) -> Self {
        let numbers = stations.iter().zip(0..).map(|(s, k)| (s.name.clone(), k)).collect();
        Names { stations, numbers }
    }

    fn known(&self, name: &str) -> Option<u16> {
        self.numbers.get(name).copied()
    }

    /// The number of a name, a new one if need be.
    fn number(&mut self, name: &str) -> Result<u16, String> {
        if let Some(number) = self.known(name) {
            return Ok(number);
        }
        if self.stations.len() >= MOST_STATIONS {
            return Err(format!("more than {MOST_STATIONS} stations"));
        }
        // Fewer than 2^16.
        let number = self.stations.len() as u16;
        self.stations.push(Station::named(name));
        self.numbers.insert(name.to_owned(), number);
        Ok(number)
    }

    /// Adds a station in the columns of eht-imaging.
    fn add(&mut self, columns: &[&str]) -> Result<(), String> {
        let station = array::station(columns)?;
        if self.known(&station.name).is_some() {
            return Err(format!("station {} is listed twice", station.name));
        }
        let k = usize::from(self.number(&station.name)?);
        self.stations[k] = station;
        Ok(())
    }
}

/// Sets right ascension (hours) or declination (degrees) of the source; the other one stays, and is NaN before it is known:
/// [`check_located`] refuses that.
fn locate(
    observation: &mut Observation,
    ra_hours: Option<f64>,
    dec_deg: Option<f64>,
) -> Result<(), String> {
    SourcePosition::new(ra_hours.unwrap_or(0.0), dec_deg.unwrap_or(0.0))
        .map_err(|error| error.to_string())?;
    let unknown = SourcePosition { ra_hours: f64::NAN, dec_deg: f64::NAN };
    let SourcePosition { ra_hours: ra, dec_deg: dec } = observation.position.unwrap_or(unknown);
    let (ra_hours, dec_deg) = (ra_hours.unwrap_or(ra), dec_deg.unwrap_or(dec));
    observation.position = Some(SourcePosition { ra_hours, dec_deg });
    Ok(())
}

/// Refuses half of a position.
fn check_located(observation: &Observation) -> Result<(), FileError> {
    let is_half = |p: SourcePosition| p.ra_hours.is_nan() || p.dec_deg.is_nan();
    match observation.position.is_some_and(is_half) {
        true => Err(FileError::whole("one of right ascension and declination is missing")),
        false => Ok(()),
    }
}

/// Returns the largest number of rows that a text may hold: as many as lines, which are 16 bytes at least.
fn rows_at_most(text: &str) -> usize {
    text.lines().count().min(text.len() / 16)
}

/// A finite number, or what to call it in a complaint.
fn number(cell: &str, name: &str) -> Result<f64, String> {
    let value =
        cell.parse().map_err(|_| format!("{name} `{}` is not a number", shortened(cell)))?;
    if f64::is_finite(value) { Ok(value) } else { Err(format!("{name} = {value} is not finite")) }
}

/// Hours from the day of an observation, or wavelengths of a baseline: what no telescope has is no typing error of a
/// digit, and would leave single precision.
fn number_within(cell: &str, name: &str, most: f64) -> Result<f64, String> {
    match number(cell, name)? {
        value if value.abs() <= most => Ok(value),
        value => Err(format!("{name} = {value:e} is not allowed: [-{most:e}, {most:e}]")),
    }
}

/// Hours from the day of an observation: a century and more.
const MOST_HOURS: f64 = 1e6;

/// Wavelengths of 1 µm between here and the Moon, a hundredfold.
const MOST_WAVELENGTHS: f64 = 1e17;

/// A standard deviation: not negative; NaN where there is none.
fn sigma(cell: &str, name: &str) -> Result<f64, String> {
    let value =
        cell.parse().map_err(|_| format!("{name} `{}` is not a number", shortened(cell)))?;
    if value < 0.0 || f64::is_infinite(value) {
        return Err(format!("{name} = {value} Jy is not allowed: 0 or positive, or nan for none"));
    }
    Ok(value)
}

/// Returns at most 20 characters of a cell.
fn shortened(cell: &str) -> String {
    cell.chars().take(20).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_pcg::Pcg64Mcg;

    fn texts() -> Vec<String> {
        let small = uvfits::tests::small();
        let csv = to_csv(&small, true).unwrap();
        vec![to_obs_text(&small).unwrap(), csv, eht_table::tests::CSV.to_owned()]
    }

    #[test]
    fn exact_formats_are_told_apart() {
        let format = |bytes: &[u8]| decode(bytes).unwrap().0;
        let [obs, csv, eht] = &texts()[..] else { unreachable!("three texts") };
        assert_eq!(format(obs.as_bytes()), "eht-imaging text");
        assert_eq!([csv, eht].map(|text| format(text.as_bytes())), ["table of visibilities"; 2]);
        for text in [obs, csv, eht] {
            let marked = format!("\u{feff}{text}");
            let all = |text: &str| format!("{:?}", decode(text.as_bytes()).unwrap());
            assert_eq!(all(&marked), all(text));
        }
        let uvfits = write_uvfits(&uvfits::tests::small()).unwrap();
        assert_eq!(format(&uvfits), "UVFITS");
        let message = decode(&[0x89, b'P', b'N', b'G', 0xff]).unwrap_err().to_string();
        assert!(message.contains("neither UVFITS"), "{message}");
    }

    /// No format holds what is no number, or what its digits cannot tell from nothing.
    #[test]
    fn exact_numbers_that_are_none_are_not_written() {
        let written = |value: f64, sigma: f64| {
            let mut observation = uvfits::tests::small();
            observation.rows[1].products[0].re = value;
            observation.rows[1].noise_sigma[0] = sigma;
            let texts = [
                to_csv(&observation, false),
                to_obs_text(&observation),
                to_eht_table(&observation, EhtTable::Csv),
            ];
            let texts = texts.into_iter().map(|text| text.map(String::into_bytes));
            let all = texts.chain([write_uvfits(&observation)]);
            all.map(|bytes| bytes.err().map(|error| error.to_string())).collect::<Vec<_>>()
        };
        for (value, sigma) in [(f64::NAN, 0.1), (f64::INFINITY, 0.1), (1.0, f64::INFINITY)] {
            for message in written(value, sigma) {
                let message = message.expect("it is no number");
                assert!(message.contains("not a finite number"), "{message}");
            }
        }
        let tiny = written(1.0, 1e-300);
        assert!(tiny[0].is_none() && tiny[1].is_none(), "{tiny:?}");
        assert!(tiny[2].as_ref().unwrap().contains("8 decimals"), "{tiny:?}");
        assert!(tiny[3].as_ref().unwrap().contains("single precision"), "{tiny:?}");
        let huge = written(1.0, 1e300);
        assert!(huge[..3].iter().all(Option::is_none), "{huge:?}");
        assert!(huge[3].as_ref().unwrap().contains("single precision"), "{huge:?}");
        assert!(written(1e39, 0.1)[3].as_ref().unwrap().contains("single precision"));
    }

    /// Cut anywhere, or with bytes changed, a text is an error or data, never a panic.
    #[test]
    fn exact_damaged_texts_do_not_panic() {
        let mut random = Pcg64Mcg::seed_from_u64(6);
        for text in texts() {
            assert!(decode(text.as_bytes()).is_ok());
            for end in 0..text.len() {
                let _ = decode(&text.as_bytes()[..end]);
            }
            let mut errors = 0;
            for _ in 0..10_000 {
                let mut bytes = text.clone().into_bytes();
                for _ in 0..random.random_range(1..4) {
                    let at = random.random_range(0..bytes.len());
                    let characters = b"0-.,e# \n\tx9";
                    bytes[at] = characters[random.random_range(0..characters.len())];
                }
                errors += usize::from(decode(&bytes).is_err());
            }
            assert!(errors > 500, "{errors}");
        }
    }
}
