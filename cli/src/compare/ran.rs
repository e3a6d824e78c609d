//! Requirements and results of cases, from their settings; and what really ran.

use super::cases::{Case, without_seeds};
use super::experiment::{Experiment, FigureKind, QUALITIES, TableAsked};
use super::labels::{ONE_CHI2, pairs};
use super::summary::{Summary, is_at};
use crate::keys;
use crate::paths;
use crate::report::Table;
use anyhow::bail;
use rayon::prelude::*;
use std::collections::{BTreeSet, HashMap};
use std::path::Path;
use toml::Value;

/// Settings that decide how much is computed, and what they are called.
const SHOWN: [(&str, &str); 9] = [
    ("training.steps", "steps of the optimiser, at most"),
    ("screen.pixels", "pixels along each side of an image"),
    ("simulation.movie.frames", "frames of the movie"),
    ("simulation.observation.scans", "scans of the observation"),
    ("simulation.observation.noise", "noise"),
    ("representation.linear-grid.nodes", "nodes along each side of a linear grid"),
    ("linear.rounds", "rounds of the linear problem"),
    ("linear.iterations", "iterations of a round"),
    ("output.nodes", "nodes along each side of the volume that is judged"),
];

/// Most values of a setting that are told.
const TOLD: usize = 20;

/// Cases whose files are looked for before any is run.
const LOOKED_AT: usize = 1000;

/// Refuses cases whose data are not there, before anything is written.
pub fn check_data(cases: &[Case]) -> anyhow::Result<()> {
    for case in cases.iter().take(LOOKED_AT) {
        let Some(settings) = case.table() else { continue };
        for kind in ["visibilities", "light-curve"] {
            let Some(path) = keys::text(&settings, &format!("data.{kind}.path")) else { continue };
            // Only a file of public data has a place of its own; the fit looks for others.
            if path.starts_with('$') {
                let place = paths::of_data(Path::new(&path), Path::new(""))?;
                if !place.is_file() {
                    bail!("data.{kind}.path: {} is not there", place.display());
                }
            }
        }
    }
    Ok(())
}

/// Different values with the number of cases that have them, in the order of the cases.
fn counted(values: impl Iterator<Item = (String, usize)>) -> String {
    let mut all: Vec<(String, usize)> = Vec::new();
    let mut places: HashMap<String, usize> = HashMap::new();
    for (value, count) in values {
        let place = *places.entry(value.clone()).or_insert(all.len());
        match all.get_mut(place) {
            Some((_, all)) => *all += count,
            None => all.push((value, count)),
        }
    }
    match all.as_slice() {
        [(value, _)] => value.clone(),
        many => {
            let told = many.iter().take(TOLD);
            let told = told.map(|(value, count)| format!("{value} ({count} cases)"));
            let mut told = told.collect::<Vec<_>>().join(", ");
            if many.len() > TOLD {
                told += &format!(" and {} more values", many.len() - TOLD);
            }
            told
        }
    }
}

/// Returns the table of what the cases that came to their end ran with; of all cases, where there are none.
pub fn table(summary: &Summary) -> Table {
    let done: Vec<&Case> = summary.done().map(|(case, _)| case).collect();
    let cases: Vec<&Case> =
        if done.is_empty() { summary.all.iter().map(|(case, _)| *case).collect() } else { done };
    let mut counts: HashMap<&[u32], usize> = HashMap::new();
    cases.iter().for_each(|case| *counts.entry(case.chosen()).or_default() += 1);
    // Of each combination of levels the settings that are shown, and how many cases have them.
    let shown = |case: &&Case| {
        let settings = case.table()?;
        let values = SHOWN.map(|(key, _)| keys::text(&settings, key));
        Some((values, counts[case.chosen()]))
    };
    let of_levels = without_seeds(cases.iter().copied());
    let all: Vec<_> = of_levels.par_iter().filter_map(shown).collect();
    let row = |(k, (key, name)): (usize, &(&str, &str))| {
        let values = all.iter().filter_map(|(values, count)| Some((values[k].clone()?, *count)));
        let told = counted(values);
        (!told.is_empty()).then(|| vec![(*name).to_owned(), (*key).to_owned(), told])
    };
    let mut rows: Vec<Vec<String>> = SHOWN.iter().enumerate().filter_map(row).collect();
    let line = |name: &str, key: &str, value: String| vec![name.to_owned(), key.to_owned(), value];
    let steps = summary.done().filter_map(|(_, results)| results.get("steps"));
    let steps = counted(steps.map(|steps| (steps.to_string(), 1)));
    if !steps.is_empty() {
        rows.insert(0, line("steps that were taken", "", steps));
    }
    rows.push(line("seeds", "seed", summary.seeds.to_string()));
    rows.push(line("cases", "", cases.len().to_string()));
    Table::new(
        "What ran",
        "Settings of the cases themselves; results.json has all of them, case by case.",
        ["", "setting", "value"],
        rows,
    )
}

