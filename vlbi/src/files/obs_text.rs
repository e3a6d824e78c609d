//! eht-imaging's text format of observations: a heading with source, date, frequency and
//! stations, then 20 columns, amplitudes in Jy and phases in degrees.

use super::{
    FileError, MOST_HOURS, MOST_WAVELENGTHS, Names, check_located, locate, number, number_within,
    sigma,
};
use crate::Complex64;
use crate::Error;
use crate::array;
use crate::observation::{Basis, MissingMetadata, Observation, Row};
use core::fmt::Write;

/// Columns of the data.
const COLUMNS: usize = 20;

/// Opacity of a sky through which nothing comes.
const MOST_OPACITY: f64 = 1e6;

/// Returns whether a text begins as these do.
pub(super) fn is_obs_text(text: &str) -> bool {
    let mut words = text.split_whitespace();
    words.next() == Some("#") && words.next() == Some("SRC:") && text.contains("\n# RA:")
}

/// Reads an observation.
///
/// # Errors
/// If a line of the heading is missing, or a line of data has another number of columns, an
/// unknown station, or no number where one belongs.
pub fn parse(text: &str) -> Result<Observation, Error> {
    let mut observation = Observation::empty(Basis::Stokes);
    let mut names = Names::new(Vec::new());
    let mut has_columns = false;
    observation.rows = Vec::with_capacity(super::rows_at_most(text));
    for (index, line) in text.lines().enumerate() {
        let located = |message: String| FileError::line(index + 1, message);
        if let Some(heading) = line.strip_prefix('#') {
            let found = read_heading(heading, &mut observation, &mut names).map_err(located)?;
            has_columns |= found;
        } else if !line.trim().is_empty() {
            if !has_columns {
                return Err(located("data before the heading `# time (hr) ...`".to_owned()).into());
            }
            let row = row(line, &names).map_err(located)?;
            observation.rows.push(row);
        }
    }
    if observation.rows.is_empty() {
        return Err(FileError::whole("no visibilities").into());
    }
    check_located(&observation)?;
    let complete = observation.position.is_some()
        && observation.mjd.is_some()
        && observation.frequency_hz.is_some();
    if !complete {
        return Err(FileError::whole("the heading lacks RA, DEC, MJD or RF").into());
    }
    observation.stations = names.stations;
    Ok(observation)
}

/// Takes in a line of the heading; tells whether it is the one that names the columns.
fn read_heading(
    line: &str,
    observation: &mut Observation,
    names: &mut Names,
) -> Result<bool, String> {
    let words: Vec<&str> = line.split_whitespace().take(40).collect();
    let first = || words.get(1).copied().unwrap_or_default();
    match words.first().copied().unwrap_or_default() {
        "SRC:" => observation.source = words[1..].join(" "),
        "RA:" => locate(observation, Some(sexagesimal(&words, "RA")?), None)?,
        "DEC:" => locate(observation, None, Some(sexagesimal(&words, "DEC")?))?,
        "MJD:" => {
            let mjd = number(first(), "MJD")?;
            if !(0.0..=1e6).contains(&mjd) || mjd.fract() != 0.0 {
                return Err(format!("MJD = {mjd} is not allowed: a whole number in [0, 1e6]"));
            }
            observation.mjd = Some(mjd as i32);
        }
        "RF:" => observation.frequency_hz = Some(gigahertz(&words, "RF")?),
        "BW:" => observation.bandwidth_hz = Some(gigahertz(&words, "BW")?),
        key if CALIBRATIONS.contains(&key) => {
            if matches!(first(), "0" | "False") {
                observation.history.push(format!("{key} 0"));
            }
        }
        "HISTORY:" => observation.history.push(words[1..].join(" ")),
        "time" => {
            observation.basis = columns(line, &words)?;
            return Ok(true);
        }
        _ => {
            // Lines of other headings are passed over.
            let is_station = matches!(words.len(), 5 | 13)
                && words[1..].iter().all(|word| word.parse::<f64>().is_ok());
            if is_station {
                names.add(&words)?;
            }
        }
    }
    Ok(false)
}

/// The products of a basis in the order of their columns.
fn hands(basis: Basis) -> [&'static str; 4] {
    match basis {
        Basis::Stokes => ["I", "Q", "U", "V"],
        Basis::Circular => ["RR", "LL", "RL", "LR"],
    }
}

