//! Keys of an experiment's file.

use super::labels::{ONE_CHI2, RESULTS};
use crate::fit::posterior::{RANKED, WITHIN};
use anyhow::{Context, bail};
use kerrlight_common::toml_file::Keys;
use kerrlight_tomo::fit::settings::read;
use schemars::JsonSchema;
use serde::Deserialize;
use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::LazyLock;
use toml::{Table, Value};

static KEYS: LazyLock<Keys> = LazyLock::new(Keys::of::<Experiment>);

/// An experiment: fits that differ in named factors, and what is shown of them.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Experiment {
    /// Title, in a few words.
    pub title: String,
    /// Question of the experiment.
    pub question: String,
    /// Setup: what was simulated, how it was fitted and where settings come from, paragraph by paragraph.
    #[serde(default)]
    pub setup: Vec<String>,
    /// Reading of the results, paragraph by paragraph.
    #[serde(default)]
    pub reading: Vec<String>,
    /// Seeds 1 to this are run of every case.
    #[schemars(range(min = 1))]
    pub seeds: u64,
    /// Draws around every fit, as `kerrlight posterior` makes them; none, without it.
    #[schemars(range(min = 2, max = 100_000), extend("unit" = "draws"))]
    pub samples: Option<u32>,
    /// The fit that all cases change, relative to this file; levels of factors may name others.
    pub fit: Option<PathBuf>,
    /// Settings of all cases.
    #[serde(default)]
    #[schemars(with = "std::collections::BTreeMap<String, schemars::Schema>")]
    pub set: Table,
    /// Changes of `--quick`.
    #[serde(default)]
    pub quick: Quick,
    /// Factors in which the cases differ.
    #[serde(default)]
    pub factor: Vec<Factor>,
    /// Combinations of levels, by the factors' names, that are left out.
    #[serde(default)]
    pub skip: Vec<BTreeMap<String, String>>,
    /// Tables of the report.
    #[serde(default)]
    pub table: Vec<TableAsked>,
    /// Pictures of the report.
    #[serde(default)]
    pub figure: Vec<FigureAsked>,
}

/// Changes of `--quick`: a look at whether an experiment runs, not a measurement.
#[derive(Debug, Clone, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Quick {
    /// Seeds.
    #[schemars(range(min = 1))]
    pub seeds: Option<u64>,
    /// Draws around every fit.
    #[schemars(range(min = 2, max = 100_000), extend("unit" = "draws"))]
    pub samples: Option<u32>,
    /// Settings of all cases, after everything else.
    #[serde(default)]
    #[schemars(with = "std::collections::BTreeMap<String, schemars::Schema>")]
    pub set: Table,
    /// `factor=level` that are kept; all without any.
    #[serde(default)]
    pub only: Vec<String>,
}

/// Something that cases differ in.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Factor {
    /// Its name.
    pub name: String,
    /// Its levels.
    #[serde(default)]
    pub level: Vec<Level>,
    /// Instead of levels: a setting with dots ...
    pub key: Option<String>,
    /// ... and its values, which are also their names.
    #[serde(default)]
    #[schemars(with = "Vec<schemars::Schema>")]
    pub values: Vec<Value>,
    /// Values are multiplied by this before they become settings: for units.
    pub scale: Option<f64>,
    /// All levels, those of values included.
    #[serde(skip)]
    pub levels: Vec<Level>,
}

/// Level of a factor.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Level {
    /// Its name.
    pub name: String,
    /// Its place on an axis of numbers.
    pub number: Option<f64>,
    /// The fit that these cases change.
    pub fit: Option<PathBuf>,
    /// Settings.
    #[serde(default)]
    #[schemars(with = "std::collections::BTreeMap<String, schemars::Schema>")]
    pub set: Table,
    /// Settings with dots that are taken away.
    #[serde(default)]
    pub remove: Vec<String>,
}

/// Results of which more is better.
pub const QUALITIES: [&str; 4] = ["psnr_db", "psnr_inside_db", "correlation", "axis_dot_truth"];

/// A table of means and standard deviations over seeds.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct TableAsked {
    /// Title.
    pub title: String,
    /// Caption, for someone who has not read the paper.
    pub caption: String,
    /// Name of the result.
    pub value: String,
    /// Factors of the rows.
    pub rows: Vec<String>,
    /// Factors of the columns.
    #[serde(default)]
    pub columns: Vec<String>,
    /// Levels of the other factors.
    #[serde(default)]
    pub r#where: BTreeMap<String, String>,
    /// A factor of which each cell has its best level.
    pub best_of: Option<String>,
    /// Rows of numbers from elsewhere.
    #[serde(default)]
    pub beside: Vec<Companion>,
}

