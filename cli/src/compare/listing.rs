//! What there is to run, as text and as JSON.

use super::cases::Case;
use super::source;
use crate::answer::Answer;
use serde_json::json;
use toml::Table;

/// Built-in experiments.
pub fn experiments() -> Answer {
    let line = |(name, title): (&str, String)| format!("{name:20} {title}\n");
    let all: String = source::built_in().map(line).collect();
    let entries = source::built_in().map(|(name, title)| json!({"name": name, "title": title}));
    Answer::text(format!("{all}\nRun one with: kerrlight compare NAME\n"))
        .with("experiments", entries.collect::<Vec<_>>())
}

/// Cases of an experiment: name of the folder, expected cost and command, with tabs between; as JSON also what is wrong
/// with their settings, which is told on standard error besides.
pub fn cases(cases: &[Case], command: &[String]) -> Answer {
    let command = command.iter().map(|word| quoted(word)).collect::<Vec<_>>().join(" ");
    let mut text = String::new();
    let mut entries = Vec::new();
    for case in cases {
        let command = format!("{command} --case {}", case.slug);
        let cost = cost(case);
        match &case.error {
            None => text += &format!("{}\t{cost:.3e}\t{command}\n", case.slug),
            Some(error) => eprintln!("cannot be run: {}: {error}", case.name()),
        }
        entries.push(json!({
            "id": case.slug, "name": case.name(), "cost": cost, "command": command, "error": case.error,
        }));
    }
    Answer::text(text).with("cases", entries)
}

/// Rays that the steps of a fit look at, all together: a measure of its time against that of others of its kind.
fn cost(case: &Case) -> f64 {
    let Some(settings) = case.settings().ok().and_then(|text| text.parse::<Table>().ok()) else {
        return 0.0;
    };
    let number = |path: &[&str]| -> Option<f64> {
        let first = settings.get(path[0])?;
        let value = path[1..].iter().try_fold(first, |value, key| value.get(key))?;
        value.as_float().or_else(|| value.as_integer().map(|whole| whole as f64))
    };
    let side =
        number(&["screen", "pixels"]).or_else(|| number(&["image", "pixels"])).unwrap_or(1.0);
    let frames = number(&["movie", "frames"]).or_else(|| number(&["observation", "scans"]));
    let rays = match number(&["training", "batch", "pixels"]) {
        Some(pixels) => pixels,
        None => {
            let of_step = number(&["training", "batch", "frames"]).or(frames).unwrap_or(1.0);
            of_step * side * side
        }
    };
    number(&["training", "steps"]).unwrap_or(1.0) * rays
}

/// A word as a shell reads it.
fn quoted(word: &str) -> String {
    let is_plain = |c: char| c.is_ascii_alphanumeric() || "-_=./:,+@%".contains(c);
    if !word.is_empty() && word.chars().all(is_plain) {
        return word.to_owned();
    }
    format!("'{}'", word.replace('\'', r"'\''"))
}
