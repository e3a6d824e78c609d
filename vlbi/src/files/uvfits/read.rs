//! Reading.

use super::super::fits;
use super::super::{FileError, MOST_HOURS};
use super::antennas::AntennaTables;
use super::flags::{self, Flag};
use super::frequencies;
use super::layout::{Antennas, Layout, Parameter, SELECTORS, is_measured};
use super::selectors;
use crate::Complex64;
use crate::Error;
use crate::earth::{MJD_ZERO, SourcePosition};
use crate::observation::{Observation, Row};

/// The longest integration of a group, seconds.
const LONGEST_INTEGRATION_S: f64 = 1e9;

/// Reads UVFITS.
///
/// Several spectral channels or IFs are rows of their own, with (u, v) in wavelengths of their own
/// frequency, which counts from that of the antenna table (as in eht-imaging). σ = 1/√weight; a weight that is not positive, or a visibility that is no number,
/// means no datum, as does a flag of the `AIPS FG` table. Rows without any datum, and correlations of a station with itself, are left
/// out; the history says how many groups have none but such.
///
/// # Errors
/// If the file is damaged, no UVFITS, or holds no datum; if it holds several sources or frequency setups, or
/// coordinates that would have to be converted; if rows of many channels would take more
/// memory than `MOST_MEMORY` times the file.
pub fn read(bytes: &[u8]) -> Result<Observation, Error> {
    let units = fits::units(bytes)?;
    let header = &units[0].header;
    let layout = Layout::new(header)?;
    check_memory(header, &layout, bytes.len())?;
    selectors::check_header(header)?;
    let uncalibrated = selectors::calibration(&units);
    let source = selectors::source(&units, &layout)?;
    for (name, _) in SELECTORS {
        selectors::only(&units[0], &layout, name)?;
    }
    let tables = AntennaTables::read(&units)?;
    let reference_hz = reference_frequency(header, &layout, tables.frequency_hz)?;
    let (mut channels, unknown) = frequencies::channels(&units, &layout, reference_hz)?;
    let mut frequency_hz = reference_hz;
    let bandwidth_hz: f64 = channels.iter().map(|c| c.bandwidth_hz).sum();
    // A single channel is no list: its frequency is that of the observation.
    if let [only] = channels[..] {
        frequency_hz = only.frequency_hz;
        channels.clear();
    }
    let wavelengths = match channels.as_slice() {
        [] => vec![frequency_hz],
        channels => channels.iter().map(|c| c.frequency_hz).collect(),
    };
    let offset = units[0].offset;
    let flags = flags::read(&units)?;
    let reader = Reader { layout: &layout, tables: &tables, flags: &flags, wavelengths, offset };
    let (mjd, mut rows, left_out) = reader.rows(units[0].data)?;
    let ahead_h = selectors::ahead_h(&units, mjd)?;
    if ahead_h != 0.0 {
        rows.iter_mut().for_each(|row| row.time_h -= ahead_h);
    }
    let mut observation = Observation {
        source: match &source {
            Some(source) => source.name.clone(),
            None => header.text("OBJECT").unwrap_or_default(),
        },
        position: match source {
            Some(source) => Some(source.position),
            None => position(header)?,
        },
        mjd: Some(mjd),
        frequency_hz: Some(frequency_hz),
        bandwidth_hz: Some(bandwidth_hz).filter(|bandwidth| *bandwidth > 0.0),
        channels,
        rows,
        ..Observation::empty(layout.basis)
    };
    observation.history = header.history();
    observation.history.extend(remarks(unknown, ahead_h, layout.weighted));
    observation.history.extend(uncalibrated);
    observation.history.extend(without_data(flags.len(), left_out));
    observation.history.extend(tables.remarks);
    observation.stations = tables.stations;
    Ok(observation)
}

