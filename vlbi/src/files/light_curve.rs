//! Tables of light curves: a time a line, columns separated by commas or blanks and told by a line of names.

use super::{FileError, cells, cells_below, has_tabs, number, over_midnight, sigma};
use crate::Error;
use crate::earth::MJD_ZERO;
use crate::light_curve::{Flux, LightCurve, Sample};
use core::fmt::Write;
use kerrlight_common::stokes::StokesParameter;

/// Names of the column of times, hours of UTC.
const TIMES: [&str; 10] =
    ["time_utc_h", "time", "t", "utc", "ut", "utc_h", "time_h", "time_hr", "hour", "hours"];
/// Names of a column of times in days, of which the part of the first day counts.
const DAYS: [&str; 2] = ["mjd", "time_mjd"];
const JULIAN_DAYS: [&str; 2] = ["jd", "time_jd"];

#[derive(Clone, Copy, PartialEq)]
enum TimeUnit {
    Hours,
    Days,
    /// Days from a noon, in full.
    JulianDays,
}

/// Place of times, and their unit.
#[derive(Clone, Copy)]
struct TimeColumn {
    at: usize,
    unit: TimeUnit,
}

/// Places of the columns.
struct Heading {
    /// Number in all.
    count: usize,
    time: TimeColumn,
    values: [Option<usize>; 4],
    sigmas: [Option<usize>; 4],
    by: Option<usize>,
    /// True if tabs separate cells.
    tabs: bool,
    /// Two columns of the same quantity.
    rivals: Option<[String; 2]>,
}

impl TimeColumn {
    fn find(names: &[String]) -> Option<Self> {
        let of = |all: &[&str], unit| {
            let at = |name: &&str| names.iter().position(|n| n == name);
            all.iter().find_map(at).map(|at| TimeColumn { at, unit })
        };
        let hours = of(&TIMES, TimeUnit::Hours).or_else(|| of(&DAYS, TimeUnit::Days));
        hours.or_else(|| of(&JULIAN_DAYS, TimeUnit::JulianDays))
    }

    fn check_unit(self, names: &[String], units: &[String]) -> Result<(), String> {
        let allowed: &[&str] = match self.unit {
            TimeUnit::Hours => &["h", "hr", "hrs", "hour", "hours", "utc", "ut"],
            _ => &["d", "day", "days", "mjd", "jd", "utc", "ut"],
        };
        check_unit(&names[self.at], &units[self.at], allowed)
    }
}

/// Refuses a unit that is not made of these words; none is one of them.
fn check_unit(name: &str, unit: &str, allowed: &[&str]) -> Result<(), String> {
    match unit.is_empty() || unit.split('_').all(|word| allowed.contains(&word)) {
        true => Ok(()),
        false => Err(format!("column `{name}` in `{unit}` is not allowed: {}", allowed[0])),
    }
}

impl Heading {
    fn find(names: &[String]) -> Option<Self> {
        let at = |name: &str| names.iter().position(|n| n == name);
        let mut rivals = None;
        let mut any = |wanted: &[String]| {
            let mut found = names.iter().enumerate().filter(|(_, name)| wanted.contains(name));
            let (first, second) = (found.next()?, found.next());
            if let Some((_, second)) = second.filter(|second| second.1 != first.1) {
                rivals.get_or_insert([first.1.clone(), second.clone()]);
            }
            Some(first.0)
        };
        let values = StokesParameter::ALL.map(|parameter| {
            let name = parameter.name().to_ascii_lowercase();
            let mut fluxes = vec![name.clone(), format!("{name}_jy"), format!("stokes_{name}")];
            if parameter == StokesParameter::I {
                fluxes.extend(["flux", "flux_jy"].map(str::to_owned));
            }
            any(&fluxes)
        });
        let mut error = |parameter: StokesParameter| {
            let name = parameter.name().to_ascii_lowercase();
            let around = ["sigma", "sig", "err", "error", "std", "e"];
            let mut all: Vec<String> = around
                .iter()
                .flat_map(|word| [format!("{word}_{name}"), format!("{name}_{word}")])
                .collect();
            all.extend([format!("d{name}"), format!("{name}sigma"), format!("{name}err")]);
            let shared = ["sigma", "err", "error", "flux_err", "flux_error"].map(str::to_owned);
            any(&all).or_else(|| any(&shared))
        };
        let sigmas = StokesParameter::ALL
            .map(|parameter| values[parameter.index()].and_then(|_| error(parameter)));
        values.iter().any(Option::is_some).then_some(())?;
        Some(Heading {
            count: names.len(),
            time: TimeColumn::find(names)?,
            values,
            sigmas,
            by: at("baseline"),
            tabs: false,
            rivals,
        })
    }

