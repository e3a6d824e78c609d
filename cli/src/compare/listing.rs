//! List of the cases, as text and as JSON.

use super::cases::Case;
use super::runner::TOGETHER;
use super::source;
use crate::answer::Answer;
use crate::plain;
use rayon::prelude::*;
use serde_json::{Value, json};

/// Built-in experiments.
pub fn experiments() -> Answer {
    let line = |(name, title): (&str, String)| format!("{name:20} {title}\n");
    let all: String = source::built_in().map(line).collect();
    let entries = source::built_in().map(|(name, title)| json!({"name": name, "title": title}));
    Answer::text(format!("{all}\nRun one with: kerrlight compare NAME\n"))
        .with("experiments", entries.collect::<Vec<_>>())
}

/// Cases of an experiment, one after the other: name of the folder, expected cost and command, with tabs between; as
/// JSON also what is wrong with their settings, which is told on standard error besides.
pub fn cases(cases: Vec<Case>, command: &[String]) -> Answer {
    let command = command.iter().map(|word| plain::quoted(word)).collect::<Vec<_>>().join(" ");
    let mut lines: Vec<(String, Value)> = Vec::new();
    let all = (0..cases.len()).map(move |k| {
        // A stretch at a time: its lines are made in parallel, and the first ones are printed
        // before the last ones exist.
        if k % TOGETHER == 0 {
            let next = &cases[k..cases.len().min(k + TOGETHER)];
            lines = next.par_iter().map(|case| line(case, &command)).collect();
        }
        let (text, entry) = std::mem::take(&mut lines[k % TOGETHER]);
        if let (Some(error), Some(name)) = (entry["error"].as_str(), entry["name"].as_str()) {
            eprintln!("cannot be run: {name}: {error}");
        }
        (text, entry)
    });
    Answer::lines_of("cases", all)
}

fn line(case: &Case, command: &str) -> (String, Value) {
    let (id, cost, error) = (case.slug(), case.cost(), case.early_error());
    let command = format!("{command} --case {id}");
    let text = match error {
        None => format!("{id}\t{cost:.3e}\t{command}\n"),
        // Every printed line gets run as a command: a case with wrong settings has none.
        Some(_) => String::new(),
    };
    let entry =
        json!({"id": id, "name": case.name(), "cost": cost, "command": command, "error": error});
    (text, entry)
}