/// Refuses headers whose rows would take too many times the memory of the file.
fn check_memory(header: &fits::Header<'_>, layout: &Layout, bytes: usize) -> Result<(), FileError> {
    let count = layout.channels.len();
    let rows = layout.groups.checked_mul(count).and_then(|n| n.checked_mul(size_of::<Row>()));
    if rows.is_none_or(|size| size > MOST_MEMORY * bytes) {
        let message = format!("{count} channels of so few bytes that rows would be too large");
        return Err(header.error("BITPIX", message));
    }
    Ok(())
}

/// The frequency in Hz that channels count from: that of the antenna table if it tells.
fn reference_frequency(
    header: &fits::Header<'_>,
    layout: &Layout,
    of_antennas: Option<f64>,
) -> Result<f64, FileError> {
    let named = |k: &i32| header.text(&format!("CTYPE{k}")).is_some_and(|name| name == "FREQ");
    let fail = |card: &str, why: String| {
        let axis = (2..=9).find(named).unwrap_or(4);
        Err(header.error(&format!("{card}{axis}"), why))
    };
    let hertz = of_antennas.unwrap_or(layout.frequency_hz);
    if !(1e6..=1e15).contains(&hertz) {
        let why = "no frequency in [1e6, 1e15] Hz in AN table or header";
        return fail("CRVAL", why.to_owned());
    }
    // Writers that do not know it write 0.
    if layout.frequency_hz != 0.0 && !(0.5..=2.0).contains(&(layout.frequency_hz / hertz)) {
        return fail("CRVAL", format!("about the {hertz:e} Hz of the AIPS AN table"));
    }
    if layout.channel_width_hz.abs() > hertz {
        return fail("CDELT", format!("less than the frequency, {hertz:e} Hz"));
    }
    Ok(hertz)
}

/// Lines of the history about what the file does not tell, and what was done with its times.
fn remarks(without_fq: bool, ahead_h: f64, weighted: bool) -> Vec<String> {
    let mut lines = Vec::new();
    if without_fq {
        lines.push("no AIPS FQ table: all IFs counted at the reference frequency".to_owned());
    }
    if ahead_h != 0.0 {
        lines.push(format!("times of TAI less {} s", (ahead_h * 3600.0).round()));
    }
    if !weighted {
        lines.push("no weights: errors of 1 Jy".to_owned());
    }
    lines
}

/// Lines of the history about data that there are none of.
fn without_data(flags: usize, left_out: usize) -> impl Iterator<Item = String> {
    let flags = (flags > 0).then(|| format!("flags of AIPS FG applied: {flags}"));
    let groups = (left_out > 0).then(|| format!("{left_out} groups without valid data left out"));
    flags.into_iter().chain(groups)
}

/// Baselines of interferometers in space are shorter than this, seconds of light.
const LONGEST_S: f64 = 1e4;

/// Rows take at most this many times the bytes of the file.
pub const MOST_MEMORY: usize = 16;

/// Returns the position on the axes RA and DEC, which (u, v) belong to; OBSRA and OBSDEC, where antennas point, where these are
/// not told.
fn position(header: &fits::Header<'_>) -> Result<Option<SourcePosition>, FileError> {
    let axis = |name: &str| {
        let named = |k: &i32| header.text(&format!("CTYPE{k}")).is_some_and(|text| text == name);
        let keyword = (2..=9).find(named).map(|k| format!("CRVAL{k}"));
        keyword.map_or(Ok(None), |keyword| header.number(&keyword))
    };
    let pointing = header.number("OBSRA")?.zip(header.number("OBSDEC")?);
    // Writers that do not know the axes have zeros there.
    let axes = axis("RA")?.zip(axis("DEC")?);
    let centre = axes.filter(|centre| *centre != (0.0, 0.0));
    let is_same = |(a, b): (f64, f64), (c, d): (f64, f64)| (a - c).abs().max((b - d).abs()) < 1e-6;
    let same = pointing.filter(|pointing| centre.is_some_and(|centre| is_same(*pointing, centre)));
    let Some((ra, dec)) = same.or(centre).or(pointing).or(axes) else { return Ok(None) };
    let position = SourcePosition::new(ra.rem_euclid(360.0) / 15.0, dec);
    position.map(Some).map_err(|error| header.error("OBSRA", error))
}