    /// Refuses columns in other units than those in which they are read.
    fn check_units(&self, names: &[String], units: &[String]) -> Result<(), String> {
        let mut fluxes = [self.values, self.sigmas].into_iter().flatten().flatten();
        fluxes.try_for_each(|k| check_unit(&names[k], &units[k], &["jy"]))?;
        self.time.check_unit(names, units)
    }

    /// The number of a column that is read and has the name of another one.
    fn twice(&self, names: &[String]) -> Option<usize> {
        let read = [self.values, self.sigmas].into_iter().flatten().flatten();
        let is_twice = |k: &usize| names[k + 1..].contains(&names[*k]);
        read.chain([self.time.at]).find(is_twice)
    }
}

/// A name in small letters, its words joined by underscores.
fn plain(name: &str) -> String {
    let name = name.to_ascii_lowercase();
    let words = name.split(|c: char| c.is_whitespace() || c == '-' || c == '_');
    words.filter(|word| !word.is_empty()).collect::<Vec<_>>().join("_")
}

/// The names in a line, a comment or not, as above tables of numpy, and their units in brackets: `time(hr)` and
/// `Time [UTC h]` are `time`, in `hr` and `utc_h`.
fn names(line: &str) -> (Vec<String>, Vec<String>) {
    let (mut text, mut depth) = (String::new(), 0);
    for c in line.trim_start_matches('#').chars() {
        match c {
            '(' | '[' => {
                text.truncate(text.trim_end_matches([' ', '\t']).len());
                text.push('[');
                depth += 1;
            }
            ')' | ']' => {
                text.push(']');
                depth -= 1;
            }
            // A unit is one cell with its name.
            ',' | ' ' | '\t' if depth > 0 => text.push('_'),
            c => text.push(c),
        }
    }
    let inside_and_out = |cell: &str| {
        let mut parts = [String::new(), String::new()];
        let mut inside = false;
        for c in cell.chars() {
            match c {
                '[' | ']' => inside = c == '[',
                c => parts[usize::from(inside)].push(c),
            }
        }
        parts.map(|part| plain(&part)).into()
    };
    cells(&text).into_iter().map(inside_and_out).unzip()
}

/// Returns whether the first line that is no comment, or the last comment above it, names columns as those of a light curve:
/// then it is meant to be one.
pub fn is_light_curve(text: &str) -> bool {
    let mut comment = Vec::new();
    for line in text.lines().filter(|line| !line.trim().is_empty()) {
        if line.starts_with('#') {
            comment = names(line).0;
            continue;
        }
        let here = names(line).0;
        // u and v of baselines are no Stokes parameters.
        if ["t1", "t2"].iter().all(|station| here.iter().any(|name| name == station)) {
            return false;
        }
        // Several parameters without a time: the reader of light curves says what is missing.
        let has = |p: &&StokesParameter| here.iter().any(|n| n.eq_ignore_ascii_case(p.name()));
        let stokes = StokesParameter::ALL.iter().filter(has).count();
        return stokes > 1 || [here, comment].iter().any(|names| Heading::find(names).is_some());
    }
    false
}