/// A row of numbers from elsewhere, to hold the others against.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Companion {
    /// Name of the numbers, and their source.
    pub name: String,
    /// One for each combination of the columns' levels, the last factor fastest; NaN where there is none.
    #[schemars(with = "Vec<schemars::Schema>")]
    pub values: Vec<f64>,
}

/// A picture.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct FigureAsked {
    /// Which.
    pub kind: FigureKind,
    /// Title.
    pub title: String,
    /// Caption.
    pub caption: String,
    /// Factors of the rows, or of the curves.
    #[serde(default)]
    pub rows: Vec<String>,
    /// Factors of the columns; of a curve or map, of the axis to the right.
    #[serde(default)]
    pub columns: Vec<String>,
    /// Name of the result.
    pub value: Option<String>,
    /// True if volumes have a row for every seed, not for the first one alone.
    #[serde(default)]
    pub every_seed: bool,
    /// Azimuth and elevation from which volumes are seen, degrees; along the true axis without it.
    pub view: Option<[f64; 2]>,
    /// Part of the movie that has passed when volumes are shown, carried along from the reference time; at the reference
    /// time itself without it.
    #[schemars(range(min = 0.0, max = 1000.0), extend("unit" = "lengths of the movie"))]
    pub later: Option<f64>,
    /// Levels of the other factors.
    #[serde(default)]
    pub r#where: BTreeMap<String, String>,
}

/// Kinds of pictures.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum FigureKind {
    /// The truth and the recovered volumes.
    Volumes,
    /// A result while a fit runs, against seconds.
    Time,
    /// A result against a factor of numbers.
    Curve,
    /// Static images of the first seed, one beside the other.
    Images,
    /// Means of a result over two factors of numbers.
    Map,
    /// The loss over the sphere of axes.
    Axes,
    /// (u, v) coverage.
    Coverage,
    /// Angular velocities: what was simulated and what was assumed.
    Velocities,
    /// Probabilities of inclination, position angle, radius and period from light curves, a curve for each case of the
    /// first seed.
    Geometries,
    /// Loops in Q and U of data and model, a plot for each case of the first seed.
    Loops,
}

impl Experiment {
    /// Reads and checks.
    pub fn parse(text: &str) -> anyhow::Result<Self> {
        let mut experiment: Self = read(text, &KEYS)?;
        experiment.factor.iter_mut().for_each(|factor| factor.levels = factor.all_levels());
        experiment.check()?;
        Ok(experiment)
    }

    /// Draws around every fit, in a quick look or not.
    pub fn samples(&self, quick: bool) -> Option<u32> {
        self.quick.samples.filter(|_| quick).or(self.samples)
    }

    /// Refuses results of draws where there are none.
    fn check_draws(&self) -> anyhow::Result<()> {
        let tables = self.table.iter().map(|table| (&table.title, Some(&table.value)));
        let figures = self.figure.iter().map(|figure| (&figure.title, figure.value.as_ref()));
        let is_of_draws = |value: &String| {
            value.contains(WITHIN) || RANKED.iter().any(|name| value.starts_with(name))
        };
        for (title, value) in tables.chain(figures) {
            if let Some(value) = value.filter(|value| is_of_draws(value))
                && self.samples.is_none()
            {
                bail!("{title:?}: value = {value:?} needs draws: give `samples = 20`");
            }
        }
        Ok(())
    }

    /// Seeds of cases are told by `seeds` alone.
    fn check_seed(&self) -> anyhow::Result<()> {
        let levels = self.factor.iter().flat_map(|factor| &factor.levels).map(|level| &level.set);
        let mut all = levels.chain([&self.set, &self.quick.set]);
        if all.any(|set| set.contains_key("seed")) {
            bail!("`seed` is not allowed among the settings: `seeds` tells how many there are");
        }
        Ok(())
    }

