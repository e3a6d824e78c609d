//! Reading.

use super::super::FileError;
use super::super::fits;
use super::antennas::AntennaTables;
use super::layout::{Antennas, Layout};
use crate::interferometry::Complex64;
use crate::interferometry::earth::SourcePosition;
use crate::interferometry::observation::{Observation, Row};

/// JD of MJD 0.
const MJD_ZERO: f64 = 2_400_000.5;

/// Reads UVFITS.
///
/// Spectral channels of all IFs are averaged, weighted by 1/σ²; (u, v) are counted in wavelengths
/// of the antenna table's frequency (both as eht-imaging does). σ = 1/√weight; a weight that is
/// not positive, or a visibility that is no number, means no datum. Rows without any datum, and
/// correlations of a station with itself, are left out; the history says how many.
///
/// # Errors
/// If the file is damaged, no UVFITS, or holds no datum.
pub fn read(bytes: &[u8]) -> Result<Observation, FileError> {
    let units = fits::units(bytes)?;
    let header = &units[0].header;
    let layout = Layout::new(header)?;
    let tables = AntennaTables::read(&units)?;
    let frequency_hz = tables.frequency_hz.unwrap_or(layout.frequency_hz);
    if !(1e6..=1e15).contains(&frequency_hz) {
        return Err(header.error("CRVAL4", "no frequency in [1e6, 1e15] Hz in AN table or header"));
    }
    let reader = Reader { layout: &layout, tables: &tables, frequency_hz, offset: units[0].offset };
    let (mjd, rows, left_out) = reader.rows(units[0].data)?;
    let channels = layout.channels.len();
    let bandwidth = layout.channel_width_hz * channels as f64;
    let mut observation = Observation {
        source: header.text("OBJECT").unwrap_or_default(),
        position: position(header)?,
        mjd: Some(mjd),
        frequency_hz: Some(frequency_hz),
        bandwidth_hz: Some(bandwidth).filter(|bandwidth| *bandwidth > 0.0),
        rows,
        ..Observation::empty(layout.basis)
    };
    if channels > 1 {
        observation.history.push(format!("mean of {channels} spectral channels"));
    }
    if left_out > 0 {
        observation.history.push(format!("{left_out} groups without valid data left out"));
    }
    observation.stations = tables.stations;
    Ok(observation)
}

/// Right ascension and declination from OBSRA and OBSDEC or the axes named so, in degrees.
fn position(header: &fits::Header<'_>) -> Result<Option<SourcePosition>, FileError> {
    let axis = |name: &str| {
        (2..=9)
            .find(|k| header.text(&format!("CTYPE{k}")).is_some_and(|t| t == name))
            .map(|k| format!("CRVAL{k}"))
    };
    let value = |keyword: &str, name: &str| match header.number(keyword)? {
        Some(value) => Ok(Some(value)),
        None => axis(name).map_or(Ok(None), |keyword| header.number(&keyword)),
    };
    let (Some(ra), Some(dec)) = (value("OBSRA", "RA")?, value("OBSDEC", "DEC")?) else {
        return Ok(None);
    };
    let position = SourcePosition::new(ra.rem_euclid(360.0) / 15.0, dec);
    position.map(Some).map_err(|error| header.error("OBSRA", error))
}

struct Reader<'a> {
    layout: &'a Layout,
    tables: &'a AntennaTables,
    frequency_hz: f64,
    /// Where the data start in the file.
    offset: usize,
}

