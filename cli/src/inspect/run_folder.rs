//! Contents of the folder of a fit.

use crate::answer::Answer;
use crate::keys;
use crate::output;
use crate::plain;
use anyhow::{Context, bail};
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::path::Path;
use toml::Table;

/// Title, data, representation, how far it came, results and files.
pub fn describe(folder: &Path) -> anyhow::Result<Answer> {
    let shown = folder.display();
    let settings = folder.join("fit.toml");
    if !settings.is_file() {
        bail!("{shown} is a folder without fit.toml: a file, or the folder of a fit is expected");
    }
    let name = || settings.display().to_string();
    let table: Table = output::read_text(&settings)?.parse().with_context(name)?;
    let log = log(&folder.join("log.jsonl"))?;
    let results = results(&folder.join("results.json"))?;
    let mut text = format!("{shown}: a fit\n\n");
    let mut line =
        |key: &str, value: String| text += &format!("{key:<16}{}\n", plain::line(&value));
    let told = |key: &str| keys::text(&table, key).unwrap_or("not told".to_owned());
    line("title", told("title"));
    line("data", data(&table));
    match keys::at(&table, "image.pixels") {
        Some(pixels) => line("model", format!("static image of {pixels} x {pixels} pixels")),
        None => {
            line("representation", told("representation.kind"));
            line("steps", steps(&told("training.steps"), log.as_ref(), results.is_some()));
        }
    }
    for (key, value) in results.iter().flatten().filter(|(key, _)| *key != "steps") {
        line(key, short(value));
    }
    if results.is_none() {
        line("results", "none yet: the run has not ended".to_owned());
    }
    text.push('\n');
    let files = files(folder)?;
    for (name, size) in &files {
        text += &format!("{name:<28}{size:>12} bytes\n");
    }
    Ok(Answer::text(text)
        .with("folder", shown.to_string())
        .with("format", "fit")
        .with("settings", serde_json::to_value(&table)?)
        .with("last_step", log.map(|line| line["step"].clone()))
        .with("results", results.map(Value::Object))
        .with("contents", json!(files)))
}

fn data(table: &Table) -> String {
    let kinds =
        [("visibilities", "visibilities"), ("movie", "movie"), ("light-curve", "light curve")];
    let file = kinds.into_iter().find_map(|(kind, name)| {
        let path = table.get("data")?.get(kind)?.get("path")?;
        let paths = path.as_array().map_or(core::slice::from_ref(path), Vec::as_slice);
        let paths: Vec<&str> = paths.iter().filter_map(|path| path.as_str()).collect();
        Some(format!("{name} of {}", paths.join(", ")))
    });
    let of = |key: &str| table.get("simulation").and_then(|simulation| simulation.get(key));
    let simulated = || match of("observation").and_then(|seen| seen.get("array")) {
        Some(array) => format!("simulated, seen by {}", array.as_str().unwrap_or_default()),
        None if of("light_curve").is_some() => "a simulated light curve".to_owned(),
        None => "simulated images".to_owned(),
    };
    file.unwrap_or_else(simulated)
}

/// The last whole line of the log.
fn log(path: &Path) -> anyhow::Result<Option<Value>> {
    if !path.exists() {
        return Ok(None);
    }
    let text = output::read_log(path)?;
    Ok(text.lines().rev().find_map(|line| serde_json::from_str(line).ok()))
}

fn results(path: &Path) -> anyhow::Result<Option<serde_json::Map<String, Value>>> {
    if !path.exists() {
        return Ok(None);
    }
    let name = || format!("{} holds no results of a fit", path.display());
    serde_json::from_str(&output::read_text(path)?).map(Some).with_context(name)
}

fn steps(asked: &str, log: Option<&Value>, ended: bool) -> String {
    let done = log.and_then(|line| line["step"].as_u64());
    match (done, ended) {
        (Some(done), true) => format!("{done} of {asked}"),
        (Some(done), false) => format!("{done} of {asked}, as far as the log tells"),
        (None, _) => format!("none logged, of {asked}"),
    }
}

/// A value in one line; long lists are not shown.
fn short(value: &Value) -> String {
    let text = match value {
        Value::String(text) => text.clone(),
        other => other.to_string(),
    };
    let mut start: String = text.chars().take(100).collect();
    if start.len() < text.len() {
        start += " …";
    }
    start
}

/// Names and sizes in bytes of what lies in a folder.
fn files(folder: &Path) -> anyhow::Result<BTreeMap<String, u64>> {
    let name = || format!("cannot read {}", folder.display());
    let mut files = BTreeMap::new();
    for entry in std::fs::read_dir(folder).with_context(name)? {
        let entry = entry.with_context(name)?;
        let size = entry.metadata().with_context(name)?.len();
        files.insert(entry.file_name().to_string_lossy().into_owned(), size);
    }
    Ok(files)
}
