//! Tables of light curves: a time a line, columns separated by commas and told by a line of names.

use super::{FileError, number, sigma};
use crate::Error;
use crate::interferometry::light_curve::{Flux, LightCurve, Sample};
use crate::polarization::StokesParameter;
use core::fmt::Write;

/// Names of the column of times, hours of UTC.
const TIMES: [&str; 4] = ["time_utc_h", "time(utc)", "time", "t"];

/// Where the columns are.
struct Heading {
    time: usize,
    values: [Option<usize>; 4],
    sigmas: [Option<usize>; 4],
    by: Option<usize>,
}

impl Heading {
    fn find(names: &[&str]) -> Option<Self> {
        let at = |name: &str| names.iter().position(|n| n.eq_ignore_ascii_case(name));
        let value = |parameter: StokesParameter| {
            let name = parameter.name();
            at(name).or_else(|| at(&format!("{name}(Jy)"))).or_else(|| at(&format!("{name}_jy")))
        };
        let error = |parameter: StokesParameter| {
            let name = parameter.name();
            let names = [format!("sigma_{name}"), format!("{name}_err"), format!("{name}_error")];
            names.iter().find_map(|name| at(name)).or_else(|| at("sigma"))
        };
        let values = StokesParameter::ALL.map(value);
        values.iter().any(Option::is_some).then_some(())?;
        Some(Heading {
            time: TIMES.iter().find_map(|name| at(name))?,
            values,
            sigmas: StokesParameter::ALL.map(error),
            by: at("baseline"),
        })
    }
}

/// Whether the first line that is no comment names columns as those of a light curve: then it is meant to be one.
pub fn is_light_curve(text: &str) -> bool {
    let is_data = |line: &&str| !line.trim().is_empty() && !line.starts_with('#');
    let names: Vec<&str> = text
        .lines()
        .find(is_data)
        .map_or(Vec::new(), |line| line.split(',').map(str::trim).take(64).collect());
    let has = |name: &str| names.iter().any(|n| n.eq_ignore_ascii_case(name));
    let stokes = StokesParameter::ALL.iter().filter(|parameter| has(parameter.name())).count();
    stokes > 1 || Heading::find(&names).is_some()
}

/// Reads a table with a column of times (`time_utc_h`, `time` or `t`, hours of UTC) and any of I, Q, U and V in Jy, each
/// with a column of its standard deviations (`sigma_I`, `I_err`), or one `sigma` for all. Other columns, lines that start
/// with `#` and cells that are empty or `nan` are left out.
///
/// # Errors
/// If no line names the columns, a line has too few of them or no number where one belongs: with line, column and value.
pub fn parse(text: &str) -> Result<LightCurve, Error> {
    let (mut heading, mut samples) = (None, Vec::new());
    for (index, line) in text.lines().enumerate() {
        let located = |message: String| FileError::line(index + 1, message);
        if line.trim().is_empty() || line.starts_with('#') {
            continue;
        }
        let cells: Vec<&str> = line.split(',').map(str::trim).take(64).collect();
        let Some(columns) = &heading else {
            let why = || located(format!("`{}` names no {}", shown(line), wanted()));
            heading = Some(Heading::find(&cells).ok_or_else(why)?);
            continue;
        };
        samples.push(sample(&cells, columns).map_err(located)?);
    }
    if heading.is_none() {
        return Err(FileError::whole(format!("no line names {}", wanted())).into());
    }
    if samples.is_empty() {
        return Err(FileError::whole("no fluxes").into());
    }
    samples.sort_by(|a: &Sample, b: &Sample| a.time_h.total_cmp(&b.time_h));
    Ok(LightCurve { samples })
}

fn wanted() -> &'static str {
    "columns time_utc_h (hours of UTC) and any of I, Q, U, V (Jy)"
}

fn shown(line: &str) -> String {
    line.chars().take(40).collect()
}

fn sample(cells: &[&str], columns: &Heading) -> Result<Sample, String> {
    let cell = |at: usize, name: &str| {
        let count = cells.len();
        cells.get(at).copied().ok_or_else(|| format!("column {name} is missing: {count} cells"))
    };
    let time_h = number(cell(columns.time, "time")?, "column time:")?;
    if !(-1e4..=1e4).contains(&time_h) {
        return Err(format!("column time: {time_h} h is not allowed: hours of UTC"));
    }
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

/// Reads hours of UTC from the column `time_utc_h`, `time` or `t` of a table; of one with a single column, whatever it
/// is called.
///
/// # Errors
/// If there is no such column, or a cell of it is no number: with line, column and value.
pub fn parse_times(text: &str) -> Result<Vec<f64>, Error> {
    let (mut column, mut times) = (None, Vec::new());
    for (index, line) in text.lines().enumerate() {
        let located = |message: String| FileError::line(index + 1, message);
        if line.trim().is_empty() || line.starts_with('#') {
            continue;
        }
        let cells: Vec<&str> = line.split(',').map(str::trim).take(64).collect();
        let Some(at) = column else {
            let named = |name: &str| cells.iter().position(|n| n.eq_ignore_ascii_case(name));
            let only = || (cells.len() == 1).then_some(0);
            let why = || located(format!("`{}` names no column time_utc_h", shown(line)));
            column = Some(TIMES.iter().find_map(|name| named(name)).or_else(only).ok_or_else(why)?);
            continue;
        };
        let cell = cells.get(at).copied().unwrap_or_default();
        times.push(number(cell, "column time:").map_err(located)?);
    }
    if times.is_empty() {
        return Err(FileError::whole("no times").into());
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
            ("", "no line names columns time_utc_h"),
        ] {
            let error = parse(text).unwrap_err().to_string();
            assert!(error.contains(says), "{text}: {error}");
        }
    }
}
