//! What there is to run, as text and as JSON.

use super::cases::Case;
use super::source;
use crate::answer::Answer;
use serde_json::json;

/// Built-in experiments.
pub fn experiments() -> Answer {
    let line = |(name, title): (&str, String)| format!("{name:20} {title}\n");
    let all: String = source::built_in().map(line).collect();
    let entries = source::built_in().map(|(name, title)| json!({"name": name, "title": title}));
    Answer::text(format!("{all}\nRun one with: kerrlight compare NAME\n"))
        .with("experiments", entries.collect::<Vec<_>>())
}

/// Cases of an experiment, with what is wrong with their settings.
pub fn cases(cases: &[Case]) -> Answer {
    let line = |case: &Case| match &case.error {
        None => format!("{}\n", case.name()),
        Some(error) => format!("{}: {error}\n", case.name()),
    };
    let entry = |case: &Case| json!({"name": case.name(), "error": case.error});
    Answer::text(cases.iter().map(line).collect::<String>())
        .with("cases", cases.iter().map(entry).collect::<Vec<_>>())
}
