//! Tables of total intensity, a visibility a line, columns separated by commas or blanks and told
//! by a line of names: kerrlight's CSV, and the csv and txt of the EHT's public releases.

use super::{
    FileError, MOST_HOURS, MOST_WAVELENGTHS, Names, cells, cells_below, check_located, comments,
    has_tabs, number, number_within, over_midnight, sigma,
};
use crate::Complex64;
use crate::Error;
use crate::observation::{Basis, Measured, Observation, Row};
use core::fmt::Write;

/// Columns of kerrlight's CSV: hours of UTC, stations, (u, v) in wavelengths, real and imaginary
/// part in Jy, and the standard deviation of each.
pub const COLUMNS: [&str; 8] = ["time_utc_h", "t1", "t2", "u", "v", "re", "im", "sigma"];

/// The column of a spectral channel's number, counted from 0 in the order of the comments.
pub const CHANNEL: &str = "channel";

/// The same in the EHT's releases, with amplitude in Jy and phase in degrees.
pub(super) const EHT_COLUMNS: [&str; 8] =
    ["time(UTC)", "T1", "T2", "U(lambda)", "V(lambda)", "Iamp(Jy)", "Iphase(d)", "Isigma(Jy)"];

/// Places of the eight columns, and whether visibilities are polar.
struct Heading {
    /// Number in all.
    count: usize,
    columns: [usize; 8],
    polar: bool,
    channel: Option<usize>,
    /// True if tabs separate cells.
    tabs: bool,
}

impl Heading {
    fn find(line: &str) -> Option<Self> {
        let names = &cells(line);
        [(COLUMNS, false), (EHT_COLUMNS, true)].into_iter().find_map(|(wanted, polar)| {
            let at = |name: &str| names.iter().position(|n| n.eq_ignore_ascii_case(name));
            let found: Option<Vec<usize>> = wanted.iter().map(|name| at(name)).collect();
            let (channel, count) = (at(CHANNEL), names.len());
            let (columns, tabs) = (found?.try_into().ok()?, has_tabs(line, count));
            Some(Heading { count, columns, polar, channel, tabs })
        })
    }

    /// A column that is read and has the name of another one.
    fn twice<'a>(&self, names: &[&'a str]) -> Option<&'a str> {
        let same = |a: &str, b: &str| a.eq_ignore_ascii_case(b);
        let is_twice = |k: &usize| names[k + 1..].iter().any(|name| same(name, names[*k]));
        self.columns.iter().chain(&self.channel).copied().find(is_twice).map(|k| names[k])
    }
}

/// Reads a table.
///
/// # Errors
/// If no line names the columns of either kind, or a line of data has too few of them or no
/// number where one belongs. Lines whose visibility or error is `nan` are left out; the history says how
/// many.
pub fn parse(text: &str) -> Result<Observation, Error> {
    let mut observation = Observation::empty(Basis::Stokes);
    let mut names = Names::new(Vec::new());
    let mut heading = None;
    let mut left_out = 0;
    observation.rows = Vec::with_capacity(super::rows_at_most(text));
    for (index, line) in text.lines().enumerate() {
        let located = |message: String| FileError::line(index + 1, message);
        let bare = line.trim_start_matches('#');
        let is_comment = bare.len() < line.len();
        if heading.is_none() && !bare.trim().is_empty() {
            if is_comment && comments::read(bare, &mut observation, &mut names).map_err(located)? {
                continue;
            }
            // The names of columns are a comment in the EHT's tables.
            heading = Heading::find(bare.trim());
            if let Some(heading) = &heading {
                match heading.twice(&cells(bare.trim())) {
                    Some(name) => {
                        return Err(located(format!("column `{name}` appears twice")).into());
                    }
                    None => continue,
                }
            }
        }
        // They stand above the names of the columns, or between these and the data.
        if is_comment && observation.rows.is_empty() {
            read_facts(bare, &mut observation).map_err(located)?;
        }
        if is_comment || line.trim().is_empty() {
            continue;
        }
        let Some(heading) = &heading else {
            let why = format!("data before a line that names {}", COLUMNS.join(", "));
            return Err(located(why).into());
        };
        let cells = cells_below(line, heading.count, heading.tabs).map_err(located)?;
        let Some(row) = row(&cells, heading, &mut names).map_err(located)? else {
            left_out += 1;
            continue;
        };
        if usize::from(row.channel) >= observation.channels.len().max(1) {
            return Err(located(format!("channel {} is not in the comments", row.channel)).into());
        }
        observation.rows.push(row);
    }
    if heading.is_none() {
        let why = format!("no line names the columns {}", COLUMNS.join(", "));
        return Err(FileError::whole(why).into());
    }
    if observation.rows.is_empty() {
        return Err(FileError::whole("no visibilities").into());
    }
    check_located(&observation)?;
    over_midnight(&mut observation.rows, |row| &mut row.time_h);
    if left_out > 0 {
        observation.history.push(format!("{left_out} lines without a visibility (nan) left out"));
    }
    observation.stations = names.stations;
    Ok(observation)
}

