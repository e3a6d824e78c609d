//! Contents of arrays of NumPy: movies, volumes, tables.

use crate::answer::Answer;
use crate::output;
use anyhow::Context;
use kerrlight_common::numpy;
use npyz::{DType, NpyFile, Order, TypeChar};
use serde_json::{Value, json};
use std::io::{BufReader, Read};
use std::path::Path;

/// Returns whether a file that starts so is an NPY array or an NPZ archive.
pub fn begins(start: &[u8]) -> bool {
    is_npy(start) || start.starts_with(b"PK\x03\x04") || start.starts_with(b"PK\x05\x06")
}

fn is_npy(start: &[u8]) -> bool {
    start.starts_with(b"\x93NUMPY")
}

/// The arrays of a file that starts with `start`: a line each.
pub fn describe(path: &Path, start: &[u8]) -> anyhow::Result<Answer> {
    let file = BufReader::new(output::open(path)?);
    if is_npy(start) {
        return Ok(answer(path, "NPY", &[array("array", file)?]));
    }
    let mut archive = zip::ZipArchive::new(file).context("damaged NPZ archive")?;
    let mut lines = Vec::new();
    for k in 0..archive.len() {
        let member = archive.by_index(k).context("damaged NPZ archive")?;
        let name = member.name().context("damaged NPZ archive")?.into_owned();
        let called = name.strip_suffix(".npy").unwrap_or(&name).to_owned();
        lines.push(array(&called, member).with_context(|| format!("array {called}"))?);
    }
    Ok(answer(path, "NPZ", &lines))
}

/// Describes arrays, a line each.
fn answer(path: &Path, format: &str, lines: &[Line]) -> Answer {
    let name = path.display();
    let holds = if format == "NPY" { None } else { kind(lines) };
    let what = holds.as_ref().map_or(String::new(), |what| format!(", {what}"));
    let text: String = lines.iter().map(|line| line.text.as_str()).collect();
    let arrays: Vec<Value> = lines.iter().map(|line| line.json.clone()).collect();
    Answer::text(format!("{name}: {format}{what}\n\n{HEAD}{text}"))
        .with("file", name.to_string())
        .with("format", format)
        .with("holds", holds)
        .with("arrays", arrays)
}

const HEAD: &str = "array           shape                 type              least           most           mean  not finite\n";

/// A line about an array.
struct Line {
    name: String,
    shape: Vec<u64>,
    text: String,
    json: Value,
}

/// Returns what kerrlight takes an archive for.
fn kind(lines: &[Line]) -> Option<String> {
    let shape = |name: &str| lines.iter().find(|line| line.name == name).map(|line| &line.shape);
    if let Some([x, y, z]) = shape("emission").map(Vec::as_slice) {
        return Some(format!("a volume of {x} x {y} x {z} nodes"));
    }
    let movie = ["movie", "image", "recovered"].iter().find_map(|name| shape(name));
    match movie.map(Vec::as_slice) {
        Some([frames, height, width]) => {
            Some(format!("a movie of {frames} frames of {width} x {height} pixels"))
        }
        Some([height, width]) => Some(format!("an image of {width} x {height} pixels")),
        _ => None,
    }
}

/// Numbers of an array, one after the other; nothing is kept but these.
#[derive(Default)]
struct Survey {
    first: Vec<f64>,
    least: Option<f64>,
    most: Option<f64>,
    sum: f64,
    finite: u64,
    not_finite: u64,
}

/// Number of values up to which they are shown one by one.
const SHOWN: usize = 4;

impl Survey {
    /// Returns the mean of the finite numbers.
    fn mean(&self) -> Option<f64> {
        (self.finite > 0).then(|| self.sum / self.finite as f64)
    }

    /// Counts a number.
    fn add(&mut self, value: f64) {
        // One more than is shown tells that there are more.
        if self.first.len() <= SHOWN {
            self.first.push(value);
        }
        if !value.is_finite() {
            self.not_finite += 1;
            return;
        }
        self.finite += 1;
        self.sum += value;
        self.least = Some(self.least.map_or(value, |least| least.min(value)));
        self.most = Some(self.most.map_or(value, |most| most.max(value)));
    }
}

/// Describes an array.
fn array(name: &str, file: impl Read) -> anyhow::Result<Line> {
    let file = numpy::open(file).context("not an array of NumPy")?;
    let shape = file.shape().to_vec();
    let order =
        if file.order() == Order::Fortran && shape.len() > 1 { ", Fortran order" } else { "" };
    let kind = file.dtype().descr().replace(['\'', ' '], "");
    let found = survey(file)?;
    let lengths: Vec<String> = shape.iter().map(u64::to_string).collect();
    let lengths = format!("({})", lengths.join(", "));
    let counted = found.as_ref().map_or("    no numbers".to_owned(), numbers);
    let text = format!("{name:<16}{lengths:<22}{kind:<10}{counted}{order}\n");
    let mut json = json!({"name": name, "shape": shape, "type": kind});
    if let Some(found) = found {
        json["least"] = json!(found.least);
        json["most"] = json!(found.most);
        json["mean"] = json!(found.mean());
        json["not_finite"] = json!(found.not_finite);
    }
    Ok(Line { name: name.to_owned(), shape, text, json })
}

fn numbers(found: &Survey) -> String {
    let cell = |x: Option<f64>| x.map_or(format!("{:>15}", "-"), |x| format!("{x:>15.6e}"));
    let [least, most, mean] = [found.least, found.most, found.mean()].map(cell);
    let all =
        if found.first.len() <= SHOWN { format!("  {:?}", found.first) } else { String::new() };
    format!("{least}{most}{mean}{:>12}{all}", found.not_finite)
}

/// The numbers of an array; none where it holds something else.
fn survey(file: NpyFile<impl Read>) -> anyhow::Result<Option<Survey>> {
    use TypeChar::{Float, Int, Uint};
    fn of<T: npyz::Deserialize>(
        file: NpyFile<impl Read>,
        value: impl Fn(T) -> f64,
    ) -> anyhow::Result<Option<Survey>> {
        let mut survey = Survey::default();
        for number in file.data::<T>()? {
            survey.add(value(number.context("the array ends early")?));
        }
        Ok(Some(survey))
    }
    let DType::Plain(plain) = file.dtype() else { return Ok(None) };
    match (plain.type_char(), plain.size_field()) {
        (Float, 4) => of::<f32>(file, f64::from),
        (Float, 8) => of::<f64>(file, |x| x),
        (Int, 1) => of::<i8>(file, f64::from),
        (Int, 2) => of::<i16>(file, f64::from),
        (Int, 4) => of::<i32>(file, f64::from),
        (Int, 8) => of::<i64>(file, |n| n as f64),
        (Uint, 1) => of::<u8>(file, f64::from),
        (Uint, 2) => of::<u16>(file, f64::from),
        (Uint, 4) => of::<u32>(file, f64::from),
        (Uint, 8) => of::<u64>(file, |n| n as f64),
        _ => Ok(None),
    }
}
