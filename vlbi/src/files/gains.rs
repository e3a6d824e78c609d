//! Tables of station gains: a station at a time a line, columns told by a line of names.

use super::{FileError, between, number, over_midnight};
use crate::Complex64;
use crate::Error;
use crate::gains::{GainTable, StationGain};
use core::fmt::Write;
use std::collections::HashSet;

/// Names of the columns, in the order in which they are written.
pub const COLUMNS: [&str; 7] = [
    "time_utc_h",
    "span_s",
    "station",
    "amplitude",
    "amplitude_error",
    "phase_deg",
    "phase_error_deg",
];
/// Those that a table may lack: phases are then 0 and were not solved for, and errors are not known.
const OPTIONAL: [&str; 3] = ["amplitude_error", "phase_deg", "phase_error_deg"];
/// Columns without those of phases.
const AMPLITUDES: usize = 5;

/// A table as CSV. `amplitude_error` is the standard deviation of |g|; errors that are not known are empty. Phases that were
/// not solved for have no columns.
pub fn to_csv(table: &GainTable) -> String {
    let has_phases = table.has_phases();
    let columns = if has_phases { &COLUMNS[..] } else { &COLUMNS[..AMPLITUDES] };
    let mut text = columns.join(",") + "\n";
    let known = |x: f64| if x.is_finite() { format!("{x:.6}") } else { String::new() };
    for StationGain { time_h, span_s, station, gain, errors } in &table.gains {
        let amplitude = gain.norm();
        let of_amplitude = known(errors[0] * amplitude);
        // Writing to a string does not fail.
        let _ = write!(text, "{time_h:.9},{span_s},{station},{amplitude:.9},{of_amplitude}");
        if has_phases {
            let (phase, of_phase) = (gain.arg().to_degrees(), known(errors[1].to_degrees()));
            let _ = write!(text, ",{phase:.7},{of_phase}");
        }
        text.push('\n');
    }
    text
}

/// Reads such a table; lines that start with `#` are left out.
///
/// # Errors
/// If no line names the columns, a line has too few of them or no number where one belongs, an amplitude or a span is not
/// positive, or there are no gains: with line, column and value.
pub fn parse(text: &str) -> Result<GainTable, Error> {
    let (mut places, mut gains, mut known) = (None, Vec::new(), HashSet::new());
    for (index, line) in text.lines().enumerate() {
        if line.trim().is_empty() || line.starts_with('#') {
            continue;
        }
        let located = |message: String| FileError::line(index + 1, message);
        let cells = between(',', line);
        match &places {
            None => places = Some((heading(&cells).map_err(located)?, cells.len())),
            Some((_, names)) if cells.len() > *names => {
                let message = format!("{} columns, but {names} names", cells.len());
                return Err(located(message).into());
            }
            Some((places, _)) => {
                let gain = gain(&cells, places).map_err(located)?;
                if !known.insert((gain.time_h.to_bits(), gain.station.clone())) {
                    let (station, time_h) = (&gain.station, gain.time_h);
                    return Err(located(format!("{station} is there twice at {time_h} h")).into());
                }
                gains.push(gain);
            }
        }
    }
    if gains.is_empty() {
        return Err(FileError::whole("no gains").into());
    }
    over_midnight(&mut gains, |gain| &mut gain.time_h);
    gains.sort_by(|a: &StationGain, b: &StationGain| a.time_h.total_cmp(&b.time_h));
    Ok(GainTable { gains })
}

/// Place of each of [`COLUMNS`].
type Places = [Option<usize>; COLUMNS.len()];

fn heading(cells: &[&str]) -> Result<Places, String> {
    let times = |name: &str| cells.iter().filter(|cell| cell.eq_ignore_ascii_case(name)).count();
    if let Some(twice) = COLUMNS.iter().find(|name| times(name) > 1) {
        return Err(format!("column `{twice}` appears twice"));
    }
    // A gain of another name or unit is not passed over: its phase would count as 0.
    let is_other = |cell: &str| {
        let name = cell.to_ascii_lowercase();
        ["phase", "amp"].iter().any(|start| name.starts_with(start))
            && !COLUMNS.contains(&name.as_str())
    };
    if let Some(other) = cells.iter().find(|cell| is_other(cell)) {
        let allowed = COLUMNS[3..].join(", ");
        return Err(format!("column `{}` is not allowed: {allowed}", super::shortened(other)));
    }
    let places = COLUMNS.map(|name| cells.iter().position(|cell| cell.eq_ignore_ascii_case(name)));
    let missing =
        COLUMNS.iter().zip(places).find(|(name, at)| at.is_none() && !OPTIONAL.contains(name));
    match missing {
        Some((name, _)) => Err(format!("there is no column {name}")),
        None => Ok(places),
    }
}

