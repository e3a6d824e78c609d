//! From an experiment to its cases: every combination of levels and seeds, with the settings of its fit.

use super::experiment::{Experiment, Factor, Level};
use super::labels::called;
use super::source::Source;
use crate::fit;
use crate::paths;
use anyhow::{Context, anyhow, bail};
use kerrlight_tomo::fit::settings::merge;
use kerrlight_tomo::representation::Registry;
use rayon::prelude::*;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};
use toml::{Table, Value};

/// One fit of an experiment.
pub struct Case {
    /// Factor and level.
    pub levels: Vec<(String, String)>,
    /// Where the levels are on axes of numbers.
    pub numbers: Vec<Option<f64>>,
    /// Its seed.
    pub seed: u64,
    /// What is wrong with its settings.
    pub error: Option<String>,
    /// A name for a folder: levels, seed, and a checksum of the settings.
    pub slug: String,
    recipe: Arc<Recipe>,
    /// Its level of each factor, by number.
    chosen: Vec<u32>,
}

/// What settings of cases are made of. They are made when they are wanted: a hundred thousand of them would fill the
/// memory.
struct Recipe {
    experiment: Experiment,
    source: Source,
    choice: Choice,
    levels: Vec<Vec<Level>>,
    /// Fits that have been read.
    fits: Mutex<BTreeMap<PathBuf, Table>>,
}

/// How a case ended.
#[derive(Debug, Clone, PartialEq)]
pub enum Status {
    /// With these results.
    Done(serde_json::Value),
    /// With this message.
    Failed(String),
    /// It has not been run, or was interrupted.
    Open,
}

/// Which cases are run, and how.
#[derive(Clone, Default)]
pub struct Choice {
    /// Seeds, in place of the experiment's.
    pub seeds: Option<u64>,
    /// `factor=level` that are kept.
    pub only: Vec<String>,
    /// Whether the experiment's quick settings are used.
    pub quick: bool,
    /// `key=value` for all cases.
    pub set: Vec<String>,
    /// Representations that the program adds.
    pub registry: Registry,
}

impl Choice {
    /// Whether some cases are left out.
    pub fn is_restricted(&self) -> bool {
        self.seeds.is_some() || !self.only.is_empty()
    }

    /// All cases, with the same settings.
    pub fn unrestricted(&self) -> Self {
        Self { seeds: None, only: Vec::new(), ..self.clone() }
    }
}

impl Case {
    /// The settings of its fit.
    ///
    /// # Errors
    /// What is wrong with them.
    pub fn settings(&self) -> Result<String, String> {
        match &self.error {
            Some(error) => Err(error.clone()),
            None => {
                self.recipe.text(&self.chosen, self.seed).map_err(|e| crate::plain::reasons(&e))
            }
        }
    }

    /// Its level of a factor.
    pub fn level(&self, factor: &str) -> Option<&str> {
        self.levels.iter().find(|(name, _)| name == factor).map(|(_, level)| level.as_str())
    }

    /// Where its level of a factor is on an axis of numbers.
    pub fn number(&self, factor: &str) -> Option<f64> {
        let at = self.levels.iter().position(|(name, _)| name == factor)?;
        *self.numbers.get(at)?
    }

    /// `scene 1, grid, seed 2`.
    pub fn name(&self) -> String {
        let levels: Vec<(&str, &str)> =
            self.levels.iter().map(|(factor, level)| (factor.as_str(), level.as_str())).collect();
        let levels = called(&levels);
        if levels.is_empty() {
            return format!("seed {}", self.seed);
        }
        format!("{levels}, seed {}", self.seed)
    }
}

/// All cases, seed by seed, so that an interrupted experiment has some of everything.
pub fn expand(
    experiment: &Experiment,
    source: &Source,
    choice: &Choice,
) -> anyhow::Result<Vec<Case>> {
    let (recipe, seeds, wanted) = chosen(experiment, source, choice)?;
    let all: Vec<(u64, &Vec<u32>)> =
        (1..=seeds).flat_map(|seed| wanted.iter().map(move |chosen| (seed, chosen))).collect();
    if all.is_empty() {
        bail!("no case is left");
    }
    Ok(all.into_par_iter().map(|(seed, chosen)| case(&recipe, chosen, seed)).collect())
}

/// The case of a name, for which settings are made of no others.
///
/// # Errors
/// If there is none.
pub fn find(
    experiment: &Experiment,
    source: &Source,
    choice: &Choice,
    id: &str,
) -> anyhow::Result<Case> {
    let (recipe, seeds, wanted) = chosen(experiment, source, choice)?;
    let known = || {
        let (before, sum) = id.rsplit_once('_')?;
        let (words, seed) = before.rsplit_once("seed")?;
        let seed: u64 = seed.parse().ok().filter(|seed| (1..=seeds).contains(seed))?;
        let is_named = |chosen: &&Vec<u32>| {
            sum.len() == 8
                && recipe.words(chosen).iter().map(|w| format!("{w}_")).collect::<String>() == words
        };
        let named = wanted.iter().filter(is_named);
        named.map(|chosen| case(&recipe, chosen, seed)).find(|case| case.slug == id)
    };
    known().ok_or_else(|| {
        anyhow!("--case {id:?}: there is no such case with these settings; --list has all that are")
    })
}

