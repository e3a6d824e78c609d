//! Times of the frames of a film.

use anyhow::{Context, bail};
use clap::Args;
use kerrlight_render::scene::Scene;
use std::fmt;
use std::ops::RangeInclusive;
use std::str::FromStr;

/// Frames of a film, and those of them that are rendered.
#[derive(Debug, Clone, PartialEq)]
pub struct Frames {
    /// Number of frames of the film.
    pub all: u32,
    /// The first and the last that are rendered.
    pub part: RangeInclusive<u32>,
}

/// Most frames of a film.
const MOST: u32 = 1_000_000;

impl Frames {
    /// Returns whether all are rendered.
    pub fn are_all(&self) -> bool {
        self.part.end() - self.part.start() + 1 == self.all
    }
}

impl FromStr for Frames {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let number = |text: &str| text.trim().parse::<u32>().ok();
        let read = || match text.split_once('/') {
            None => number(text).map(|all| (all, 0..=all.saturating_sub(1))),
            Some((part, all)) => {
                let (first, last) = part.split_once("..")?;
                Some((number(all)?, number(first)?..=number(last)?))
            }
        };
        match read() {
            Some((all, part)) if part.start() <= part.end() && *part.end() < all && all <= MOST => {
                Ok(Frames { all, part })
            }
            _ => Err(format!("N, or A..B/N for the frames A to B of N: 0 ≤ A ≤ B < N ≤ {MOST}")),
        }
    }
}

/// Time span of a film.
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
    fn exact_parts_of_a_film() {
        let frames = |text: &str| text.parse::<Frames>().ok().map(|f| (f.all, f.part));
        assert_eq!(frames("12"), Some((12, 0..=11)));
        assert_eq!(frames("4..7/12"), Some((12, 4..=7)));
        assert!("0..11/12".parse::<Frames>().unwrap().are_all());
        assert!(!"0..10/12".parse::<Frames>().unwrap().are_all());
        for wrong in ["0", "-1", "4..7", "4..12/12", "7..4/12", "a..b/12", "1000001", "1..2/3/4"] {
            assert_eq!(frames(wrong), None, "{wrong}");
        }
    }

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