/// Kinds of data that a fit with these settings compares.
fn kinds(settings: &toml::Table) -> Vec<String> {
    let losses = settings.get("loss").and_then(Value::as_array).into_iter().flatten();
    // The polarisation of a static image has no loss among those of total intensity.
    let of_image = settings.get("image").and(settings.get("polarization"));
    let all = losses.chain(of_image).filter_map(|loss| loss.get("data")?.as_str());
    all.map(str::to_owned).collect()
}

/// Explains why a fit with these settings has no such result.
fn missing(settings: &toml::Table, value: &str) -> Option<String> {
    let kinds = kinds(settings);
    let is_beside_truth = QUALITIES.contains(&value) || value == "nrmse";
    if is_beside_truth && !settings.contains_key("simulation") {
        return Some(format!("{value} needs a truth, and data are measured"));
    }
    if value == "chi2" && kinds.len() > 1 {
        let all: Vec<String> = kinds.iter().map(|kind| format!("{ONE_CHI2}{kind}")).collect();
        return Some(format!("chi2 is one of several losses: take {}", all.join(" or ")));
    }
    let name = value.strip_prefix(ONE_CHI2)?;
    (!kinds.iter().any(|kind| kind == name)).then(|| format!("no loss has data = {name:?}"))
}

/// Makes a table for each kind of data beside one of χ², where cases compare several kinds: in its place, where all do.
pub fn split_chi2(experiment: &mut Experiment, cases: &[Case]) {
    if experiment.table.iter().all(|table| table.value != "chi2") {
        return;
    }
    let kinds_of = |case: &&Case| case.table().map(|settings| kinds(&settings));
    let all: Vec<Vec<String>> = without_seeds(cases).par_iter().filter_map(kinds_of).collect();
    let several = all.iter().filter(|kinds| kinds.len() > 1);
    let divided: BTreeSet<&String> = several.flatten().collect();
    let is_whole = all.iter().any(|kinds| kinds.len() == 1);
    let each = |table: TableAsked| -> Vec<TableAsked> {
        if table.value != "chi2" || divided.is_empty() {
            return vec![table];
        }
        let of = |kind: &&String| TableAsked {
            title: format!("{}: {}", table.title, kind.replace('-', " ")),
            value: format!("{ONE_CHI2}{kind}"),
            ..table.clone()
        };
        let parts: Vec<TableAsked> = divided.iter().map(of).collect();
        is_whole.then_some(table).into_iter().chain(parts).collect()
    };
    experiment.table = std::mem::take(&mut experiment.table).into_iter().flat_map(each).collect();
}

/// Refuses tables and figures of results that none of their cases can have.
pub fn check(experiment: &Experiment, cases: &[Case]) -> anyhow::Result<()> {
    let tables = experiment.table.iter().map(|t| ("table", &t.title, t.value.as_str(), &t.r#where));
    let figures = experiment.figure.iter().filter_map(|f| {
        let default = (f.kind == FigureKind::Time).then_some("psnr_db");
        Some(("figure", &f.title, f.value.as_deref().or(default)?, &f.r#where))
    });
    let all = without_seeds(cases);
    for (what, title, value, fixed) in tables.chain(figures) {
        let chosen = all.iter().filter(|case| is_at(case, &pairs(fixed)));
        // To the first that has it: there may be a hundred thousand.
        let settings =
            chosen.filter(|case| case.early_error().is_none()).filter_map(|case| case.table());
        let mut found = settings.map(|settings| missing(&settings, value));
        if let Some(Some(why)) = found.next()
            && found.all(|missing| missing.is_some())
        {
            bail!("{what} {title:?}: value = {value:?} is not allowed: {why}");
        }
    }
    Ok(())
}