struct Reader<'a> {
    layout: &'a Layout,
    tables: &'a AntennaTables,
    flags: &'a [Flag],
    /// Frequencies in Hz that (u, v) of each channel count wavelengths of.
    wavelengths: Vec<f64>,
    /// Offset of the data in the file.
    offset: usize,
}

impl Reader<'_> {
    /// The day, the rows, and how many groups hold nothing.
    fn rows(&self, data: &[u8]) -> Result<(i32, Vec<Row>, usize), FileError> {
        let size = self.layout.group_size * self.layout.number_size;
        let groups = || data.chunks_exact(size).enumerate();
        let day = groups().map(|(_, group)| self.date(group)).filter(|d| d[0].is_finite());
        // The minimum passes over NaN, and is NaN without any date: refused below.
        let day = day.map(|[day, fraction]| (day + fraction).floor()).fold(f64::NAN, f64::min);
        if !(-1e6..=1e6).contains(&day) {
            let message = format!("{} groups, none with a date near our time", self.layout.groups);
            return Err(FileError::byte(self.offset, message));
        }
        // As many as `read` has seen to be in proportion.
        let mut rows = Vec::with_capacity(data.len() / size * self.wavelengths.len());
        let mut left_out = 0;
        for (index, group) in groups() {
            let located = |message: String| {
                let at = self.offset + index * size;
                FileError::byte(at, format!("group {}: {message}", index + 1))
            };
            let before = rows.len();
            self.group(group, day, &mut rows).map_err(located)?;
            left_out += usize::from(rows.len() == before);
        }
        if rows.is_empty() {
            let message = format!("{} groups, none with valid data", self.layout.groups);
            return Err(FileError::byte(self.offset, message));
        }
        Ok((day as i32, rows, left_out))
    }

    /// Date as MJD in two parts, whose sum would lose digits.
    fn date(&self, group: &[u8]) -> [f64; 2] {
        let parts = &self.layout.date;
        let stored = |k: usize| self.layout.parameter(group, Parameter { zero: 0.0, ..parts[k] });
        let zero: f64 = parts.iter().map(|part| part.zero).sum();
        let rest: f64 = (1..parts.len()).map(stored).sum();
        // Whole days may be in the stored part, in what is added, or in both.
        let day = stored(0).floor() + zero.floor() - MJD_ZERO.floor();
        let rest = rest + (stored(0) - stored(0).floor()) + (zero - zero.floor());
        let rest = rest - (MJD_ZERO - MJD_ZERO.floor());
        [day, rest]
    }

    /// Subarray, and numbers of the antennas.
    fn antennas(&self, group: &[u8]) -> (i64, [i64; 2]) {
        let value = |parameter| self.layout.parameter(group, parameter);
        match self.layout.antennas {
            Antennas::Baseline(parameter) => decode_baseline(value(parameter)),
            Antennas::Pair(first, second, subarray) => {
                let subarray = subarray.map_or(1.0, value);
                (subarray as i64, [value(first) as i64, value(second) as i64])
            }
        }
    }

    /// Flags that are about some data of a group.
    fn flags(&self, group: &[u8]) -> Vec<&Flag> {
        if self.flags.is_empty() {
            return Vec::new();
        }
        let selected = ["SOURCE", "FREQSEL"].map(|name| self.layout.selected(group, name));
        let (subarray, antennas) = self.antennas(group);
        let mjd = self.date(group).iter().sum();
        let group = flags::Group { selected, subarray, antennas, mjd };
        self.flags.iter().filter(|flag| flag.is_about(&group)).collect()
    }

    fn stations(&self, group: &[u8]) -> Result<[u16; 2], String> {
        let (subarray, numbers) = self.antennas(group);
        let station = |number| {
            self.tables.station(subarray, number).ok_or_else(|| {
                format!("antenna {number} of subarray {subarray} is not in the AIPS AN table")
            })
        };
        Ok([station(numbers[0])?, station(numbers[1])?])
    }

    /// The rows of a group: a channel each, where there is anything in it.
    fn group(&self, group: &[u8], day: f64, rows: &mut Vec<Row>) -> Result<(), String> {
        let layout = self.layout;
        let before = rows.len();
        let flags = self.flags(group);
        for (channel, (place, frequency)) in
            (0..).zip(layout.channels.iter().zip(&self.wavelengths))
        {
            let is_flagged = |start: usize| {
                let product = layout.place_of_product(start);
                flags.iter().any(|flag| flag.covers(place, product))
            };
            let data = |start: &Option<usize>| match start {
                Some(start) if !is_flagged(*start) => self.datum(group, start + place.offset),
                _ => (Complex64::new(0.0, 0.0), f64::NAN),
            };
            let data = [0, 1, 2, 3].map(|k| data(&layout.products[k]));
            if data.iter().all(|(_, sigma)| sigma.is_nan()) {
                continue;
            }
            let mut row = match rows.get(before..).and_then(<[Row]>::first) {
                Some(first) => *first,
                None => match self.empty_row(group, day)? {
                    Some(row) => row,
                    None => return Ok(()),
                },
            };
            let seconds = [&layout.u, &layout.v].map(|parts| layout.sum(group, parts));
            if !seconds.iter().all(|x| x.abs() <= LONGEST_S) {
                return Err(format!("(u, v) = {seconds:?} s is not allowed: up to {LONGEST_S} s"));
            }
            row.uv = seconds.map(|x| x * frequency);
            row.products = data.map(|(value, _)| value);
            row.noise_sigma = data.map(|(_, sigma)| sigma);
            row.channel = channel;
            rows.push(row);
        }
        Ok(())
    }

    /// Returns the properties that all channels of a group have in common, unless it is of a station with itself.
    fn empty_row(&self, group: &[u8], day: f64) -> Result<Option<Row>, String> {
        let layout = self.layout;
        let stations = self.stations(group)?;
        if stations[0] == stations[1] {
            return Ok(None);
        }
        let value = |parameter| layout.parameter(group, parameter);
        let [date, fraction] = self.date(group);
        let time_h = ((date - day) + fraction) * 24.0;
        if !(-MOST_HOURS..=MOST_HOURS).contains(&time_h) {
            return Err(format!("{time_h:e} h after the first day: up to {MOST_HOURS:e} h"));
        }
        let positive = |x: f64| if x.is_finite() && x > 0.0 { x } else { 0.0 };
        let integration_s = positive(layout.integration.map_or(0.0, value));
        if integration_s > LONGEST_INTEGRATION_S {
            return Err(format!(
                "INTTIM = {integration_s:e} s is not allowed: up to {LONGEST_INTEGRATION_S:e} s"
            ));
        }
        let opacity = layout.opacity.map_or([0.0; 2], |both| both.map(|p| positive(value(p))));
        Ok(Some(Row {
            integration_s,
            opacity: opacity.map(|tau| tau as f32),
            ..Row::empty(time_h, stations, [0.0; 2])
        }))
    }

    /// A visibility and its σ = 1/√weight; NaN where there is none.
    fn datum(&self, group: &[u8], index: usize) -> (Complex64, f64) {
        let [re, im, weight] = self.layout.datum(group, index);
        if is_measured([re, im, weight]) {
            (Complex64::new(re, im), weight.sqrt().recip())
        } else {
            (Complex64::new(0.0, 0.0), f64::NAN)
        }
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
    fn exact_aips_memo_117_baselines() {
        assert_eq!(decode_baseline(260.0), (1, [1, 4]));
        assert_eq!(decode_baseline(f64::from(258.01f32)), (2, [1, 2]));
        assert_eq!(decode_baseline(65536.0 + 2048.0 * 300.0 + 301.0), (1, [300, 301]));
        decode_baseline(f64::NAN);
        decode_baseline(-1e300);
    }
}