fn gain(cells: &[&str], places: &Places) -> Result<StationGain, String> {
    let cell = |k: usize| {
        let at = places[k].unwrap_or(usize::MAX);
        cells.get(at).copied().ok_or_else(|| format!("column {} is missing", COLUMNS[k]))
    };
    let value = |k: usize| number(cell(k)?, &format!("column {}:", COLUMNS[k]));
    let error = |k: usize| match cell(k) {
        Ok(text) if !text.is_empty() => number(text, &format!("column {}:", COLUMNS[k])),
        _ => Ok(f64::NAN),
    };
    let (time_h, span_s, amplitude) = (value(0)?, value(1)?, value(3)?);
    if span_s < 0.0 {
        return Err(format!("column span_s: {span_s} s is not allowed: 0 or above"));
    }
    if amplitude <= 0.0 {
        return Err(format!("column amplitude: {amplitude} is not allowed: above 0"));
    }
    let (phase, of_phase) = match places[5] {
        Some(_) => (value(5)?, error(6)?.to_radians()),
        None => (0.0, 0.0),
    };
    let gain = Complex64::from_polar(amplitude, phase.to_radians());
    // The column has the error of |g|, the table that of ln|g|.
    let errors = [error(4)? / amplitude, of_phase];
    Ok(StationGain { time_h, span_s, station: cell(2)?.to_owned(), gain, errors })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::array::Station;
    use crate::observation::{Basis, Measured, Observation, Row};

    fn table() -> GainTable {
        let one = |time_h: f64, station: &str, amplitude: f64, phase: f64| StationGain {
            time_h,
            span_s: 60.0,
            station: station.to_owned(),
            gain: Complex64::from_polar(amplitude, phase),
            errors: [0.01, 0.02],
        };
        GainTable { gains: vec![one(1.0, "AA", 1.1, 0.3), one(1.0, "LM", 0.6, -2.0)] }
    }

    #[test]
    fn exact_what_is_written_is_read() {
        let read = parse(&to_csv(&table())).unwrap();
        assert_eq!(read.gains.len(), 2);
        for (a, b) in read.gains.iter().zip(&table().gains) {
            assert!((a.gain - b.gain).norm() < 1e-8 && a.station == b.station);
            assert_eq!((a.time_h, a.span_s), (b.time_h, b.span_s));
            assert!((a.errors[0] - 0.01).abs() < 1e-5 && (a.errors[1] - 0.02).abs() < 1e-5);
        }
    }

    /// Phases that were not solved for are not told as 0 ± 0; those of gains that were put on are known.
    #[test]
    fn exact_unknown_phases_have_no_columns() {
        let mut table = table();
        for gain in &mut table.gains {
            (gain.gain, gain.errors) = (gain.gain.norm().into(), [0.01, 0.0]);
        }
        let text = to_csv(&table);
        assert!(!text.contains("phase"), "{text}");
        let read = parse(&text).unwrap();
        assert!(!read.has_phases());
        table.gains[1].errors[1] = f64::NAN;
        assert!(to_csv(&table).contains("phase_deg"));
    }

    #[test]
    fn exact_bad_tables_are_refused_by_line() {
        let head = "time_utc_h,span_s,station,amplitude,phase_deg\n";
        for (text, says) in [
            ("time_utc_h,station\n".to_owned(), "line 1: there is no column span_s"),
            (format!("{head}1.0,60,AA,-1,0\n"), "line 2: column amplitude: -1 is not allowed"),
            (format!("{head}1.0,60,AA,x,0\n"), "line 2: column amplitude: `x` is not a number"),
            (format!("{head}1.0,60,AA,1\n"), "line 2: column phase_deg is missing"),
            (format!("{head}1.0,-5,AA,1,0\n"), "line 2: column span_s: -5 s is not allowed"),
            (format!("{head}1.0,60,AA,1,0,7\n"), "line 2: 6 columns, but 5 names"),
            (format!("span_s,{head}60,1.0,60,AA,1,0\n"), "line 1: column `span_s` appears twice"),
            (format!("{head}1.0,60,AA,1,0\n1.0,60,AA,2,0\n"), "line 3: AA is there twice at 1 h"),
            (head.to_owned(), "no gains"),
        ] {
            let error = parse(&text).unwrap_err().to_string();
            assert!(error.contains(says), "{error}");
        }
        assert!(parse(&format!("{head}1.0,60,AA,1,0\n")).unwrap().gains[0].errors[0].is_nan());
    }

    /// Gains that were put on are taken out; what has none is left out.
    #[test]
    fn exact_gains_are_taken_out() {
        let mut observation = Observation::empty(Basis::Stokes);
        observation.stations = ["AA", "LM", "PV"].map(Station::named).to_vec();
        let g = table().gains[0].gain * table().gains[1].gain.conj();
        let i = Measured { visibility: g * Complex64::new(0.5, 0.2), noise_sigma: 0.1 * g.norm() };
        let row = |time_h: f64, stations| Row::total_intensity(time_h, stations, [1.0, 0.0], i);
        observation.rows =
            vec![row(1.01, [0, 1]), row(1.0, [0, 2]), row(2.0, [0, 1]), row(1.0, [0, 1])];
        assert_eq!(table().take_out(&mut observation), 2);
        for row in &observation.rows {
            assert!((row.products[0] - Complex64::new(0.5, 0.2)).norm() < 1e-12);
            assert!((row.noise_sigma[0] - 0.1).abs() < 1e-12);
        }
    }
}