/// The basis that the columns are in; refuses others, another order, or other units.
fn columns(line: &str, words: &[&str]) -> Result<Basis, String> {
    let (start, wanted) = (
        words.get(..11).unwrap_or_default(),
        "time (hr) tint T1 T2 Tau1 Tau2 U (lambda) V (lambda)",
    );
    if start.join(" ") != wanted {
        return Err(format!("`{}` is not allowed: {wanted}", start.join(" ")));
    }
    let basis = match words.get(11) {
        Some(&"Iamp") => Basis::Stokes,
        Some(&"RRamp") => Basis::Circular,
        _ => return Err("neither Iamp nor RRamp follows V (lambda)".to_owned()),
    };
    let data =
        hands(basis).into_iter().flat_map(|hand| [format!("{hand}amp"), format!("{hand}phase")]);
    let names = data.chain(hands(basis).map(|hand| format!("{hand}sigma")));
    let named = words[11..].iter().filter(|word| !word.starts_with('('));
    let named = named.map(|word| word.split('(').next().unwrap_or_default());
    if let Some((named, name)) = named.zip(names).find(|(named, name)| named != name) {
        return Err(format!("`{}` is not allowed: {name}", super::shortened(named)));
    }
    let mut units = line.split('(').skip(1).filter_map(|rest| rest.split(')').next());
    match units.find(|unit| !["hr", "lambda", "Jy", "d"].contains(unit)) {
        Some(unit) => {
            Err(format!("unit `{}` is not allowed: hr, lambda, Jy, d", super::shortened(unit)))
        }
        None => Ok(basis),
    }
}

/// `230.0 GHz`, in Hz.
fn gigahertz(words: &[&str], name: &str) -> Result<f64, String> {
    let value = number(words.get(1).copied().unwrap_or_default(), name)?;
    match words.get(2) {
        Some(unit) if *unit != "GHz" => {
            Err(format!("{name} in `{}` is not allowed: GHz", super::shortened(unit)))
        }
        _ if value > 0.0 => Ok(value * 1e9),
        _ => Err(format!("{name} = {value} GHz must be positive")),
    }
}

/// `17 h 45 m 40.036 s`, `-29 deg 0 m 28.2 s`.
fn sexagesimal(words: &[&str], name: &str) -> Result<f64, String> {
    let part = |k: usize| number(words.get(k).copied().unwrap_or_default(), name);
    let (whole, minutes, seconds) = (part(1)?, part(3)?, part(5)?);
    // Seconds that are rounded may be 60.
    if let Some(part) = [minutes, seconds].into_iter().find(|part| !(0.0..=60.0).contains(part)) {
        return Err(format!("{name}: {part} minutes or seconds are not allowed: [0, 60]"));
    }
    let size = whole.abs() + minutes / 60.0 + seconds / 3600.0;
    // Of `-0` the sign counts too.
    Ok(if whole.is_sign_negative() { -size } else { size })
}

fn row(line: &str, names: &Names) -> Result<Row, String> {
    let mut words = line.split_whitespace();
    let cells: [&str; COLUMNS] = core::array::from_fn(|_| words.next().unwrap_or_default());
    let count = line.split_whitespace().count();
    if count != COLUMNS {
        return Err(format!("{count} columns: {COLUMNS} are expected"));
    }
    let value = |k: usize, name| number(cells[k], name);
    let station = |k: usize| {
        names.known(cells[k]).ok_or_else(|| {
            format!("station `{}` is not in the heading", super::shortened(cells[k]))
        })
    };
    let mut products = [Complex64::new(0.0, 0.0); 4];
    let mut noise_sigma = [f64::NAN; 4];
    for k in 0..4 {
        let amplitude = cells[8 + 2 * k];
        let phase = cells[9 + 2 * k];
        let error = sigma(cells[16 + k], "sigma")?;
        // eht-imaging writes products that are not there as `nan`.
        if error.is_nan() || amplitude.eq_ignore_ascii_case("nan") {
            continue;
        }
        let phase = number(phase, "phase")?.to_radians();
        products[k] = Complex64::from_polar(number(amplitude, "amplitude")?, phase);
        noise_sigma[k] = error;
    }
    if noise_sigma.iter().all(|sigma| sigma.is_nan()) {
        return Err("none of the four products has a visibility and an error".to_owned());
    }
    let integration_s = value(1, "tint")?;
    if !(0.0..=1e9).contains(&integration_s) {
        return Err(format!("tint = {integration_s} s is not allowed: [0, 1e9]"));
    }
    let within = |k: usize, name, most| number_within(cells[k], name, most);
    let stations = [station(2)?, station(3)?];
    if stations[0] == stations[1] {
        return Err(format!("a baseline of station {} with itself", cells[2]));
    }
    Ok(Row {
        time_h: within(0, "time", MOST_HOURS)?,
        integration_s,
        stations,
        uv: [within(6, "u", MOST_WAVELENGTHS)?, within(7, "v", MOST_WAVELENGTHS)?],
        products,
        noise_sigma,
        opacity: [within(4, "tau1", MOST_OPACITY)? as f32, within(5, "tau2", MOST_OPACITY)? as f32],
        channel: 0,
    })
}

