//! Cases of an experiment: every combination of levels and seeds.

use super::experiment::{Experiment, Level};
use super::labels::called;
use super::recipe::{Choice, Recipe, Variant, picked};
use super::source::Source;
use crate::changed::Changed;
use crate::{fit, keys, paths, plain};
use anyhow::{Context, anyhow, bail};
use kerrlight_tomo::fit::settings::merge;
use std::collections::HashSet;
use std::path::Path;
use std::sync::Arc;
use toml::{Table, Value};

/// One fit of an experiment: a combination of levels, and a seed.
#[derive(Clone)]
pub struct Case {
    recipe: Arc<Recipe>,
    variant: u32,
    /// Its seed.
    pub seed: u64,
}

/// Combinations that are all checked before any is run; of more, each level is checked once.
const CHECKED: usize = 1000;

/// A seed that stands nowhere else in settings.
const MARK: u64 = 4_203_716_935_288_541_207;

/// Status of a case.
#[derive(Debug, Clone, PartialEq)]
pub enum Status<R = serde_json::Value> {
    /// It ended with these results.
    Done(R),
    /// It failed with this message.
    Failed(String),
    /// It has not been run, or was interrupted.
    Open,
}

impl Case {
    /// The settings of its fit.
    ///
    /// # Errors
    /// What is wrong with them.
    pub fn settings(&self) -> Result<String, String> {
        match self.error() {
            Some(error) => Err(error.to_owned()),
            None => self.text(self.seed).map_err(|error| plain::reasons(&error)),
        }
    }

    /// The settings of its fit, right or wrong; none where they cannot be put together.
    pub fn table(&self) -> Option<Table> {
        self.table_of(self.seed).ok()
    }

    /// Returns the error in its settings.
    pub fn error(&self) -> Option<&str> {
        let check = || self.check().err().map(|error| plain::reasons(&error));
        self.variant().error.get_or_init(check).as_deref()
    }

    fn check(&self) -> anyhow::Result<()> {
        let (path, text) = (self.path()?, self.text(1)?);
        let name = path.display().to_string();
        let (own, by) = (self.recipe.source.fit_text(path)?, "the settings of the case");
        let changed = Changed { name: &name, own: &own, text: &text, by };
        fit::check(&changed, &self.recipe.choice.registry)
    }

    /// The same, of too many combinations of levels only where a level is new, as each check takes a third of a millisecond;
    /// the run of a case finds the rest.
    pub fn early_error(&self) -> Option<&str> {
        let is_checked = self.recipe.variants.len() <= CHECKED || self.variant().is_new;
        if is_checked { self.error() } else { self.variant().error.get()?.as_deref() }
    }

    /// A measure of its time against that of others of its kind: rays that the steps of its fit look at, all together.
    pub fn cost(&self) -> f64 {
        let cost = || self.table_of(1).map_or(0.0, |settings| cost(&settings));
        *self.variant().cost.get_or_init(cost)
    }

    /// A name for a folder: levels, seed, and a checksum of the settings.
    pub fn slug(&self) -> String {
        let words = picked(&self.recipe.words, self.chosen());
        let words = words.fold(String::new(), |all, word| all + word + "_");
        format!("{words}seed{}_{:08x}", self.seed, self.sum())
    }

    /// CRC-32 of the settings; 0 where there are none.
    fn sum(&self) -> u32 {
        let text = |seed: u64| self.text(seed).unwrap_or_default();
        let part = |part: &str| (crc32fast::hash(part.as_bytes()), part.len() as u64);
        let stamp = self.variant().stamp.get_or_init(|| {
            let text = text(MARK);
            // A seed given by --set leaves no mark in the text.
            let (before, behind) = text.split_once(&MARK.to_string())?;
            (!behind.contains(&MARK.to_string())).then(|| [before, behind].map(part))
        });
        let Some([before, behind]) = stamp else {
            return crc32fast::hash(text(self.seed).as_bytes());
        };
        // The CRC-32 of joined texts follows from those of the parts: only the seed is hashed.
        let [mut sum, behind] = [before, behind]
            .map(|(crc, length)| crc32fast::Hasher::new_with_initial_len(*crc, *length));
        sum.update(self.seed.to_string().as_bytes());
        sum.combine(&behind);
        sum.finalize()
    }

