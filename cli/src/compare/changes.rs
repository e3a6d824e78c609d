//! What changed between two runs of an experiment.

use super::labels::{described, result};
use super::tables;
use crate::answer::Answer;
use crate::checksum::is_whole;
use crate::output;
use crate::report::Table;
use anyhow::{Context, bail};
use serde_json::Value;
use std::collections::HashMap;
use std::path::Path;

/// Results that are held beside each other.
const SHOWN: [&str; 4] = ["psnr_db", "axis_dot_truth", "chi2", "seconds"];

/// What changed in the results at `path` since those before.
///
/// # Errors
/// If they cannot be read, there are none before, or they are of another experiment.
pub fn between(path: &Path, before: Option<&Value>) -> anyhow::Result<Answer> {
    let Some(before) = before else {
        bail!("{} are results: give others with --against", path.display());
    };
    let changed = table(&read(path)?, before)?;
    let answer = Answer::text(tables::markdown(&changed)).with("note", changed.caption);
    Ok(answer.with("head", changed.head).with("rows", changed.rows))
}

/// results.json of a run, or of the run in a folder.
pub fn read(path: &Path) -> anyhow::Result<Value> {
    let path = if path.is_dir() { path.join("results.json") } else { path.to_owned() };
    let name = || format!("{} holds no results of kerrlight compare", path.display());
    let text = output::read_text(&path)?;
    let all: Value = serde_json::from_str(&text).with_context(name)?;
    if !all["checksum"].is_null() && !is_whole(&text) {
        bail!("{} is damaged: its checksum is another", path.display());
    }
    if !all["cases"].is_array() {
        bail!("{}: there are no cases", name());
    }
    Ok(all)
}

fn cases(all: &Value) -> impl Iterator<Item = &Value> {
    all["cases"].as_array().into_iter().flatten()
}

/// Cases that both have (same levels and seed), with old and new results.
pub fn table(new: &Value, old: &Value) -> anyhow::Result<Table> {
    let mut rows = Vec::new();
    let mut added = 0;
    let key = |case: &Value| format!("{} {}", case["levels"], case["seed"]);
    let mut before: HashMap<String, &Value> = cases(old).map(|case| (key(case), case)).collect();
    for case in cases(new) {
        match before.remove(&key(case)) {
            Some(before) => rows.push(row(case, before)),
            None => added += 1,
        }
    }
    let gone = before.len();
    if rows.is_empty() {
        bail!("the two runs have no case in common");
    }
    let is_quick = |all: &Value| all["quick"].as_bool().unwrap_or(false);
    let quick = match (is_quick(old), is_quick(new)) {
        (false, false) => "",
        (true, true) => " Both runs are quick looks, not results.",
        (true, false) => " The run before is a quick look, not a result.",
        (false, true) => " The run now is a quick look, not a result.",
    };
    let head = SHOWN.iter().map(|key| format!("{}: before → now", described(key).0));
    Ok(Table {
        title: "What changed".to_owned(),
        caption: format!(
            "Cases with the same levels and seed. Versions: {} before, {} now. {added} cases are new, {gone} are \
             gone. A star marks cases whose settings differ.{quick}",
            old["version"].as_str().unwrap_or("?"),
            new["version"].as_str().unwrap_or("?"),
        ),
        head: std::iter::once("case".to_owned()).chain(head).collect(),
        rows,
        links: Vec::new(),
    })
}

fn row(new: &Value, old: &Value) -> Vec<String> {
    let levels = new["levels"].as_object().into_iter().flatten();
    let mut name: Vec<String> =
        levels.map(|(_, level)| level.as_str().unwrap_or_default().to_owned()).collect();
    let star = if new["settings"] == old["settings"] { "" } else { "*" };
    name.push(format!("seed {}{star}", new["seed"]));
    let cell = |key: &&str| {
        let digits = described(key).1;
        let [before, now] = [old, new].map(|case| result(&case["results"], key));
        let text = |x: Option<f64>| x.map_or("–".to_owned(), |x| format!("{x:.digits$}"));
        match (before, now) {
            (Some(a), Some(b)) => format!("{a:.digits$} → {b:.digits$} ({:+.digits$})", b - a),
            (None, None) => "–".to_owned(),
            _ => format!("{} → {}", text(before), text(now)),
        }
    };
    std::iter::once(name.join(", ")).chain(SHOWN.iter().map(cell)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn exact_cases_are_matched_by_levels_and_seeds() {
        let case = |level: &str, seed: u64, psnr: f64| json!({"levels": {"what": level}, "seed": seed, "settings": {"a": psnr > 40.0}, "results": {"psnr_db": psnr}});
        let old = json!({"version": "1", "cases": [case("a", 1, 40.0), case("b", 1, 30.0)]});
        let new = json!({"version": "2", "cases": [case("a", 1, 41.5), case("a", 2, 39.0)]});
        let table = table(&new, &old).unwrap();
        assert_eq!(table.rows.len(), 1);
        assert_eq!(table.rows[0][..2], ["a, seed 1*", "40.00 → 41.50 (+1.50)"]);
        assert!(table.caption.contains("1 cases are new, 1 are gone"));
        assert!(super::table(&json!({"cases": []}), &old).is_err());
    }
}
