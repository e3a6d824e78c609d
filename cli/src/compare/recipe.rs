//! Recipes of the settings of cases. They are made when they are wanted: those of a hundred thousand cases would fill
//! the memory, and to check each of them would take minutes.

use super::experiment::{Experiment, Factor, Level};
use super::source::Source;
use crate::changed::Changed;
use crate::fit;
use crate::keys;
use crate::paths;
use anyhow::{Context, anyhow, bail};
use clap::Args;
use kerrlight_tomo::fit::settings::merge;
use kerrlight_tomo::representation::Registry;
use serde::{Deserialize, Serialize};
use std::collections::{BTreeMap, HashSet};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, OnceLock, PoisonError};
use toml::{Table, Value};

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

impl Choice {
    /// Returns whether some cases are left out.
    pub fn is_restricted(&self) -> bool {
        self.seeds.is_some() || !self.only.is_empty()
    }

    /// All cases, with the same settings.
    pub fn unrestricted(&self) -> Self {
        Self { seeds: None, only: Vec::new(), ..self.clone() }
    }
}

/// Recipe of the settings of all cases.
pub struct Recipe {
    experiment: Experiment,
    source: Source,
    choice: Choice,
    /// Levels of each factor.
    levels: Vec<Vec<Level>>,
    /// Names of levels as a file system likes them.
    words: Vec<Vec<String>>,
    variants: Vec<Variant>,
    /// Fits that have been read.
    fits: Mutex<BTreeMap<PathBuf, Table>>,
}

/// A combination of levels. Its cases differ in their seeds alone: their settings are right or wrong together.
struct Variant {
    /// The level of each factor, by number.
    chosen: Box<[u32]>,
    /// True if one of its levels is in none of those before.
    is_new: bool,
    stamp: OnceLock<Stamp>,
    /// Error in its settings.
    error: OnceLock<Option<String>>,
    cost: OnceLock<f64>,
}

/// Combinations that are all checked before any is run; of more, each level is checked once.
const CHECKED: usize = 1000;

/// Stamp from which checksums of settings with any seed follow.
enum Stamp {
    /// CRC-32 and length of the text before the seed, and of the text behind it.
    Around([(u32, u64); 2]),
    /// The text, in which the seed does not stand once.
    Any,
}

/// A seed that stands nowhere else in settings.
const MARK: u64 = 4_203_716_935_288_541_207;

impl Recipe {
    /// Takes the combinations that are left of all: these levels (`factor=level`), without those that are skipped.
    pub fn new(
        experiment: &Experiment,
        source: &Source,
        choice: &Choice,
        only: &[String],
    ) -> anyhow::Result<Self> {
        let kept = kept(experiment, only)?;
        let mut experiment = experiment.clone();
        // With paths from the root, a case has the same text, and so the same ID, from any folder.
        experiment.set = source.anchored(&experiment.set);
        experiment.quick.set = source.anchored(&experiment.quick.set);
        let mut levels: Vec<Vec<Level>> = experiment.factor.iter().map(Factor::levels).collect();
        levels.iter_mut().flatten().for_each(|level| level.set = source.anchored(&level.set));
        let words = levels.iter().map(|all| all.iter().map(|level| plain(&level.name)).collect());
        let mut recipe = Recipe {
            words: words.collect(),
            source: source.clone(),
            choice: choice.clone(),
            variants: combinations(&levels).into_iter().map(Variant::new).collect(),
            levels,
            experiment,
            fits: Mutex::default(),
        };
        let mut variants = std::mem::take(&mut recipe.variants);
        let mut seen: HashSet<(usize, u32)> = HashSet::new();
        variants.retain_mut(|variant| {
            let is_wanted = recipe.is_wanted(&variant.chosen, &kept);
            let levels = variant.chosen.iter().copied().enumerate();
            // `count` and not `any`, which would stop before all levels are marked as seen.
            variant.is_new = is_wanted && levels.filter(|level| seen.insert(*level)).count() > 0;
            is_wanted
        });
        recipe.variants = variants;
        Ok(recipe)
    }

    /// Returns whether a combination is kept and not skipped.
    fn is_wanted(&self, chosen: &[u32], kept: &Kept) -> bool {
        let factors = &self.experiment.factor;
        let of = |factor: &str| {
            let at = factors.iter().position(|f| f.name == factor)?;
            Some(self.levels[at][chosen[at] as usize].name.as_str())
        };
        let is_at = |(factor, level): (&String, &String)| of(factor) == Some(level);
        let is_skipped = self.experiment.skip.iter().any(|skip| skip.iter().all(is_at));
        let is_kept =
            |(factor, levels): &(String, Vec<String>)| levels.iter().any(|l| is_at((factor, l)));
        !is_skipped && kept.iter().all(is_kept)
    }