    /// The settings as text, with any seed: cases of a combination differ in nothing else.
    fn text(&self, seed: u64) -> anyhow::Result<String> {
        let text = toml::to_string(&self.merged(seed)?).context("settings")?;
        // The command line comes last: it overrides levels and the quick look.
        self.recipe.choice.set.iter().try_fold(text, |text, assignment| {
            fit::assigned(&text, &paths::from_here(assignment, None)?)
        })
    }

    /// The same as a table.
    fn table_of(&self, seed: u64) -> anyhow::Result<Table> {
        if self.recipe.choice.set.is_empty() {
            return self.merged(seed);
        }
        Ok(self.text(seed)?.parse()?)
    }

    /// Settings without those of the command line.
    fn merged(&self, seed: u64) -> anyhow::Result<Table> {
        let experiment = &self.recipe.experiment;
        let mut table = self.recipe.fit(self.path()?)?;
        merge(&mut table, &experiment.set);
        for (_, level) in self.picked() {
            for key in &level.remove {
                remove(&mut table, key).with_context(|| format!("level {:?}", level.name))?;
            }
            merge(&mut table, &level.set);
        }
        if self.recipe.choice.quick {
            merge(&mut table, &experiment.quick.set);
        }
        table.insert("seed".to_owned(), Value::Integer(seed.cast_signed()));
        Ok(table)
    }

    /// The file of the fit that it changes.
    fn path(&self) -> anyhow::Result<&Path> {
        let last = self.picked().filter_map(|(_, level)| level.fit.as_deref()).last();
        last.or(self.recipe.experiment.fit.as_deref())
            .ok_or_else(|| anyhow!("neither the experiment nor a level names a fit"))
    }

    /// Factors with its levels.
    fn picked(&self) -> impl Iterator<Item = (&str, &Level)> {
        let factors = self.recipe.experiment.factor.iter().zip(self.chosen());
        factors.map(|(factor, k)| (factor.name.as_str(), &factor.levels[*k as usize]))
    }

    /// Its level of each factor.
    pub fn levels(&self) -> impl Iterator<Item = (&str, &str)> {
        self.picked().map(|(factor, level)| (factor, level.name.as_str()))
    }

    /// Its level of each factor, by number.
    pub fn chosen(&self) -> &[u32] {
        &self.variant().chosen
    }

    /// The number of a level, with that of its factor.
    pub fn place(&self, factor: &str, level: &str) -> Option<(usize, u32)> {
        let mut factors = self.recipe.experiment.factor.iter().enumerate();
        let (at, factor) = factors.find(|(_, of)| of.name == factor)?;
        Some((at, factor.levels.iter().position(|l| l.name == level)? as u32))
    }

    /// Its level of a factor.
    pub fn level(&self, factor: &str) -> Option<&str> {
        self.levels().find(|(name, _)| *name == factor).map(|(_, level)| level)
    }

    /// Returns the place of its level of a factor on an axis of numbers.
    pub fn number(&self, factor: &str) -> Option<f64> {
        self.picked().find(|(name, _)| *name == factor)?.1.number
    }

    /// `scene 1, grid, seed 2`.
    pub fn name(&self) -> String {
        let levels = called(&self.levels().collect::<Vec<_>>());
        if levels.is_empty() {
            return format!("seed {}", self.seed);
        }
        format!("{levels}, seed {}", self.seed)
    }

    fn variant(&self) -> &Variant {
        &self.recipe.variants[self.variant as usize]
    }
}

/// All cases, seed by seed, so that an interrupted experiment has some of everything.
pub fn expand(
    experiment: &Experiment,
    source: &Source,
    choice: &Choice,
) -> anyhow::Result<Vec<Case>> {
    let recipe = Arc::new(Recipe::new(experiment, source, choice)?);
    if recipe.variants.is_empty() {
        bail!("no case is left");
    }
    let variants = 0..recipe.variants.len() as u32;
    let all = (1..=recipe.seeds).flat_map(|seed| variants.clone().map(move |k| (k, seed)));
    Ok(all.map(|(variant, seed)| Case { recipe: Arc::clone(&recipe), variant, seed }).collect())
}