/// The observation as eht-imaging's text, numbers with all their digits.
///
/// # Errors
/// If the source's position, the date or the frequency is not known, there are several spectral
/// channels, or something is not a finite number.
pub fn to_text(observation: &Observation) -> Result<String, Error> {
    super::one_channel(observation)?;
    super::check_numbers(observation)?;
    let position = observation
        .position
        .ok_or(MissingMetadata("the source's right ascension and declination"))?;
    let mjd = observation.mjd.ok_or(MissingMetadata("the date (MJD)"))?;
    let frequency = observation.frequency_hz.ok_or(MissingMetadata("the frequency"))?;
    let bandwidth = observation.bandwidth_hz.ok_or(MissingMetadata("the bandwidth"))?;
    let mut text = format!(
        "# SRC: {}\n# RA: {}\n# DEC: {}\n# MJD: {mjd}\n# RF: {} GHz\n# BW: {} GHz\n",
        observation.source.replace(char::is_control, " "),
        parts(position.ra_hours, "h"),
        parts(position.dec_deg, "deg"),
        frequency / 1e9,
        bandwidth / 1e9
    );
    for flag in CALIBRATIONS {
        let is_missing = observation.history.iter().any(|line| *line == format!("{flag} 0"));
        let _ = writeln!(text, "# {flag} {}", u8::from(!is_missing));
    }
    let rule = "-".repeat(136);
    let _ = writeln!(text, "# {rule}\n# {}", array::HEADING);
    for station in &observation.stations {
        let _ = writeln!(text, "# {}", array::columns(station));
    }
    let hands = hands(observation.basis);
    let _ = write!(text, "# {rule}\n# time (hr) tint T1 T2 Tau1 Tau2 U (lambda) V (lambda)");
    hands.iter().for_each(|hand| {
        let _ = write!(text, " {hand}amp (Jy) {hand}phase(d)");
    });
    hands.iter().for_each(|hand| {
        let _ = write!(text, " {hand}sigma (Jy)");
    });
    text.push('\n');
    observation.rows.iter().for_each(|row| write_row(&mut text, observation, row));
    // Last: eht-imaging counts the lines of the heading, and passes over comments below it.
    let is_told = |line: &&String| !CALIBRATIONS.iter().any(|flag| **line == format!("{flag} 0"));
    observation.history.iter().filter(is_told).for_each(|line| {
        let _ = writeln!(text, "# HISTORY: {}", line.replace(char::is_control, " "));
    });
    Ok(text)
}

fn write_row(text: &mut String, observation: &Observation, row: &Row) {
    let [t1, t2] = observation.names(row);
    let [tau1, tau2] = row.opacity;
    let Row { time_h, integration_s, uv: [u, v], .. } = *row;
    // Writing into a string cannot fail.
    let _ = write!(text, "{time_h} {integration_s} {t1} {t2} {tau1} {tau2} {u} {v}");
    for k in 0..4 {
        let _ = match row.product(k) {
            Some(m) => {
                let (amplitude, phase) = m.visibility.to_polar();
                write!(text, " {amplitude} {}", phase.to_degrees())
            }
            None => write!(text, " nan nan"),
        };
    }
    for sigma in row.noise_sigma {
        let _ =
            write!(text, " {}", if sigma.is_nan() { "nan".to_owned() } else { sigma.to_string() });
    }
    text.push('\n');
}

