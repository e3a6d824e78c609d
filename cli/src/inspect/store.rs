//! What a store of Zarr holds.

use super::arrays::{Line, Survey, answer};
use crate::answer::Answer;
use crate::zarr::{Reading, Store};
use anyhow::Context;
use serde_json::{Map, Value, json};
use std::path::Path;

/// The arrays of a store, read chunk by chunk, and what it tells of itself.
pub fn describe(path: &Path) -> anyhow::Result<Answer> {
    let store = Store::open(path)?;
    let names = store.names.iter();
    let shown = names.filter(|name| store.chosen.as_ref().is_none_or(|chosen| chosen == *name));
    let lines = shown.map(|name| match store.array(name) {
        Ok(array) => line(&array.context("no array")?),
        // Others may be read nevertheless.
        Err(error) => Ok(Line::new((name, &[], "unknown"), None, &format!("  {error}"))),
    });
    let lines = lines.collect::<anyhow::Result<Vec<_>>>()?;
    let answer = answer(path, "Zarr", &lines);
    if store.attributes.is_empty() {
        return Ok(answer);
    }
    Ok(answer.and_text(&told(&store.attributes)).with("attributes", json!(store.attributes)))
}

fn line(array: &Reading) -> anyhow::Result<Line> {
    let (kind, chunk) = (array.kind(), array.chunk()?);
    let mut survey = None;
    if array.is_numbers() {
        let found = survey.insert(Survey::default());
        array.chunks(|some| some.into_iter().for_each(|x| found.add(x)))?;
    }
    let attributes = array.attributes();
    let unit = attributes.get("units").and_then(Value::as_str);
    let unit = unit.map_or(String::new(), |unit| format!(", {unit}"));
    let rest = format!("  chunks {chunk:?}{unit}");
    let line = Line::new((&array.name, array.shape(), &kind), survey.as_ref(), &rest);
    Ok(line.with("chunk", json!(chunk)).with("attributes", json!(attributes)))
}

/// Attributes, a short value on the line of its name, a long one below.
fn told(attributes: &Map<String, Value>) -> String {
    let line = |(name, value): (&String, &Value)| {
        let text = value.as_str().map_or_else(|| value.to_string(), str::to_owned);
        format!("\n{name}:{}\n", super::indented(&text))
    };
    attributes.iter().map(line).collect()
}