/// `SRC:M87 DATE(MJD):57853 FREQ:229.0707GHz` of the EHT's tables.
fn read_facts(line: &str, observation: &mut Observation) -> Result<(), String> {
    for cell in cells(line) {
        if let Some(source) = cell.strip_prefix("SRC:") {
            observation.source = source.to_owned();
        } else if let Some(mjd) = cell.strip_prefix("DATE(MJD):") {
            let value = number(mjd, "DATE(MJD)")?;
            if !(0.0..=1e6).contains(&value) {
                return Err(format!("DATE(MJD) = {value} is not allowed: [0, 1e6]"));
            }
            observation.mjd = Some(value.floor() as i32);
        } else if let Some(frequency) = cell.strip_prefix("FREQ:") {
            let value = number(frequency.trim_end_matches("GHz"), "FREQ")?;
            observation.frequency_hz = Some(value * 1e9).filter(|f| *f > 0.0);
        }
    }
    Ok(())
}

/// The row of a line; none where `nan` stands for the visibility or its error.
fn row(cells: &[&str], heading: &Heading, names: &mut Names) -> Result<Option<Row>, String> {
    let cell = |k: usize| {
        let column = heading.columns[k];
        cells
            .get(column)
            .copied()
            .ok_or_else(|| format!("{} columns: column {} is missing", cells.len(), column + 1))
    };
    let value = |k: usize| number(cell(k)?, COLUMNS[k]);
    if cells.len() > heading.count {
        return Err(format!("{} columns, but {} names", cells.len(), heading.count));
    }
    let stations = [names.number(cell(1)?)?, names.number(cell(2)?)?];
    if stations[0] == stations[1] {
        return Err(format!("a baseline of station {} with itself", cell(1)?));
    }
    for k in 5..8 {
        if cell(k)?.parse::<f64>().is_ok_and(f64::is_nan) {
            return Ok(None);
        }
    }
    let (first, second) = (value(5)?, value(6)?);
    let visibility = if heading.polar {
        Complex64::from_polar(first, second.to_radians())
    } else {
        Complex64::new(first, second)
    };
    let noise_sigma = sigma(cell(7)?, "sigma")?;
    let i = Measured { visibility, noise_sigma };
    let channel = match heading.channel.map(|column| cells.get(column).copied().unwrap_or_default())
    {
        None => 0,
        Some(cell) => cell
            .parse()
            .map_err(|_| format!("channel `{}` is no channel's number", super::shortened(cell)))?,
    };
    let within = |k: usize, most: f64| number_within(cell(k)?, COLUMNS[k], most);
    let uv = [within(3, MOST_WAVELENGTHS)?, within(4, MOST_WAVELENGTHS)?];
    let row = Row::total_intensity(within(0, MOST_HOURS)?, stations, uv, i);
    Ok(Some(Row { channel, ..row }))
}