    fn check(&self) -> anyhow::Result<()> {
        self.check_draws()?;
        self.check_seed()?;
        for (k, factor) in self.factor.iter().enumerate() {
            factor.check()?;
            if self.factor[..k].iter().any(|other| other.name == factor.name) {
                bail!("factor {:?} is there twice", factor.name);
            }
        }
        for skip in &self.skip {
            self.known(skip).context("skip")?;
        }
        for table in &self.table {
            let name = || format!("table {:?}", table.title);
            known_result(&table.value).with_context(name)?;
            // Each cell tells its best level, so that this factor is not left open.
            let rows: Vec<String> = table.rows.iter().chain(&table.best_of).cloned().collect();
            self.shown(&rows, &table.columns, &table.r#where, true).with_context(name)?;
            if table.best_of.is_some() && !QUALITIES.contains(&table.value.as_str()) {
                let all = QUALITIES.join(", ");
                bail!("table {:?}: best_of is for {all}, not for {:?}", table.title, table.value);
            }
            let columns: usize = table.columns.iter().map(|name| self.levels(name).len()).product();
            if let Some(beside) = table.beside.iter().find(|row| row.values.len() != columns) {
                let (what, count) = (&beside.name, beside.values.len());
                bail!("table {:?}: {what:?} has {count} values for {columns} columns", table.title);
            }
        }
        for figure in &self.figure {
            let name = || format!("figure {:?}", figure.title);
            figure.value.as_deref().map(known_result).transpose().with_context(name)?;
            self.shown(&figure.rows, &figure.columns, &figure.r#where, false).with_context(name)?;
        }
        Ok(())
    }

    /// Levels of one factor.
    pub fn levels(&self, factor: &str) -> &[Level] {
        let factor = self.factor.iter().find(|f| f.name == factor);
        factor.map(|factor| factor.levels.as_slice()).unwrap_or_default()
    }

    /// Those of some factors, with the factors' names.
    pub fn levels_of(&self, factors: &[String]) -> Vec<Vec<(&str, &str)>> {
        let of = |factor: &String| -> Vec<(&str, &str)> {
            let factor = self.factor.iter().filter(|f| f.name == *factor);
            let levels = factor.flat_map(|f| f.levels.iter().map(move |l| (&*f.name, &*l.name)));
            levels.collect()
        };
        factors.iter().map(of).collect()
    }

    fn known(&self, levels: &BTreeMap<String, String>) -> anyhow::Result<()> {
        for (factor, level) in levels {
            let all = self.levels(factor);
            if !all.iter().any(|l| l.name == *level) {
                let names: Vec<&str> = all.iter().map(|l| l.name.as_str()).collect();
                bail!("there is no {factor} = {level:?}: its levels are {}", names.join(", "));
            }
        }
        Ok(())
    }

    /// A cell must not mix levels of a factor that nobody named.
    fn shown(
        &self,
        rows: &[String],
        columns: &[String],
        fixed: &BTreeMap<String, String>,
        all: bool,
    ) -> anyhow::Result<()> {
        self.known(fixed)?;
        let named = |name: &String| rows.contains(name) || columns.contains(name);
        for name in rows.iter().chain(columns) {
            if !self.factor.iter().any(|factor| factor.name == *name) {
                bail!("there is no factor {name:?}");
            }
        }
        let free = |f: &&Factor| !named(&f.name) && !fixed.contains_key(&f.name);
        match self.factor.iter().find(free) {
            Some(factor) if all => {
                bail!("factor {:?} is neither in rows nor in columns nor in where", factor.name)
            }
            _ => Ok(()),
        }
    }
}

/// Refuses a result that no fit has.
fn known_result(value: &str) -> anyhow::Result<()> {
    let of_one = value.strip_prefix(ONE_CHI2).is_some_and(|name| !name.is_empty());
    if of_one || RESULTS.iter().any(|(key, ..)| *key == value) {
        return Ok(());
    }
    let all: Vec<&str> = RESULTS.iter().map(|(key, ..)| *key).collect();
    bail!(
        "value = {value:?} is not allowed: {}, or {ONE_CHI2}closure-phases and the like",
        all.join(", ")
    )
}

/// Columns of every case, which no factor may be called.
const COLUMNS: [&str; 3] = ["seed", "status", "verdict"];

impl Factor {
    fn check(&self) -> anyhow::Result<()> {
        let name = &self.name;
        if COLUMNS.contains(&name.as_str()) {
            bail!("factor: name = {name:?} is not allowed: every case has such a column");
        }
        match (&self.key, self.level.is_empty(), self.values.is_empty()) {
            (None, false, true) | (Some(_), true, false) => {}
            _ => bail!("factor {name:?} needs either levels, or a key with values"),
        }
        for (k, level) in self.levels.iter().enumerate() {
            if self.levels[..k].iter().any(|other| other.name == level.name) {
                bail!("factor {name:?}: level {:?} is there twice", level.name);
            }
        }
        Ok(())
    }

    fn all_levels(&self) -> Vec<Level> {
        let Some(key) = &self.key else { return self.level.clone() };
        let level = |value: &Value| {
            let number = value.as_float().or(value.as_integer().map(|n| n as f64));
            let scaled = match (number, self.scale) {
                (Some(number), Some(scale)) => Value::Float(number * scale),
                _ => value.clone(),
            };
            let name = value.as_str().map_or_else(|| value.to_string(), str::to_owned);
            Level { name, number, fit: None, set: nested(key, scaled), remove: Vec::new() }
        };
        self.values.iter().map(level).collect()
    }
}

/// A table in which a key with dots has a value.
fn nested(key: &str, value: Value) -> Table {
    let (first, value) = match key.split_once('.') {
        None => (key, value),
        Some((first, rest)) => (first, Value::Table(nested(rest, value))),
    };
    Table::from_iter([(first.to_owned(), value)])
}
