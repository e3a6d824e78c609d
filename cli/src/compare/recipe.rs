//! Recipes of the settings of cases. They are made when they are wanted: those of a hundred thousand cases would fill
//! the memory, and to check each of them would take minutes.

use super::experiment::Experiment;
use super::labels::product;
use super::source::Source;
use anyhow::{anyhow, bail};
use clap::Args;
use kerrlight_tomo::representation::Registry;
use serde::{Deserialize, Serialize};
use std::collections::{BTreeMap, HashSet};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, OnceLock, PoisonError};
use toml::Table;

/// Choice of cases, and how they are run.
#[derive(Debug, Clone, Default, Args, Serialize, Deserialize)]
pub struct Choice {
    /// Seeds of every case
    #[arg(long, value_name = "N")]
    pub seeds: Option<u64>,
    /// Run these cases alone, e.g. scene=1; may be repeated
    #[arg(long, value_name = "FACTOR=LEVEL")]
    pub only: Vec<String>,
    /// Change a setting of all fits, e.g. training.steps=100
    #[arg(long, value_name = "KEY=VALUE")]
    pub set: Vec<String>,
    /// A look at whether it runs: few steps, few cases
    #[arg(long)]
    pub quick: bool,
    /// Representations that the program adds.
    #[arg(skip)]
    #[serde(skip)]
    pub registry: Registry,
}

/// Of what is asked for alone: what the program adds cannot be compared.
impl PartialEq for Choice {
    fn eq(&self, o: &Self) -> bool {
        (self.seeds, &self.only, &self.set, self.quick) == (o.seeds, &o.only, &o.set, o.quick)
    }
}

/// Recipe of the settings of all cases.
pub struct Recipe {
    pub experiment: Experiment,
    pub source: Source,
    pub choice: Choice,
    /// Seeds of every case.
    pub seeds: u64,
    /// Names of levels as a file system likes them.
    pub words: Vec<Vec<String>>,
    pub variants: Vec<Variant>,
    /// Fits that have been read.
    fits: Mutex<BTreeMap<PathBuf, Table>>,
}

/// A combination of levels. Its cases differ in their seeds alone: their settings are right or wrong together.
#[derive(Default)]
pub struct Variant {
    /// The level of each factor, by number.
    pub chosen: Box<[u32]>,
    /// True if one of its levels is in none of those before.
    pub is_new: bool,
    /// CRC-32 and length of its text before the seed and behind it, from which checksums with any seed follow; none where
    /// the seed does not stand there once.
    pub stamp: OnceLock<Option<[(u32, u64); 2]>>,
    /// Error in its settings.
    pub error: OnceLock<Option<String>>,
    pub cost: OnceLock<f64>,
}

impl Recipe {
    /// Takes the combinations that are left of all: the chosen levels, without those that are skipped.
    pub fn new(experiment: &Experiment, source: &Source, choice: &Choice) -> anyhow::Result<Self> {
        let quick = choice.quick.then_some(&experiment.quick);
        let seeds = choice.seeds.or(quick.and_then(|q| q.seeds)).unwrap_or(experiment.seeds);
        if !(1..=1_000_000).contains(&seeds) {
            bail!("--seeds {seeds} is not allowed: 1 to 1000000");
        }
        // Cases that are asked for by name take the place of the quick look's own choice.
        let only = match quick {
            Some(quick) if choice.only.is_empty() => &quick.only,
            _ => &choice.only,
        };
        let kept = kept(experiment, only)?;
        let mut experiment = experiment.clone();
        // With paths from the root, a case has the same text, and so the same ID, from any folder.
        experiment.set = source.anchored(&experiment.set);
        experiment.quick.set = source.anchored(&experiment.quick.set);
        let levels = experiment.factor.iter_mut().flat_map(|factor| &mut factor.levels);
        levels.for_each(|level| level.set = source.anchored(&level.set));
        let levels = || experiment.factor.iter().map(|factor| &factor.levels);
        let words = levels().map(|all| all.iter().map(|level| plain(&level.name)).collect());
        let mut seen: HashSet<(usize, u32)> = HashSet::new();
        let variant = |chosen: Vec<u32>| {
            let levels = chosen.iter().copied().enumerate();
            // `count` and not `any`, which would stop before all levels are marked as seen.
            let is_new = levels.filter(|level| seen.insert(*level)).count() > 0;
            Variant { chosen: chosen.into(), is_new, ..Variant::default() }
        };
        let all = product(levels().map(|of| (0..of.len() as u32).collect()));
        let wanted = all.into_iter().filter(|chosen| is_wanted(&experiment, chosen, &kept));
        Ok(Recipe {
            words: words.collect(),
            source: source.clone(),
            choice: choice.clone(),
            seeds,
            variants: wanted.map(variant).collect(),
            experiment,
            fits: Mutex::default(),
        })
    }