/// Stokes I of every row that has it, as kerrlight's CSV, numbers with all their digits. With
/// `comments`, lines that start with `#` stand before it and tell source, date, frequencies,
/// stations and history. Several spectral channels have a further column `channel`, and comments
/// in any case.
///
/// # Errors
/// If a time, (u, v), visibility or error is not a finite number.
pub fn to_csv(observation: &Observation, comments: bool) -> Result<String, Error> {
    super::check_numbers(observation)?;
    let several = !observation.channels.is_empty();
    let mut text = if comments || several { comments::write(observation) } else { String::new() };
    text += &COLUMNS.join(",");
    text += if several { ",channel\n" } else { "\n" };
    for (row, i) in observation.stokes_i() {
        let [t1, t2] = observation.names(row);
        let Row { time_h, uv: [u, v], .. } = row;
        let Measured { visibility: Complex64 { re, im }, noise_sigma } = i;
        // Writing into a string cannot fail.
        let _ = write!(text, "{time_h},{t1},{t2},{u},{v},{re},{im},{noise_sigma}");
        let _ = if several { writeln!(text, ",{}", row.channel) } else { writeln!(text) };
    }
    Ok(text)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::files::eht_table::tests::{CSV, TXT};
    use crate::files::uvfits::tests::small;
    use crate::observation::Channel;

    #[test]
    fn exact_txt_and_csv_of_the_eht() {
        let observation = parse(TXT).unwrap();
        // Products that are not there have an error of NaN, which is equal to nothing.
        assert_eq!(format!("{:?}", parse(CSV).unwrap()), format!("{observation:?}"));
        assert_eq!((observation.source.as_str(), observation.mjd), ("M87", Some(57853)));
        // Facts may follow the names of the columns, and names be quoted.
        let mut lines: Vec<&str> = CSV.lines().collect();
        lines.swap(0, 1);
        let other = lines.join("\n").replace("AA", "\"AA\"");
        assert_eq!(format!("{:?}", parse(&other).unwrap()), format!("{observation:?}"));
        let i = observation.rows[0].product(0).unwrap();
        assert!((i.visibility.arg().to_degrees() + 122.7523).abs() < 1e-12);
        assert_eq!(observation.names(&observation.rows[0]), ["AA", "LM"]);
    }

    #[test]
    fn exact_round_trip() {
        let observation = parse(TXT).unwrap();
        let back = parse(&to_csv(&observation, true).unwrap()).unwrap();
        assert_eq!(format!("{back:?}"), format!("{observation:?}"));
    }

    /// All that a row of Stokes I and its observation know comes back, but for integration times and
    /// opacities, for which there are no columns.
    #[test]
    fn exact_comments_keep_the_settings() {
        let mut observation = small().total_intensity();
        observation.history = vec!["seed 7, noise thermal".into(), "a, b: c".into()];
        observation.channels =
            [229e9, 231e9].map(|frequency_hz| Channel { frequency_hz, bandwidth_hz: 1e9 }).to_vec();
        observation.rows[1].channel = 1;
        for row in &mut observation.rows {
            (row.integration_s, row.opacity) = (0.0, [0.0; 2]);
        }
        let text = to_csv(&observation, true).unwrap();
        let back = parse(&text).unwrap();
        assert_eq!(format!("{back:?}"), format!("{observation:?}"));
        assert!(text.contains("\ntime_utc_h,t1,t2,u,v,re,im,sigma,channel\n"), "{text}");
        let fail = |from: &str, to: &str| parse(&text.replace(from, to)).unwrap_err().to_string();
        assert!(fail("# ra_h: 17.76", "# ra_h: 27").contains("line 1: right ascension = 27"));
        assert!(fail("# mjd: 57850", "# mjd: x").contains("mjd `x`"));
        assert!(fail("# ra_h", "# ra").contains("right ascension and declination is missing"));
        assert!(fail("# channel: 1 ", "# passed: 1 ").contains("channel 1 is not in the comments"));
        assert!(fail("# station: BB", "# station: AA").contains("AA is listed twice"));
    }

    #[test]
    fn exact_errors_name_the_line() {
        let fail = |text: &str| parse(text).unwrap_err().to_string();
        assert!(fail("").contains("time_utc_h"));
        assert!(fail("a,b\n1,2\n").contains("time_utc_h"));
        let head = COLUMNS.join(",");
        assert!(fail(&head).contains("no visibilities"));
        assert!(fail(&format!("{head}\n1,A,B,1,2,3,4\n")).starts_with("line 2: 7 columns"));
        assert!(fail(&format!("{head}\n1,A,B,1,2,x,4,5\n")).contains("line 2: re `x`"));
        assert!(fail(&format!("{head}\n1,A,A,1,2,3,4,5\n")).contains("with itself"));
        assert!(fail(&format!("{head}\n1,A,B,1,2,3,4,-5\n")).contains("sigma = -5"));
        assert!(fail(&format!("{head}\n1,A,B,inf,2,3,4,5\n")).contains("u = inf"));
        assert!(fail(&format!("{head}\n1,A,B,1,2,3,4,-nan\n")).contains("no visibilities"));
        assert!(fail(&format!("{head}\n1,A,B,nan,2,3,4,5\n")).contains("u = NaN"));
        assert!(fail(&format!("{head}\n1e7,A,B,1,2,3,4,5\n")).contains("time_utc_h = 1e7 is not"));
        assert!(fail(&format!("{head}\n1,A,B,1,-1e300,3,4,5\n")).contains("v = -1e300 is not"));
        assert!(fail(&format!("{head}\n1,A,B,1,2,3,4,5,6\n")).contains("9 columns, but 8 names"));
        let tabs = head.replace(',', "\t");
        assert!(fail(&format!("{tabs}\n1\tA\tB\t1\t2\t\t3\t4\n")).contains("line 2: re ``"));
        assert!(fail(&format!("{tabs}\n1 A B 1 2 3 4\n")).contains("line 2: "));
        assert!(fail(&format!("{head},u\n1,A,B,1,2,3,4,5,6\n")).contains("line 1: column `u` app"));
    }

    /// Hours of a night over midnight count on, however many baselines a scan has.
    #[test]
    fn exact_hours_count_on_over_midnight() {
        let line = |hour: &str, pair: &str| format!("{hour},{pair},1,2,3,4,5\n");
        let [a, b] = ["A,B", "A,C"];
        let scans = ["23.5", "0", "0.5"].map(|hour| line(hour, a) + &line(hour, b));
        let read = parse(&(COLUMNS.join(",") + "\n" + &scans.concat())).unwrap();
        let hours: Vec<f64> = read.rows.iter().map(|row| row.time_h).collect();
        assert_eq!(hours, [23.5, 23.5, 24.0, 24.0, 24.5, 24.5]);
    }

    /// As in UVFITS, a value that is no number means that there is no such datum.
    #[test]
    fn exact_lines_without_a_visibility_are_left_out() {
        let line = "1,A,B,1,2,3,4,5\n";
        let text = COLUMNS.join(",") + "\n" + &line.replace('3', "nan") + line;
        let observation = parse(&(text.clone() + &line.replace('5', "NaN"))).unwrap();
        assert_eq!((observation.rows.len(), observation.stations.len()), (1, 2));
        assert_eq!(observation.history, ["2 lines without a visibility (nan) left out"]);
        let none = text.strip_suffix(line).unwrap();
        assert!(parse(none).unwrap_err().to_string().contains("no visibilities"));
    }
}
