//! Cases of an experiment: every combination of levels and seeds.

use super::experiment::Experiment;
use super::labels::called;
use super::recipe::{Choice, Recipe};
use super::source::Source;
use anyhow::{anyhow, bail};
use std::collections::HashSet;
use std::sync::Arc;
use toml::Table;

/// One fit of an experiment: a combination of levels, and a seed.
#[derive(Clone)]
pub struct Case {
    recipe: Arc<Recipe>,
    variant: u32,
    /// Its seed.
    pub seed: u64,
}

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
            None => self.recipe.text(self.at(), self.seed).map_err(|e| crate::plain::reasons(&e)),
        }
    }

    /// The settings of its fit, right or wrong; none where they cannot be put together.
    pub fn table(&self) -> Option<Table> {
        self.recipe.table(self.at(), self.seed).ok()
    }

    /// Returns the error in its settings.
    pub fn error(&self) -> Option<&str> {
        self.recipe.error(self.at())
    }

    /// The same, of too many combinations of levels only where a level is new; the run of a case finds the rest.
    pub fn early_error(&self) -> Option<&str> {
        self.recipe.early_error(self.at())
    }

    /// A measure of its time against that of others of its kind.
    pub fn cost(&self) -> f64 {
        self.recipe.cost(self.at())
    }

    /// A name for a folder: levels, seed, and a checksum of the settings.
    pub fn slug(&self) -> String {
        let sum = self.recipe.sum(self.at(), self.seed);
        format!("{}seed{}_{sum:08x}", self.recipe.words(self.at()), self.seed)
    }

    /// Its level of each factor.
    pub fn levels(&self) -> impl Iterator<Item = (&str, &str)> {
        self.recipe.levels(self.at()).map(|(factor, level)| (factor, level.name.as_str()))
    }

    /// Its level of each factor, by number.
    pub fn chosen(&self) -> &[u32] {
        self.recipe.chosen(self.at())
    }

    /// The number of a level, with that of its factor.
    pub fn place(&self, factor: &str, level: &str) -> Option<(usize, u32)> {
        self.recipe.place(factor, level)
    }

    /// Its level of a factor.
    pub fn level(&self, factor: &str) -> Option<&str> {
        self.levels().find(|(name, _)| *name == factor).map(|(_, level)| level)
    }

    /// Returns the place of its level of a factor on an axis of numbers.
    pub fn number(&self, factor: &str) -> Option<f64> {
        self.recipe.levels(self.at()).find(|(name, _)| *name == factor)?.1.number
    }

    /// `scene 1, grid, seed 2`.
    pub fn name(&self) -> String {
        let levels = called(&self.levels().collect::<Vec<_>>());
        if levels.is_empty() {
            return format!("seed {}", self.seed);
        }
        format!("{levels}, seed {}", self.seed)
    }

    fn at(&self) -> usize {
        self.variant as usize
    }
}

/// All cases, seed by seed, so that an interrupted experiment has some of everything.
pub fn expand(
    experiment: &Experiment,
    source: &Source,
    choice: &Choice,
) -> anyhow::Result<Vec<Case>> {
    let (recipe, seeds) = recipe(experiment, source, choice)?;
    if recipe.len() == 0 {
        bail!("no case is left");
    }
    let of = |seed: u64, variant: usize| Case {
        recipe: Arc::clone(&recipe),
        variant: variant as u32,
        seed,
    };
    let of = &of;
    Ok((1..=seeds).flat_map(|seed| (0..recipe.len()).map(move |k| of(seed, k))).collect())
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
    let (recipe, seeds) = recipe(experiment, source, choice)?;
    let known = || {
        let (before, _) = id.rsplit_once('_')?;
        // The last one: the name of a level may contain `seed` itself.
        let (words, seed) = before.rsplit_once("seed")?;
        let seed: u64 = seed.parse().ok().filter(|seed| (1..=seeds).contains(seed))?;
        let case =
            |variant: usize| Case { recipe: Arc::clone(&recipe), variant: variant as u32, seed };
        // Of a hundred thousand cases only those with these levels have their settings made.
        recipe.with_words(words).map(case).find(|case| case.slug() == id)
    };
    known().ok_or_else(|| {
        anyhow!("--case {id:?}: there is no such case with these settings; --list has all that are")
    })
}

/// Returns the recipe of the settings of all cases, and the number of seeds.
fn recipe(
    experiment: &Experiment,
    source: &Source,
    choice: &Choice,
) -> anyhow::Result<(Arc<Recipe>, u64)> {
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
    Ok((Arc::new(Recipe::new(experiment, source, choice, only)?), seeds))
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::Path;

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
        let cases = expand(&experiment, &Source::BuiltIn, &Choice::default()).unwrap();
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
        let cases = expand(&experiment, &Source::BuiltIn, &Choice::default()).unwrap();
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
