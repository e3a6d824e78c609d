//! When the frames of a film are.

use anyhow::{Context, bail};
use clap::Args;
use kerrlight_render::scene::Scene;
use std::fmt;
use std::str::FromStr;

/// Which time a film shows.
#[derive(Debug, Args)]
pub struct Span {
    /// Show this much time from observer.time on, in steps of one N-th of it (a film of one period
    /// repeats without a seam): in M, or with a unit: s, min, h
    #[arg(long, value_name = "TIME", conflicts_with_all = ["from", "to"])]
    duration: Option<Moment>,
    /// Time of the first frame
    #[arg(long, value_name = "TIME", requires = "to", allow_hyphen_values = true)]
    from: Option<Moment>,
    /// Time of the last frame
    #[arg(long, value_name = "TIME", requires = "from", allow_hyphen_values = true)]
    to: Option<Moment>,
}

/// A time as a user writes it: `120`, `120M`, `30min`.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Moment {
    value: f64,
    /// Seconds of its unit; `None` for M.
    unit: Option<f64>,
}

/// Units of time with their seconds.
const UNITS: [(&str, Option<f64>); 5] =
    [("min", Some(60.0)), ("s", Some(1.0)), ("h", Some(3600.0)), ("M", None), ("", None)];

impl FromStr for Moment {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let split = UNITS.iter().find_map(|(name, unit)| Some((text.strip_suffix(name)?, *unit)));
        let (number, unit) = split.unwrap_or((text, None));
        match number.trim().parse::<f64>() {
            Ok(value) if value.is_finite() => Ok(Moment { value, unit }),
            _ => Err("a number, in M or with one of the units s, min, h".to_owned()),
        }
    }
}

impl fmt::Display for Moment {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { value, unit } = self;
        let name = UNITS.iter().find(|(_, of)| of == unit).map_or("M", |(name, _)| name);
        write!(f, "{value}{name}")
    }
}

impl Moment {
    fn in_m(self, scene: &Scene) -> anyhow::Result<f64> {
        let Some(unit) = self.unit else { return Ok(self.value) };
        let seconds = scene.hole.seconds().context(
            "`hole.mass_msun` is missing: times in s, min or h need it; give times in M, or \
             `mass_msun = …` in [hole]",
        )?;
        Ok(self.value * unit / seconds)
    }
}

impl Span {
    /// Times of all frames, in M.
    pub fn times(&self, frames: u32, scene: &Scene) -> anyhow::Result<Vec<f64>> {
        let n = f64::from(frames);
        let count = (0..frames).map(f64::from);
        match (self.duration, self.from, self.to) {
            (Some(duration), _, _) => {
                let (start, length) = (scene.observer.time, duration.in_m(scene)?);
                if length <= 0.0 {
                    bail!("--duration {duration} is not allowed: a time above 0");
                }
                Ok(count.map(|k| start + length * (k / n)).collect())
            }
            (None, Some(from), Some(to)) => {
                if frames < 2 {
                    bail!("--frames {frames} is not allowed with --from and --to: 2 or more");
                }
                let (start, end) = (from.in_m(scene)?, to.in_m(scene)?);
                if end <= start {
                    bail!("--to {to} is not allowed: later than --from {from}");
                }
                let (from, to) = (start, end);
                Ok(count.map(|k| from + (to - from) * (k / (n - 1.0))).collect())
            }
            _ => {
                let keys = scene.camera.as_ref().and_then(|camera| camera.span());
                let hint = keys.map(|[from, to]| format!(" (the camera's keys: {from} to {to})"));
                let hint = hint.unwrap_or_default();
                bail!("which time the film shows: give --duration, or --from and --to{hint}")
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exact_units_of_time() {
        let moment = |text: &str| text.parse::<Moment>().map(|m| (m.value, m.unit));
        assert_eq!(moment("120"), Ok((120.0, None)));
        assert_eq!(moment("-1.5e2M"), Ok((-150.0, None)));
        assert_eq!(moment("30min"), Ok((30.0, Some(60.0))));
        assert_eq!(moment("90 s"), Ok((90.0, Some(1.0))));
        assert_eq!(moment("2h"), Ok((2.0, Some(3600.0))));
        assert!(moment("2 days").is_err() && moment("inf").is_err() && moment("").is_err());
    }
}