/// Reads a table with a column of times (`time_utc_h`, `time`, `t`, `UTC` or `hour`, hours of UTC, which count on over midnight; `MJD`
/// or `JD`, days) and
/// any of I, Q, U and V in Jy, each with a column of its standard deviations (`sigma_I`, `I_err`, `dI`), or one `sigma`
/// for all. Names may have these units in brackets. Other columns, lines that start with `#` and cells that are empty or `nan` are
/// left out; the last comment above the numbers may name the columns.
///
/// # Errors
/// If no line names the columns, a line has too few of them or no number where one belongs: with line, column and value.
pub fn parse(text: &str) -> Result<LightCurve, Error> {
    let (mut heading, mut comment) = (None, (Vec::new(), Vec::new()));
    let mut samples: Vec<Sample> = Vec::new();
    let (mut first_day, mut commented) = (None, "");
    for (index, line) in text.lines().enumerate() {
        let located = |message: String| FileError::line(index + 1, message);
        if line.trim().is_empty() {
            continue;
        }
        if line.starts_with('#') {
            (comment, commented) = (names(line), line.trim_start_matches('#'));
            continue;
        }
        if heading.is_none() {
            let here = names(line);
            let is_names = Heading::find(&here.0).is_some();
            let (named, units) = if is_names { here } else { std::mem::take(&mut comment) };
            let why = || located(format!("`{}` names no {}", shown(line), wanted()));
            let mut found = Heading::find(&named).ok_or_else(why)?;
            found.tabs = has_tabs(if is_names { line } else { commented }, named.len());
            if let Some(k) = found.twice(&named) {
                return Err(located(format!("column `{}` appears twice", named[k])).into());
            }
            if let Some([a, b]) = &found.rivals {
                return Err(located(format!("columns `{a}` and `{b}` name the same flux")).into());
            }
            found.check_units(&named, &units).map_err(located)?;
            heading = Some(found);
            if is_names {
                continue;
            }
        }
        let Some(columns) = &heading else { continue };
        let cells = cells_below(line, columns.count, columns.tabs).map_err(located)?;
        samples.push(sample(&cells, columns, &mut first_day).map_err(located)?);
    }
    if heading.is_none() {
        return Err(FileError::whole(format!("no line names {}", wanted())).into());
    }
    if heading.is_some_and(|found| found.time.unit == TimeUnit::Hours) {
        over_midnight(&mut samples, |sample| &mut sample.time_h);
    }
    samples.retain(Sample::has_flux);
    if samples.is_empty() {
        return Err(FileError::whole("no fluxes").into());
    }
    samples.sort_by(|a: &Sample, b: &Sample| a.time_h.total_cmp(&b.time_h));
    // Copies are no further measurements.
    samples.dedup();
    Ok(LightCurve { samples })
}

fn wanted() -> &'static str {
    "columns time_utc_h (hours of UTC) and any of I, Q, U, V (Jy)"
}

fn shown(line: &str) -> String {
    line.chars().take(40).collect()
}

/// Hours of UTC of a cell. Days count from the midnight before the first of them.
fn hours(cell: &str, unit: TimeUnit, first_day: &mut Option<f64>) -> Result<f64, String> {
    let time = number(cell, "column time:")?;
    let hours = match unit {
        TimeUnit::Hours => time,
        // Less some days that are not told, it may begin at noon or at midnight.
        TimeUnit::JulianDays if time <= MJD_ZERO => {
            return Err(format!("column time: JD {time} is not allowed: above {MJD_ZERO}"));
        }
        _ => {
            // Told by its size.
            let mjd = if time > MJD_ZERO { time - MJD_ZERO } else { time };
            24.0 * (mjd - *first_day.get_or_insert(mjd.floor()))
        }
    };
    match (-1e4..=1e4).contains(&hours) {
        true => Ok(hours),
        false => Err(format!("column time: {time} h is not allowed: hours of UTC")),
    }
}

fn sample(
    cells: &[&str],
    columns: &Heading,
    first_day: &mut Option<f64>,
) -> Result<Sample, String> {
    let cell = |at: usize, name: &str| {
        let count = cells.len();
        cells.get(at).copied().ok_or_else(|| format!("column {name} is missing: {count} cells"))
    };
    if cells.len() > columns.count {
        return Err(format!("{} cells, but {} names", cells.len(), columns.count));
    }
    let TimeColumn { at, unit } = columns.time;
    let time_h = hours(cell(at, "time")?, unit, first_day)?;
    let mut stokes = [None; 4];
    for parameter in StokesParameter::ALL {
        let k = parameter.index();
        let Some(at) = columns.values[k] else { continue };
        let name = parameter.name();
        let text = cell(at, name)?;
        if text.is_empty() || text.eq_ignore_ascii_case("nan") {
            continue;
        }
        let jy = number(text, &format!("column {name}:"))?;
        let error = |at: usize| sigma(cell(at, "sigma")?, &format!("column sigma of {name}:"));
        let sigma_jy = columns.sigmas[k].map(error).transpose()?;
        stokes[k] = Some(Flux { jy, sigma_jy: sigma_jy.filter(|sigma| *sigma > 0.0) });
    }
    let by = columns.by.and_then(|at| cells.get(at)).map_or("", |by| by);
    Ok(Sample { time_h, stokes, by: by.to_owned() })
}