    /// Returns the number of combinations.
    pub fn len(&self) -> usize {
        self.variants.len()
    }

    /// The level of each factor, by number.
    pub fn chosen(&self, variant: usize) -> &[u32] {
        &self.variants[variant].chosen
    }

    /// Factors with their levels.
    pub fn levels(&self, variant: usize) -> impl Iterator<Item = (&str, &Level)> {
        let names = self.experiment.factor.iter().map(|factor| factor.name.as_str());
        names.zip(picked(&self.levels, self.chosen(variant)))
    }

    /// A level by number, with the number of its factor.
    pub fn place(&self, factor: &str, level: &str) -> Option<(usize, u32)> {
        let at = self.experiment.factor.iter().position(|f| f.name == factor)?;
        Some((at, self.levels[at].iter().position(|l| l.name == level)? as u32))
    }

    /// Names of levels as a file system likes them, an underscore behind each.
    pub fn words(&self, variant: usize) -> String {
        picked(&self.words, self.chosen(variant)).fold(String::new(), |all, word| all + word + "_")
    }

    /// Combinations with these [`Self::words`].
    pub fn with_words(&self, words: &str) -> impl Iterator<Item = usize> {
        let is_it = move |variant: &usize| {
            let mut of = picked(&self.words, self.chosen(*variant));
            let rest = of.try_fold(words, |rest, word| rest.strip_prefix(word)?.strip_prefix('_'));
            rest == Some("")
        };
        (0..self.len()).filter(is_it)
    }

    /// Returns the error in the settings of a combination.
    pub fn error(&self, variant: usize) -> Option<&str> {
        let error = &self.variants[variant].error;
        let check = || self.check(variant).err().map(|error| crate::plain::reasons(&error));
        error.get_or_init(check).as_deref()
    }

    fn check(&self, variant: usize) -> anyhow::Result<()> {
        let (path, text) = (self.path(variant)?, self.text(variant, 1)?);
        let name = path.display().to_string();
        let (own, by) = (self.source.fit_text(path)?, "the settings of the case");
        let changed = Changed { name: &name, own: &own, text: &text, by };
        fit::check(&changed, &self.choice.registry)
    }

    /// The same, as far as it is looked for before cases are run: each check takes a third of a millisecond.
    pub fn early_error(&self, variant: usize) -> Option<&str> {
        let is_checked = self.len() <= CHECKED || self.variants[variant].is_new;
        if is_checked {
            self.error(variant)
        } else {
            self.variants[variant].error.get()?.as_deref()
        }
    }

    /// Rays that the steps of a fit look at, all together.
    pub fn cost(&self, variant: usize) -> f64 {
        let cost = || self.table(variant, 1).map_or(0.0, |settings| cost(&settings));
        *self.variants[variant].cost.get_or_init(cost)
    }

    /// CRC-32 of the settings with a seed; 0 where there are none.
    pub fn sum(&self, variant: usize, seed: u64) -> u32 {
        let text = |seed: u64| self.text(variant, seed).unwrap_or_default();
        let stamp = self.variants[variant].stamp.get_or_init(|| Stamp::of(&text(MARK)));
        let Stamp::Around([before, behind]) = stamp else {
            return crc32fast::hash(text(seed).as_bytes());
        };
        // The CRC-32 of joined texts follows from those of the parts: only the seed is hashed.
        let [mut sum, behind] = [before, behind]
            .map(|(crc, length)| crc32fast::Hasher::new_with_initial_len(*crc, *length));
        sum.update(seed.to_string().as_bytes());
        sum.combine(&behind);
        sum.finalize()
    }

    /// The settings of a fit as text.
    pub fn text(&self, variant: usize, seed: u64) -> anyhow::Result<String> {
        let text = toml::to_string(&self.merged(variant, seed)?).context("settings")?;
        // The command line comes last: it overrides levels and the quick look.
        self.choice.set.iter().try_fold(text, |text, assignment| {
            fit::assigned(&text, &paths::from_here(assignment, None)?)
        })
    }

    /// The settings of a fit.
    pub fn table(&self, variant: usize, seed: u64) -> anyhow::Result<Table> {
        if self.choice.set.is_empty() {
            return self.merged(variant, seed);
        }
        Ok(self.text(variant, seed)?.parse()?)
    }