/// Headings that say what has been calibrated.
const CALIBRATIONS: [&str; 5] = ["PHASECAL:", "AMPCAL:", "OPACITYCAL:", "DCAL:", "FRCAL:"];

/// Whole, minutes and seconds of hours or degrees.
fn parts(value: f64, unit: &str) -> String {
    let size = value.abs();
    let whole = size.trunc();
    let minutes = ((size - whole) * 60.0).trunc();
    let seconds = ((size - whole) * 60.0 - minutes) * 60.0;
    let sign = if value < 0.0 { "-" } else { "" };
    format!("{sign}{whole} {unit} {minutes} m {seconds:.10} s")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::files::uvfits::tests::small;

    #[test]
    fn exact_round_trip() {
        // A source's name ends no line.
        let observation = Observation { source: "a\n0 1".to_owned(), ..small() };
        let text = to_text(&observation).unwrap();
        let back = parse(&text).unwrap();
        assert_eq!(back.source, "a 0 1");
        assert!((back.position.unwrap().ra_hours - 17.76).abs() < 1e-13);
        assert!((back.position.unwrap().dec_deg + 0.25).abs() < 1e-13);
        assert_eq!(back.stations, observation.stations);
        assert_eq!((back.mjd, back.basis), (observation.mjd, observation.basis));
        for (a, b) in observation.rows.iter().zip(&back.rows) {
            assert_eq!((a.time_h, a.uv, a.stations), (b.time_h, b.uv, b.stations));
            assert_eq!((a.integration_s, a.opacity), (b.integration_s, b.opacity));
            for k in 0..4 {
                assert_eq!(a.noise_sigma[k].to_bits(), b.noise_sigma[k].to_bits());
                assert!((a.products[k] - b.products[k]).norm() < 1e-15);
            }
        }
    }

    #[test]
    fn exact_errors_name_the_line() {
        let good = to_text(&small()).unwrap();
        let last = good.lines().count();
        let fail = |text: &str| parse(text).unwrap_err().to_string();
        assert!(
            fail(&good.replace("# MJD: 57850", "# MJD: soon")).starts_with("line 4: MJD `soon`")
        );
        assert!(fail(&good.replace("# MJD: 57850\n", "")).contains("lacks"));
        assert!(fail(&good.replace("# DEC:", "# DECL:")).contains("declination is missing"));
        assert!(fail(&good.replace("230 GHz", "230 MHz")).contains("RF in `MHz` is not allowed"));
        let row = good.lines().last().unwrap();
        let cells: Vec<&str> = row.split_whitespace().collect();
        for tint in ["1e300", "-1"] {
            let changed = [&cells[..1], &[tint], &cells[2..]].concat().join(" ");
            assert!(fail(&good.replace(row, &changed)).contains("tint = "), "{tint}");
        }
        let history = parse(&good.replace("FRCAL: 1", "FRCAL: 0")).unwrap().history;
        assert_eq!(history, ["FRCAL: 0"]);
        let message = fail(&format!("{good}1 2 3\n"));
        assert!(message.starts_with(&format!("line {}: 3 columns", last + 1)), "{message}");
        assert!(fail(&good.replace(" AA CC ", " AA XX ")).contains("station `XX`"));
        assert!(fail(&good.replace("time (hr)", "times (hr)")).contains("before the heading"));
        let swapped = good.replace("U (lambda) V (lambda)", "V (lambda) U (lambda)");
        assert!(fail(&swapped).contains("Tau2 U (lambda) V (lambda)"), "{}", fail(&swapped));
        let other = good.replace("LLamp", "RLamp");
        assert!(fail(&other).contains("`RLamp` is not allowed: LLamp"), "{}", fail(&other));
        let minutes = good.replacen(" m ", "5 m ", 1);
        assert!(fail(&minutes).contains("RA: 455 minutes or seconds"), "{}", fail(&minutes));
        let milli = good.replace("sigma (Jy)", "sigma (mJy)");
        assert!(fail(&milli).contains("unit `mJy` is not allowed"), "{}", fail(&milli));
    }
}