/// Reads hours of UTC from the column of times of a table, as [`parse`] finds it; of one with a single column, whatever it
/// is called.
///
/// # Errors
/// If there is no such column, or a cell of it is no number: with line, column and value.
pub fn parse_times(text: &str) -> Result<Vec<f64>, Error> {
    let (mut column, mut times, mut first_day) = (None, Vec::new(), None);
    for (index, line) in text.lines().enumerate() {
        let located = |message: String| FileError::line(index + 1, message);
        if line.trim().is_empty() || line.starts_with('#') {
            continue;
        }
        let Some((TimeColumn { at, unit }, count, tabs)) = column else {
            let cells = cells(line);
            let only = || (cells.len() == 1).then_some(TimeColumn { at: 0, unit: TimeUnit::Hours });
            let why = || located(format!("`{}` names no column time_utc_h", shown(line)));
            let (names, units) = names(line);
            let found = TimeColumn::find(&names).or_else(only).ok_or_else(why)?;
            found.check_unit(&names, &units).map_err(located)?;
            column = Some((found, names.len(), has_tabs(line, names.len())));
            // A column alone may have no name.
            if let [Ok(time)] = cells.iter().map(|cell| cell.parse()).collect::<Vec<_>>()[..] {
                times.push(time);
            }
            continue;
        };
        let cells = cells_below(line, count, tabs).map_err(located)?;
        let cell = cells.get(at).copied().unwrap_or_default();
        times.push(hours(cell, unit, &mut first_day).map_err(located)?);
    }
    if times.is_empty() {
        return Err(FileError::whole("no times").into());
    }
    if column.is_some_and(|(found, ..)| found.unit == TimeUnit::Hours) {
        over_midnight(&mut times, |time| time);
    }
    Ok(times)
}