/// Cases of which each stands for all that differ from it in the seed alone.
pub fn without_seeds<'a>(cases: impl IntoIterator<Item = &'a Case>) -> Vec<&'a Case> {
    let mut seen = HashSet::new();
    cases.into_iter().filter(|case| seen.insert(case.chosen())).collect()
}

/// The case of a name.
///
/// # Errors
/// If there is none.
pub fn find(
    experiment: &Experiment,
    source: &Source,
    choice: &Choice,
    id: &str,
) -> anyhow::Result<Case> {
    let recipe = Arc::new(Recipe::new(experiment, source, choice)?);
    let known = || {
        let (before, _) = id.rsplit_once('_')?;
        // The last one: the name of a level may contain `seed` itself.
        let (words, seed) = before.rsplit_once("seed")?;
        let seed: u64 = seed.parse().ok().filter(|seed| (1..=recipe.seeds).contains(seed))?;
        let case =
            |variant: usize| Case { recipe: Arc::clone(&recipe), variant: variant as u32, seed };
        // Of a hundred thousand cases only those with these levels have their settings made.
        recipe.with_words(words).map(case).find(|case| case.slug() == id)
    };
    known().ok_or_else(|| {
        anyhow!("--case {id:?}: there is no such case with these settings; --list has all that are")
    })
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
        key = "representation.network.rate"
        values = [1.0, 2]
        scale = 1e-3
        [[skip]]
        what = "scan"
        rate = "2"
    "#;

    fn cases(choice: &Choice) -> anyhow::Result<Vec<Case>> {
        expand(&Experiment::parse(TEXT)?, &Source::default(), choice)
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
        assert!(cases[0].slug().starts_with("a-grid_1.0_seed1_"));
        assert_ne!(cases[0].slug(), cases[1].slug());
        let (grid, scan) = (table(&cases[1]), table(&cases[2]));
        assert_eq!(grid["representation"]["kind"].as_str(), Some("grid"));
        assert_eq!(grid["representation"]["network"]["rate"].as_float(), Some(2e-3));
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

    /// Settings in which the seed stands once, several times and not at all.
    #[test]
    fn exact_ids_end_in_checksums_of_settings() {
        for set in [vec![], vec!["title=seed 2".to_owned()], vec!["seed=7".to_owned()]] {
            let choice = Choice { seeds: Some(30), set, ..Choice::default() };
            for case in cases(&choice).unwrap() {
                let sum = crc32fast::hash(case.settings().unwrap().as_bytes());
                assert!(case.slug().ends_with(&format!("_{sum:08x}")), "{}", case.slug());
            }
        }
    }

    /// Each level of 40 × 40 combinations is checked once, and the others when they are run.
    #[test]
    fn exact_each_level_of_many_combinations_is_checked() {
        let values = (1..=40).map(|k| if k == 40 { "-1".to_owned() } else { k.to_string() });
        let values = values.collect::<Vec<_>>().join(", ");
        let factor = |key: &str| {
            format!("[[factor]]\nname = {key:?}\nkey = \"training.{key}\"\nvalues = [{values}]\n")
        };
        let head =
            "title = \"t\"\nquestion = \"q\"\nseeds = 2\nfit = \"../scenes/fits/scene_1.toml\"\n";
        let text = [head, &factor("log_every"), &factor("steps")].concat();
        let experiment = Experiment::parse(&text).unwrap();
        let cases = expand(&experiment, &Source::default(), &Choice::default()).unwrap();
        assert_eq!(cases.len(), 3200);
        let found = |of: fn(&Case) -> bool| cases.iter().filter(|case| of(case)).count();
        // The first with a wrong step and the first with a wrong log, of both seeds.
        assert_eq!(found(|case| case.early_error().is_some()), 4);
        assert_eq!(found(|case| case.error().is_some()), 2 * (40 + 39));
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
        let cases = expand(&experiment, &Source::default(), &Choice::default()).unwrap();
        let error = cases[0].settings().unwrap_err();
        assert!(error.contains("gird"), "{error}");
        assert!(cases[2].error().is_none());
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
                    assert!(case.error().is_none(), "{name}: {:?}", case.error());
                }
            }
        }
    }
}