/// The recipe of all cases, seeds, and combinations of levels.
fn chosen(
    experiment: &Experiment,
    source: &Source,
    choice: &Choice,
) -> anyhow::Result<(Arc<Recipe>, u64, Vec<Vec<u32>>)> {
    let quick = choice.quick.then_some(&experiment.quick);
    let seeds = choice.seeds.or(quick.and_then(|q| q.seeds)).unwrap_or(experiment.seeds);
    if !(1..=1_000_000).contains(&seeds) {
        bail!("--seeds {seeds} is not allowed: 1 to 1000000");
    }
    let asked = if choice.only.is_empty() {
        quick.map(|quick| quick.only.clone()).unwrap_or_default()
    } else {
        choice.only.clone()
    };
    let only = kept(experiment, &asked)?;
    let recipe = Arc::new(Recipe::new(experiment, source, choice));
    let is_wanted = |chosen: &Vec<u32>| {
        let of = |factor: &str| recipe.level(chosen, factor);
        let is_skipped = experiment
            .skip
            .iter()
            .any(|skip| skip.iter().all(|(factor, level)| of(factor) == Some(level.as_str())));
        let is_kept = only.iter().all(|(factor, levels)| {
            of(factor).is_some_and(|level| levels.iter().any(|l| l == level))
        });
        is_kept && !is_skipped
    };
    let mut wanted = combinations(&recipe.levels);
    wanted.retain(is_wanted);
    Ok((recipe, seeds, wanted))
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
fn combinations(levels: &[Vec<Level>]) -> Vec<Vec<u32>> {
    levels.iter().fold(vec![Vec::new()], |all, levels| {
        let with = |before: &Vec<u32>| -> Vec<Vec<u32>> {
            (0..levels.len() as u32).map(|k| [before.as_slice(), &[k]].concat()).collect()
        };
        all.iter().flat_map(with).collect()
    })
}

fn case(recipe: &Arc<Recipe>, chosen: &[u32], seed: u64) -> Case {
    let levels: Vec<&Level> = recipe.levels_of(chosen).collect();
    let factors = recipe.experiment.factor.iter();
    let named = factors.zip(&levels).map(|(f, l)| (f.name.clone(), l.name.clone())).collect();
    let settings = recipe.text(chosen, seed).and_then(|text| {
        fit::check(&text, &recipe.choice.registry)?;
        Ok(text)
    });
    let sum = crc32fast::hash(settings.as_deref().unwrap_or_default().as_bytes());
    let words =
        recipe.words(chosen).into_iter().chain([format!("seed{seed}"), format!("{sum:08x}")]);
    Case {
        levels: named,
        numbers: levels.iter().map(|level| level.number).collect(),
        seed,
        error: settings.err().map(|error| crate::plain::reasons(&error)),
        slug: words.collect::<Vec<_>>().join("_"),
        recipe: Arc::clone(recipe),
        chosen: chosen.to_vec(),
    }
}

/// A name as a file system likes it.
fn plain(name: &str) -> String {
    let letter = |c: char| if c.is_ascii_alphanumeric() || c == '.' { c } else { '-' };
    name.chars().take(40).map(letter).collect()
}

impl Recipe {
    fn new(experiment: &Experiment, source: &Source, choice: &Choice) -> Self {
        Recipe {
            levels: experiment.factor.iter().map(Factor::levels).collect(),
            experiment: experiment.clone(),
            source: source.clone(),
            choice: choice.clone(),
            fits: Mutex::default(),
        }
    }

    fn levels_of(&self, chosen: &[u32]) -> impl Iterator<Item = &Level> {
        self.levels.iter().zip(chosen).filter_map(|(levels, k)| levels.get(*k as usize))
    }

    /// Names of levels as a file system likes them.
    fn words(&self, chosen: &[u32]) -> Vec<String> {
        self.levels_of(chosen).map(|level| plain(&level.name)).collect()
    }

    /// The name of the level of a factor.
    fn level(&self, chosen: &[u32], factor: &str) -> Option<&str> {
        let at = self.experiment.factor.iter().position(|f| f.name == factor)?;
        Some(&self.levels[at].get(*chosen.get(at)? as usize)?.name)
    }

    /// The settings of a fit, which is read once.
    fn fit(&self, path: &Path) -> anyhow::Result<Table> {
        let mut fits = self.fits.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(table) = fits.get(path) {
            return Ok(table.clone());
        }
        let table = self.source.fit(path)?;
        fits.insert(path.to_owned(), table.clone());
        Ok(table)
    }

    fn text(&self, chosen: &[u32], seed: u64) -> anyhow::Result<String> {
        let Recipe { experiment, source, choice, .. } = self;
        let levels: Vec<&Level> = self.levels_of(chosen).collect();
        let last = levels.iter().rev().find_map(|level| level.fit.as_ref());
        let path = last
            .or(experiment.fit.as_ref())
            .ok_or_else(|| anyhow!("neither the experiment nor a level names a fit"))?;
        let mut table = self.fit(path)?;
        merge(&mut table, &source.anchored(&experiment.set));
        for level in levels {
            for key in &level.remove {
                remove(&mut table, key).with_context(|| format!("level {:?}", level.name))?;
            }
            merge(&mut table, &source.anchored(&level.set));
        }
        if choice.quick {
            merge(&mut table, &source.anchored(&experiment.quick.set));
        }
        table.insert("seed".to_owned(), Value::Integer(seed as i64));
        let text = toml::to_string(&table).context("settings")?;
        choice.set.iter().try_fold(text, |text, assignment| {
            fit::assigned(&text, &paths::from_here(assignment, None)?)
        })
    }
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

#[cfg(test)]
mod tests {
    use super::*;

    const TEXT: &str = r#"
        title = "t"
        question = "q"
        seeds = 2
        fit = "../scenes/fits/scene_1.toml"
        [set.training]
        steps = 7
        [[factor]]
        name = "what"
        [[factor.level]]
        name = "a grid"
        set.representation.kind = "grid"
        remove = ["training.occupancy"]
        [[factor.level]]
        name = "scan"
        set.axis.scan = { directions = 50, frames = 4, pixels = 20, rate = 0.0, last_rate = 0.0 }
        [[factor]]
        name = "rate"
        key = "training.rate"
        values = [1.0, 2]
        scale = 1e-3
        [[skip]]
        what = "scan"
        rate = "2"
    "#;

    fn cases(choice: &Choice) -> anyhow::Result<Vec<Case>> {
        expand(&Experiment::parse(TEXT)?, &Source::BuiltIn, choice)
    }

    fn table(case: &Case) -> Table {
        case.settings().unwrap().parse().unwrap()
    }

    #[test]
    fn exact_cases_are_all_combinations_but_those_left_out() {
        let cases = cases(&Choice::default()).unwrap();
        let names: Vec<String> = cases.iter().map(Case::name).collect();
        let expected = ["a grid, rate 1.0", "a grid, rate 2", "scan, rate 1.0"];
        let expected = [1, 2].map(|seed| expected.map(|n| format!("{n}, seed {seed}"))).concat();
        assert_eq!(names, expected);
        assert_eq!(cases[1].number("rate"), Some(2.0));
        assert!(cases[0].slug.starts_with("a-grid_1.0_seed1_"));
        assert_ne!(cases[0].slug, cases[1].slug);
        let (grid, scan) = (table(&cases[1]), table(&cases[2]));
        assert_eq!(grid["representation"]["kind"].as_str(), Some("grid"));
        assert_eq!(grid["training"]["rate"].as_float(), Some(2e-3));
        assert_eq!(grid["training"]["steps"].as_integer(), Some(7));
        assert!(!grid["training"].as_table().unwrap().contains_key("occupancy"));
        let axis = scan["axis"].as_table().unwrap();
        assert!(
            axis.len() == 1 && axis.contains_key("scan"),
            "a choice takes the place of another"
        );
    }

    #[test]
    fn exact_choices_of_the_command_line() {
        let only = vec!["what=scan".to_owned()];
        let set = vec!["training.steps=9".to_owned()];
        let choice = Choice { seeds: Some(3), only, set, ..Choice::default() };
        let cases = cases(&choice).unwrap();
        assert_eq!(cases.len(), 3);
        assert_eq!(table(&cases[2])["training"]["steps"].as_integer(), Some(9));
        assert_eq!(table(&cases[2])["seed"].as_integer(), Some(3));
    }

    #[test]
    fn wrong_words_are_named() {
        let text = |only: &str| {
            let choice = Choice { only: vec![only.to_owned()], ..Choice::default() };
            format!("{:#}", cases(&choice).map(|_| ()).unwrap_err())
        };
        assert!(text("what").contains("factor=level"));
        assert!(text("rates=1").contains("there is no factor \"rates\", only what, rate"));
        assert!(text("what=b").contains("a grid, scan"));
        let wrong = TEXT.replace("kind = \"grid\"", "kind = \"gird\"");
        let experiment = Experiment::parse(&wrong).unwrap();
        let cases = expand(&experiment, &Source::BuiltIn, &Choice::default()).unwrap();
        let error = cases[0].settings().unwrap_err();
        assert!(error.contains("gird"), "{error}");
        assert!(cases[2].error.is_none());
    }

    #[test]
    fn exact_all_experiments_are_whole() {
        for (name, _) in super::super::source::built_in() {
            let (source, text) = Source::find(Path::new(name)).unwrap();
            let experiment = Experiment::parse(&text).unwrap();
            for quick in [false, true] {
                let choice = Choice { quick, ..Choice::default() };
                let cases = expand(&experiment, &source, &choice).unwrap();
                super::super::ran::check(&experiment, &cases).unwrap();
                for case in cases {
                    assert!(case.error.is_none(), "{name}: {:?}", case.error);
                }
            }
        }
    }
}