/// The table that [`parse`] reads, with the columns that there are.
pub fn to_csv(curve: &LightCurve) -> String {
    let is_any = |k: usize| curve.samples.iter().any(|sample| sample.stokes[k].is_some());
    let kept: Vec<StokesParameter> =
        StokesParameter::ALL.into_iter().filter(|p| is_any(p.index())).collect();
    let by = curve.samples.iter().any(|sample| !sample.by.is_empty());
    let mut text = "time_utc_h".to_owned();
    kept.iter().for_each(|p| _ = write!(text, ",{0},sigma_{0}", p.name()));
    text.push_str(if by { ",baseline\n" } else { "\n" });
    for sample in &curve.samples {
        _ = write!(text, "{}", sample.time_h);
        for parameter in &kept {
            let flux = sample.stokes[parameter.index()];
            let (jy, sigma) = (flux.map(|f| f.jy), flux.and_then(|f| f.sigma_jy));
            _ = write!(text, ",{},{}", jy.unwrap_or(f64::NAN), sigma.unwrap_or(f64::NAN));
        }
        if by {
            _ = write!(text, ",{}", sample.by);
        }
        text.push('\n');
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exact_tables_come_back() {
        let flux = |jy: f64, sigma: f64| Some(Flux { jy, sigma_jy: Some(sigma) });
        let curve = LightCurve {
            samples: vec![
                Sample {
                    time_h: 9.25,
                    stokes: [flux(2.5, 0.1), flux(0.1, 0.01), None, None],
                    by: "A-B".into(),
                },
                Sample {
                    time_h: 9.5,
                    stokes: [flux(2.4, 0.1), None, None, None],
                    by: "A-B".into(),
                },
            ],
        };
        assert_eq!(parse(&to_csv(&curve)).unwrap(), curve);
    }

    #[test]
    fn exact_columns_of_others() {
        let text = "# ALMA\n,time,I,Q,U,V\n0,9.3,2.1,-0.1,0.2,0.0\n1,9.4,nan,-0.2,0.1,\n";
        let curve = parse(text).unwrap();
        assert_eq!(curve.samples[0].stokes[2], Some(Flux { jy: 0.2, sigma_jy: None }));
        assert_eq!((curve.samples[1].stokes[0], curve.samples[1].stokes[3]), (None, None));
        let shared = parse("t,Q,U,sigma\n1,0.1,0.2,0.01\n").unwrap();
        assert_eq!(shared.samples[0].stokes[1].unwrap().sigma_jy, Some(0.01));
        assert_eq!(parse_times("# hours\ntime_utc_h\n9.3\n9.4\n").unwrap(), [9.3, 9.4]);
        assert_eq!(parse_times("9.3\n9.4\n").unwrap(), [9.3, 9.4]);
    }

    /// Headings of other programs: units in brackets, blanks between columns, names in a comment, days.
    #[test]
    fn exact_headings_of_others() {
        let flux =
            |curve: &LightCurve, k: usize, stokes: usize| curve.samples[k].stokes[stokes].unwrap();
        let blanks =
            parse("# Time [UTC h]  Q [Jy]  U [Jy]  dQ  dU\n9.3 0.1 0.2 0.01 0.02\n").unwrap();
        assert_eq!(blanks.samples[0].time_h, 9.3);
        assert_eq!(flux(&blanks, 0, 2), Flux { jy: 0.2, sigma_jy: Some(0.02) });
        let days = parse("MJD,flux,flux_err\n57850.25,2.4,0.1\n57851.5,2.5,0.1\n").unwrap();
        assert_eq!((days.samples[0].time_h, days.samples[1].time_h), (6.0, 36.0));
        assert_eq!(flux(&days, 1, 0), Flux { jy: 2.5, sigma_jy: Some(0.1) });
        let julian = parse("JD\tI(Jy)\tI_err(Jy)\n2457851.25\t2.4\t0.1\n").unwrap();
        assert_eq!(julian.samples[0].time_h, 18.0);
        let hours = parse("time(hr),Stokes I,Isigma(Jy)\n4.0,2.4,0.1\n").unwrap();
        assert_eq!(flux(&hours, 0, 0).sigma_jy, Some(0.1));
        // A night over midnight, and two telescopes one after the other.
        let hours = |text: &str| -> Vec<f64> {
            let samples = parse(&format!("time,I\n{text}")).unwrap().samples;
            samples.iter().map(|sample| sample.time_h).collect()
        };
        assert_eq!(hours("23.75,1\n0,1\n0.25,1\n"), [23.75, 24.0, 24.25]);
        assert_eq!(hours("2,1\n1,1\n2,1\n2,3\n"), [1.0, 2.0, 2.0]);
        assert_eq!(hours("1,1\n14,1\n1,2\n15,1\n"), [1.0, 1.0, 14.0, 15.0]);
        // An empty cell between tabs is no measurement, and what follows stays where it is.
        let tabs = parse("time\tI\tcount\n1\t2.4\t50\n2\t\t50\n3\t2.5\t50\n").unwrap();
        assert_eq!(tabs.samples.iter().map(|s| s.time_h).collect::<Vec<_>>(), [1.0, 3.0]);
        assert!(is_light_curve("# t Q U\n1 2 3\n") && is_light_curve("UTC,I\n1,2\n"));
        assert!(!is_light_curve("# an image\n1,2,3\n") && !is_light_curve("1 2 3\n"));
    }

    #[test]
    fn exact_errors_name_line_column_and_value() {
        for (text, says) in [
            ("time,I\n1,2\n2,much\n", "line 3: column I: `much` is not a number"),
            ("time,I\n1,2\nlate,2\n", "line 3: column time: `late` is not a number"),
            ("time,I,sigma_I\n1,2,-1\n", "line 2: column sigma of I: = -1 Jy is not allowed"),
            ("when,I\n1,2\n", "line 1: `when,I` names no columns time_utc_h"),
            ("time,I,Q\n1,2\n", "line 2: column Q is missing"),
            ("time,I\n1e9,2\n", "line 2: column time: 1000000000 h is not allowed"),
            ("time,Q,Q\n1,2,3\n", "line 1: column `q` appears twice"),
            ("time,I\n1,2,3\n", "line 2: 3 cells, but 2 names"),
            ("JD,I\n7850.6,2\n", "line 2: column time: JD 7850.6 is not allowed: above 2400000.5"),
            ("i,time,flux\n0,1,2.4\n", "line 1: columns `i` and `flux` name the same flux"),
            ("time,I,I_err,sigma_I\n1,2,3,4\n", "columns `i_err` and `sigma_i` name the same flux"),
            ("time I count\n1 2\n", "line 2: 2 columns, but 3 names"),
            ("time (min),I\n1,2\n", "line 1: column `time` in `min` is not allowed: h"),
            ("time(h)\tI [mJy]\n1\t2\n", "line 1: column `i` in `mjy` is not allowed: jy"),
            ("# MJD [s] I\n1 2\n", "line 2: column `mjd` in `s` is not allowed: d"),
            ("", "no line names columns time_utc_h"),
        ] {
            let error = parse(text).unwrap_err().to_string();
            assert!(error.contains(says), "{text}: {error}");
        }
    }
}
