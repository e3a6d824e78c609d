//! Arguments that tell an array, a source and a schedule.

use crate::output;
use anyhow::{Context, anyhow, bail};
use clap::Args;
use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
use kerrlight_vlbi::array::{self, Array};
use kerrlight_vlbi::earth::{Frame, SourcePosition, Ut1};
use kerrlight_vlbi::schedule::{Clock, Schedule, Setup};
use kerrlight_vlbi::source::Source;
use std::path::Path;

/// Two numbers as `a-b`; each may have a sign.
pub fn range(text: &str) -> Result<[f64; 2], String> {
    let bad = || format!("`{text}` is not of the form FROM-TO");
    let split = text.char_indices().skip(1).find(|(k, c)| {
        // A sign of an exponent or of the second number is no separator.
        *c == '-' && text[..*k].ends_with(|p: char| p.is_ascii_digit() || p == '.')
    });
    let (from, to) = split.map(|(k, _)| (&text[..k], &text[k + 1..])).ok_or_else(bad)?;
    let number = |cell: &str| cell.trim().parse().ok().filter(|x: &f64| x.is_finite());
    Ok([number(from).ok_or_else(bad)?, number(to).ok_or_else(bad)?])
}

/// A built-in array, or one of a file in eht-imaging's format.
pub fn array_of(name: &str) -> anyhow::Result<Array> {
    array_near(name, Path::new(""))
}

/// The same, with a file that lies in a folder.
pub fn array_near(name: &str, folder: &Path) -> anyhow::Result<Array> {
    if let Some(array) = array::built_in(name) {
        return Ok(array);
    }
    let path = folder.join(name);
    let shown = path.display();
    if !path.exists() {
        bail!("array {name}: neither {} nor a file ({shown})", array::BUILT_IN.join(" nor "));
    }
    array::parse(&output::read_text(&path)?).with_context(|| format!("array {shown}"))
}

/// Values of an option by their names, with what its help says of them.
pub fn named<T: Copy + Send + Sync + 'static, const N: usize>(
    all: [(&'static str, &'static str, T); N],
) -> impl TypedValueParser<Value = T> {
    let names = all.map(|(name, help, _)| PossibleValue::new(name).help(help));
    PossibleValuesParser::new(names).map(move |name| {
        all.iter().find(|(known, ..)| *known == name).expect("one of the names above").2
    })
}

/// When, where to, and with what receivers.
#[derive(Debug, Clone, Args)]
pub struct Observing {
    /// Source: sgra, m87, or right ascension in hours and declination in degrees
    #[arg(long, value_name = "sgra|m87|RA,DEC")]
    pub source: Source,
    /// Day (modified Julian date) whose 0 h UTC hours count from
    #[arg(long, value_name = "DAY", value_parser = clap::value_parser!(i32).range(41317..=90000))]
    pub mjd: i32,
    /// Hours of UTC; scan k of N starts at FROM + k (TO - FROM)/N
    #[arg(long, value_name = "FROM-TO", value_parser = range, allow_hyphen_values = true,
          required_unless_present = "gmst", conflicts_with = "gmst")]
    pub utc: Option<[f64; 2]>,
    /// The same in hours of Greenwich mean sidereal time
    #[arg(long, value_name = "FROM-TO", value_parser = range, allow_hyphen_values = true)]
    pub gmst: Option<[f64; 2]>,
    /// Number of scans
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=1_000_000))]
    pub frames: u32,
    /// Integration time of a scan in seconds
    #[arg(long, value_name = "SECONDS", allow_negative_numbers = true)]
    pub tint: f64,
    /// Frequency in GHz
    #[arg(
        long,
        value_name = "GHZ",
        default_value_t = 226.191_789_062_5,
        allow_negative_numbers = true
    )]
    pub frequency: f64,
    /// Bandwidth in GHz
    #[arg(long, value_name = "GHZ", default_value_t = 1.856, allow_negative_numbers = true)]
    pub bandwidth: f64,
    /// Elevations in degrees between which stations observe
    #[arg(long, value_name = "FROM-TO", value_parser = range, default_value = "10-85",
          allow_hyphen_values = true)]
    pub elevation: [f64; 2],
    /// Earth-orientation model
    #[arg(long, value_name = "FRAME", default_value = "catalogue", value_parser = named([
        ("catalogue", "Catalogue coordinates as if they were of date, mean sidereal time (eht-imaging's way)", Frame::Catalogue),
        ("of-date", "Precession and nutation to date", Frame::OfDate),
    ]))]
    pub frame: Frame,
    /// UT1 - UTC in seconds, instead of the built-in table's (1999 to September 2026)
    #[arg(long, value_name = "SECONDS", allow_hyphen_values = true)]
    pub ut1_utc: Option<f64>,
}

impl Observing {
    /// Returns the schedule of the scans.
    pub fn schedule(&self) -> anyhow::Result<Schedule> {
        let (clock, hours) = match (self.utc, self.gmst) {
            (Some(hours), _) => (Clock::Utc, hours),
            (None, Some(hours)) => (Clock::Gmst, hours),
            (None, None) => return Err(anyhow!("--utc or --gmst is needed")),
        };
        let [start_h, stop_h] = hours;
        Ok(Schedule { mjd: self.mjd, clock, start_h, stop_h, scans: self.frames })
    }

    /// Receivers and conventions.
    pub fn setup(&self) -> anyhow::Result<Setup> {
        for (name, ghz) in [("--frequency", self.frequency), ("--bandwidth", self.bandwidth)] {
            if !(1e-3..=1e6).contains(&ghz) {
                bail!("{name} {ghz} is not allowed: GHz in [1e-3, 1e6]");
            }
        }
        let ut1 = match self.ut1_utc {
            None => Ut1::Table,
            Some(seconds) if seconds.abs() < 1.0 => Ut1::Given(seconds),
            Some(seconds) => bail!("--ut1-utc {seconds} is not allowed: seconds in (-1, 1)"),
        };
        Ok(Setup {
            frequency_hz: self.frequency * 1e9,
            bandwidth_hz: self.bandwidth * 1e9,
            integration_s: self.tint,
            elevation_deg: self.elevation,
            ut1,
            frame: self.frame,
        })
    }

    /// Everything that decides the observation, in one line each.
    pub fn history(&self, array: &str) -> Vec<String> {
        let SourcePosition { ra_hours, dec_deg } = self.source.position;
        let (clock, [from, to]) = match (self.utc, self.gmst) {
            (Some(hours), _) => ("UTC", hours),
            (None, hours) => ("GMST", hours.unwrap_or_default()),
        };
        let [low, high] = self.elevation;
        let ut1 = self.ut1_utc.map_or("IERS table".to_owned(), |s| format!("{s} s"));
        vec![
            format!("array {array}, elevation {low} to {high} deg"),
            format!("source {}: RA {ra_hours} h, Dec {dec_deg} deg", self.source.name),
            format!(
                "MJD {}, {from} to {to} h {clock}, {} scans of {} s",
                self.mjd, self.frames, self.tint
            ),
            format!("{} GHz, bandwidth {} GHz", self.frequency, self.bandwidth),
            format!("frame {:?}, UT1-UTC {ut1}", self.frame),
        ]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exact_ranges() {
        assert_eq!(range("4.0-15.5"), Ok([4.0, 15.5]));
        assert_eq!(range("-1-2"), Ok([-1.0, 2.0]));
        assert_eq!(range("-2--1"), Ok([-2.0, -1.0]));
        assert_eq!(range("1e-3-2"), Ok([1e-3, 2.0]));
        assert!(range("4").is_err() && range("a-b").is_err() && range("1-inf").is_err());
    }
}