    /// Settings without those of the command line.
    fn merged(&self, variant: usize, seed: u64) -> anyhow::Result<Table> {
        let experiment = &self.experiment;
        let mut table = self.fit(self.path(variant)?)?;
        merge(&mut table, &experiment.set);
        for level in picked(&self.levels, self.chosen(variant)) {
            for key in &level.remove {
                remove(&mut table, key).with_context(|| format!("level {:?}", level.name))?;
            }
            merge(&mut table, &level.set);
        }
        if self.choice.quick {
            merge(&mut table, &experiment.quick.set);
        }
        table.insert("seed".to_owned(), Value::Integer(seed.cast_signed()));
        Ok(table)
    }

    /// The file of the fit that a combination changes.
    fn path(&self, variant: usize) -> anyhow::Result<&Path> {
        let levels = picked(&self.levels, self.chosen(variant));
        let last = levels.filter_map(|level| level.fit.as_deref()).last();
        last.or(self.experiment.fit.as_deref())
            .ok_or_else(|| anyhow!("neither the experiment nor a level names a fit"))
    }

    /// The settings of a fit, which is read once.
    fn fit(&self, path: &Path) -> anyhow::Result<Table> {
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

impl Variant {
    fn new(chosen: Box<[u32]>) -> Self {
        Variant {
            chosen,
            is_new: false,
            stamp: OnceLock::new(),
            error: OnceLock::new(),
            cost: OnceLock::new(),
        }
    }
}

impl Stamp {
    /// Takes settings with [`MARK`] as their seed.
    fn of(text: &str) -> Self {
        let parts: Vec<&str> = text.split(&MARK.to_string()).collect();
        let sum = |part: &str| (crc32fast::hash(part.as_bytes()), part.len() as u64);
        match parts.as_slice() {
            [before, behind] => Stamp::Around([sum(before), sum(behind)]),
            // A seed given by --set leaves no mark in the text.
            _ => Stamp::Any,
        }
    }
}

/// One of each, by number.
fn picked<'a, T>(all: &'a [Vec<T>], chosen: &'a [u32]) -> impl Iterator<Item = &'a T> {
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
            let names: Vec<String> = known.into_iter().map(|l| l.name).collect();
            bail!("--only {choice:?}: the levels of {factor} are {}", names.join(", "));
        }
        match kept.iter_mut().find(|(name, _)| name == factor) {
            Some((_, levels)) => levels.push(level.to_owned()),
            None => kept.push((factor.to_owned(), vec![level.to_owned()])),
        }
    }
    Ok(kept)
}

/// Every combination of levels by number, the last factor fastest.
fn combinations(levels: &[Vec<Level>]) -> Vec<Box<[u32]>> {
    levels.iter().fold(vec![Box::default()], |all, levels| {
        let with = |before: &[u32]| -> Vec<Box<[u32]>> {
            (0..levels.len() as u32).map(|k| [before, [k].as_slice()].concat().into()).collect()
        };
        all.iter().flat_map(|before| with(before)).collect()
    })
}

/// A name as a file system likes it.
fn plain(name: &str) -> String {
    let letter = |c: char| if c.is_ascii_alphanumeric() || c == '.' { c } else { '-' };
    name.chars().take(40).map(letter).collect()
}

fn remove(table: &mut Table, key: &str) -> anyhow::Result<()> {
    let missing = || anyhow!("there is no {key} to remove");
    match key.split_once('.') {
        None => table.remove(key).map(drop).ok_or_else(missing),
        Some((first, rest)) => match table.get_mut(first) {
            Some(Value::Table(inner)) => remove(inner, rest),
            _ => Err(missing()),
        },
    }
}

/// Rays that steps look at: a measure of its time against that of others of its kind.
fn cost(settings: &Table) -> f64 {
    let number = |key: &str| -> Option<f64> {
        let value = keys::at(settings, key)?;
        value.as_float().or_else(|| value.as_integer().map(|whole| whole as f64))
    };
    let side = number("screen.pixels").or_else(|| number("image.pixels")).unwrap_or(1.0);
    let frames =
        number("simulation.observation.scans").or_else(|| number("simulation.movie.frames"));
    let rays = match number("training.batch.pixels") {
        Some(pixels) => pixels,
        None => {
            let of_step = number("training.batch.frames").or(frames).unwrap_or(1.0);
            of_step * side * side
        }
    };
    number("training.steps").unwrap_or(1.0) * rays
}
