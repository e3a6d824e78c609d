//! Parts of the hard rays, each a command and a file of its own.

use super::Accuracy;
use crate::output::{self, Output};
use anyhow::{Context, bail};
use kerrlight_validation::accuracy::hard::{BATCH, Tally};
use serde::{Deserialize, Serialize};
use std::collections::BTreeSet;
use std::ops::Range;
use std::path::Path;
use std::str::FromStr;

/// Part K of N.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Part {
    number: u64,
    of: u64,
}

/// Most parts.
const MOST: u64 = 100_000;

impl FromStr for Part {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let read = || {
            let (number, of) = text.split_once('/')?;
            Some(Part { number: number.parse().ok()?, of: of.parse().ok()? })
        };
        let is_allowed = |part: &Part| (1..=part.of).contains(&part.number) && part.of <= MOST;
        read().filter(is_allowed).ok_or(format!("K/N with 1 ≤ K ≤ N ≤ {MOST}"))
    }
}

/// What decides the rays, and what became of those of a part.
#[derive(Serialize, Deserialize)]
struct File {
    rays_of: RaysOf,
    tally: Vec<Tally>,
}

/// What decides the rays.
#[derive(Debug, PartialEq, Serialize, Deserialize)]
struct RaysOf {
    version: String,
    integrator: String,
    tolerance: f64,
    /// In words: TOML has no whole numbers above 2⁶³ − 1.
    seed: String,
    rays: u64,
}

impl RaysOf {
    fn new(arguments: &Accuracy, rays: u64) -> Self {
        RaysOf {
            version: env!("CARGO_PKG_VERSION").to_owned(),
            integrator: arguments.integrator.name().to_owned(),
            tolerance: arguments.tolerance,
            seed: arguments.seed.to_string(),
            rays,
        }
    }
}

impl Part {
    /// Those that the files of a folder are of; the whole without any.
    pub fn all(folder: &Path) -> anyhow::Result<Vec<Self>> {
        let shown = || format!("cannot read {}", folder.display());
        let mut counts = BTreeSet::new();
        for entry in std::fs::read_dir(folder).with_context(shown)? {
            let name = entry.with_context(shown)?.file_name();
            counts.extend(name.to_str().and_then(Self::named).map(|part| part.of));
        }
        if counts.len() > 1 {
            let counts: Vec<String> = counts.iter().map(u64::to_string).collect();
            bail!(
                "{} holds parts of {}: remove those of all numbers but one",
                folder.display(),
                counts.join(" and of ")
            );
        }
        let of = counts.first().copied().unwrap_or(1);
        Ok((1..=of).map(|number| Part { number, of }).collect())
    }

    fn named(name: &str) -> Option<Self> {
        let (number, of) = name.strip_prefix("hard_")?.strip_suffix(".toml")?.split_once("_of_")?;
        format!("{number}/{of}").parse().ok()
    }

    /// The name of its file.
    fn name(self) -> String {
        format!("hard_{}_of_{}.toml", self.number, self.of)
    }

    /// Its batches of all that so many rays have.
    pub fn batches(self, rays: u64) -> Range<u64> {
        let until = |k: u64| {
            (u128::from(rays.div_ceil(BATCH)) * u128::from(k) / u128::from(self.of)) as u64
        };
        until(self.number - 1)..until(self.number)
    }

    /// How many rays it has.
    pub fn rays(self, rays: u64) -> u64 {
        let Range { start, end } = self.batches(rays);
        rays.min(end * BATCH) - rays.min(start * BATCH)
    }

    /// What its file has of these rays; nothing without one.
    ///
    /// # Errors
    /// If the file is of other rays, or none of a part.
    pub fn load(self, arguments: &Accuracy, rays: u64) -> anyhow::Result<Option<Vec<Tally>>> {
        let path = arguments.output.join(self.name());
        if !path.exists() {
            return Ok(None);
        }
        let name = || format!("{} is no part of hard rays: remove it", path.display());
        let File { rays_of, tally } =
            toml::from_str(&output::read_text(&path)?).with_context(name)?;
        let wanted = RaysOf::new(arguments, rays);
        if rays_of != wanted {
            let [is, wanted] = [rays_of, wanted].map(|of| toml::to_string(&of).unwrap_or_default());
            let other = is.lines().zip(wanted.lines()).find(|(is, wanted)| is != wanted);
            let (is, wanted) = other.unwrap_or_default();
            bail!(
                "{} has {is}, and these rays have {wanted}: give another folder with -o",
                path.display()
            );
        }
        Ok(Some(tally))
    }

    /// Where its file goes.
    pub fn output(self, arguments: &Accuracy) -> anyhow::Result<Output> {
        arguments.place(&self.name(), "toml")
    }

    /// Writes its file.
    pub fn write(self, arguments: &Accuracy, rays: u64, tally: &[Tally]) -> anyhow::Result<()> {
        let file = File { rays_of: RaysOf::new(arguments, rays), tally: tally.to_vec() };
        self.output(arguments)?.write(toml::to_string(&file)?.as_bytes())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exact_parts_have_each_batch_once() {
        for (rays, of) in [(1, 3), (2000, 1), (50_001, 7), (10_000_000_000, 99_999)] {
            let parts = (1..=of).map(|number| Part { number, of });
            let (mut next, mut all) = (0, 0);
            for part in parts {
                assert_eq!(part.batches(rays).start, next);
                next = part.batches(rays).end;
                all += part.rays(rays);
                assert_eq!(Part::named(&part.name()), Some(part));
            }
            assert_eq!((next, all), (rays.div_ceil(BATCH), rays));
        }
        for wrong in ["0/3", "4/3", "1", "1/0", "1/100001", "-1/3", "1/3/3"] {
            assert!(wrong.parse::<Part>().is_err(), "{wrong}");
        }
    }
}