    /// Combinations whose levels have these words, an underscore behind each.
    pub fn with_words(&self, words: &str) -> impl Iterator<Item = usize> {
        let is_it = move |variant: &usize| {
            let mut of = picked(&self.words, &self.variants[*variant].chosen);
            let rest = of.try_fold(words, |rest, word| rest.strip_prefix(word)?.strip_prefix('_'));
            rest == Some("")
        };
        (0..self.variants.len()).filter(is_it)
    }

    /// The settings of a fit, which is read once.
    pub fn fit(&self, path: &Path) -> anyhow::Result<Table> {
        // Held while a fit is read, so that other threads wait for it and read it once.
        let mut fits = self.fits.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(table) = fits.get(path) {
            return Ok(table.clone());
        }
        let table = self.source.fit(path)?;
        fits.insert(path.to_owned(), table.clone());
        Ok(table)
    }
}

/// One of each, by number.
pub fn picked<'a, T>(all: &'a [Vec<T>], chosen: &'a [u32]) -> impl Iterator<Item = &'a T> {
    all.iter().zip(chosen).filter_map(|(of, k)| of.get(*k as usize))
}

type Kept = Vec<(String, Vec<String>)>;

/// `factor=level` by factors: levels of the same factor add up.
fn kept(experiment: &Experiment, only: &[String]) -> anyhow::Result<Kept> {
    let mut kept: Kept = Vec::new();
    for choice in only {
        let (factor, level) = choice
            .split_once('=')
            .ok_or_else(|| anyhow!("--only {choice:?} is not allowed: factor=level"))?;
        let known = experiment.levels(factor);
        if known.is_empty() {
            let names: Vec<&str> = experiment.factor.iter().map(|f| f.name.as_str()).collect();
            bail!("--only {choice:?}: there is no factor {factor:?}, only {}", names.join(", "));
        }
        if !known.iter().any(|l| l.name == level) {
            let names: Vec<&str> = known.iter().map(|l| l.name.as_str()).collect();
            bail!("--only {choice:?}: the levels of {factor} are {}", names.join(", "));
        }
        match kept.iter_mut().find(|(name, _)| name == factor) {
            Some((_, levels)) => levels.push(level.to_owned()),
            None => kept.push((factor.to_owned(), vec![level.to_owned()])),
        }
    }
    Ok(kept)
}

/// Returns whether a combination of levels by number is kept and not skipped.
fn is_wanted(experiment: &Experiment, chosen: &[u32], kept: &Kept) -> bool {
    let of = |factor: &str| {
        let at = experiment.factor.iter().position(|f| f.name == factor)?;
        Some(experiment.factor[at].levels[chosen[at] as usize].name.as_str())
    };
    let is_at = |(factor, level): (&String, &String)| of(factor) == Some(level);
    let is_skipped = experiment.skip.iter().any(|skip| skip.iter().all(is_at));
    let is_kept =
        |(factor, levels): &(String, Vec<String>)| levels.iter().any(|l| is_at((factor, l)));
    !is_skipped && kept.iter().all(is_kept)
}

/// A name as a file system likes it.
fn plain(name: &str) -> String {
    let letter = |c: char| if c.is_ascii_alphanumeric() || c == '.' { c } else { '-' };
    name.chars().take(40).map(letter).collect()
}