impl Reader<'_> {
    /// The day, the rows, and how many groups hold nothing.
    fn rows(&self, data: &[u8]) -> Result<(i32, Vec<Row>, usize), FileError> {
        let size = self.layout.group_size * self.layout.number_size;
        let groups = || data.chunks_exact(size).enumerate();
        let day = groups().map(|(_, group)| self.date(group)).filter(|d| d[0].is_finite());
        let day = day.map(|[day, fraction]| (day + fraction).floor()).fold(f64::NAN, f64::min);
        if !(-1e6..=1e6).contains(&day) {
            let message = format!("{} groups, none with a date near our time", self.layout.groups);
            return Err(FileError::byte(self.offset, message));
        }
        // As many as there are bytes for, which `Unit` has seen to.
        let mut rows = Vec::with_capacity(data.len() / size);
        for (index, group) in groups() {
            let located = |message: String| {
                let at = self.offset + index * size;
                FileError::byte(at, format!("group {}: {message}", index + 1))
            };
            rows.extend(self.row(group, day).map_err(located)?);
        }
        if rows.is_empty() {
            let message = format!("{} groups, none with valid data", self.layout.groups);
            return Err(FileError::byte(self.offset, message));
        }
        let left_out = self.layout.groups - rows.len();
        Ok((day as i32, rows, left_out))
    }

    /// Date as MJD in two parts, whose sum would lose digits.
    fn date(&self, group: &[u8]) -> [f64; 2] {
        let parts = &self.layout.date;
        let stored = |k: usize| self.layout.parameter(group, parts[k].without_zero());
        let zero: f64 = parts.iter().map(|part| part.zero()).sum();
        let rest: f64 = (1..parts.len()).map(stored).sum();
        // Whole days may be in the stored part, in what is added, or in both.
        let day = stored(0).floor() + zero.floor() - MJD_ZERO.floor();
        let rest = rest + (stored(0) - stored(0).floor()) + (zero - zero.floor());
        let rest = rest - (MJD_ZERO - MJD_ZERO.floor());
        [day, rest]
    }

    fn stations(&self, group: &[u8]) -> Result<[u16; 2], String> {
        let value = |parameter| self.layout.parameter(group, parameter);
        let (subarray, numbers) = match self.layout.antennas {
            Antennas::Baseline(parameter) => decode_baseline(value(parameter)),
            Antennas::Pair(first, second, subarray) => {
                let subarray = subarray.map_or(1.0, value);
                (subarray as i64, [value(first) as i64, value(second) as i64])
            }
        };
        let station = |number| {
            self.tables.station(subarray, number).ok_or_else(|| {
                format!("antenna {number} of subarray {subarray} is not in the AIPS AN table")
            })
        };
        Ok([station(numbers[0])?, station(numbers[1])?])
    }

    /// The row of a group, if there is anything in it.
    fn row(&self, group: &[u8], day: f64) -> Result<Option<Row>, String> {
        let layout = self.layout;
        let mut products = [Complex64::new(0.0, 0.0); 4];
        let mut noise_sigma = [f64::NAN; 4];
        for (k, start) in layout.products.iter().enumerate() {
            if let Some(start) = start {
                (products[k], noise_sigma[k]) = self.channel_mean(group, *start);
            }
        }
        if noise_sigma.iter().all(|sigma| sigma.is_nan()) {
            return Ok(None);
        }
        let stations = self.stations(group)?;
        if stations[0] == stations[1] {
            return Ok(None);
        }
        let value = |parameter| layout.parameter(group, parameter);
        let [date, fraction] = self.date(group);
        let time_h = ((date - day) + fraction) * 24.0;
        let uv = [value(layout.u) * self.frequency_hz, value(layout.v) * self.frequency_hz];
        if !(time_h.is_finite() && uv.iter().all(|x| x.is_finite())) {
            return Err(format!("time {time_h} h, (u, v) {uv:?}: not finite"));
        }
        let positive = |x: f64| if x.is_finite() && x > 0.0 { x } else { 0.0 };
        Ok(Some(Row {
            time_h,
            integration_s: positive(layout.integration.map_or(0.0, value)),
            stations,
            uv,
            products,
            noise_sigma,
            opacity: layout
                .opacity
                .map_or([0.0; 2], |both| both.map(|p| positive(value(p)) as f32)),
        }))
    }

    /// Mean over channels weighted by 1/σ², and its σ. Infinite weights (σ = 0) beat all others.
    fn channel_mean(&self, group: &[u8], start: usize) -> (Complex64, f64) {
        let data = || {
            self.layout.channels.iter().map(|channel| {
                let [re, im, weight] = self.layout.datum(group, start + channel);
                let weight = if re.is_finite() && im.is_finite() { weight } else { 0.0 };
                (Complex64::new(re, im), weight)
            })
        };
        let exact = data().filter(|(_, weight)| *weight == f64::INFINITY).count();
        let weight_of = |weight: f64| match exact {
            0 if weight > 0.0 => weight,
            0 => 0.0,
            n => {
                if weight == f64::INFINITY {
                    1.0 / n as f64
                } else {
                    0.0
                }
            }
        };
        let sum: f64 = data().map(|(_, weight)| weight_of(weight)).sum();
        if sum <= 0.0 {
            return (Complex64::new(0.0, 0.0), f64::NAN);
        }
        // Alone, a value keeps its digits.
        let mean: Complex64 = match self.layout.channels.len() {
            1 => data().map(|(value, _)| value).sum(),
            _ => data()
                .filter(|(_, w)| weight_of(*w) > 0.0)
                .map(|(v, w)| v * (weight_of(w) / sum))
                .sum(),
        };
        (mean, if exact > 0 { 0.0 } else { sum.sqrt().recip() })
    }
}

/// Subarray and antenna numbers of a baseline's number (AIPS memo 117, section 3.1.2).
fn decode_baseline(baseline: f64) -> (i64, [i64; 2]) {
    let whole = baseline.floor();
    let subarray = ((baseline - whole) * 100.0).round() as i64 + 1;
    let whole = whole as i64;
    if whole < 65536 {
        (subarray, [whole / 256, whole % 256])
    } else {
        (subarray, [(whole - 65536) / 2048, (whole - 65536) % 2048])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn paper_aips_memo_117_baselines() {
        assert_eq!(decode_baseline(260.0), (1, [1, 4]));
        assert_eq!(decode_baseline(f64::from(258.01f32)), (2, [1, 2]));
        assert_eq!(decode_baseline(65536.0 + 2048.0 * 300.0 + 301.0), (1, [300, 301]));
        decode_baseline(f64::NAN);
        decode_baseline(-1e300);
    }
}
