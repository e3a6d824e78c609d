//! A quick look: what `--quick` shows, and what it must not claim.

use super::experiment::Experiment;
use crate::report::{Notice, Tone};

/// Words in the heading, on every table and on every picture.
pub const WORDS: &str = "Quick look, not a result";

/// An experiment without all that its full settings would be needed for: texts that speak of those settings, numbers
/// from elsewhere, best levels. Titles of the tables that are left out come along.
pub fn look(experiment: &Experiment) -> (Experiment, Vec<String>) {
    let mut look = experiment.clone();
    look.title = format!("{} ({})", look.title, WORDS.to_lowercase());
    look.setup.clear();
    look.reading.clear();
    let (kept, left): (Vec<_>, Vec<_>) =
        look.table.into_iter().partition(|table| table.best_of.is_none());
    look.table = kept;
    for table in &mut look.table {
        table.caption = format!("{WORDS}.");
        table.beside.clear();
    }
    look.figure.iter_mut().for_each(|figure| figure.caption = format!("{WORDS}."));
    let left = left.into_iter().map(|table| {
        format!("Table {:?}: the best of several levels is no matter of a quick look.", table.title)
    });
    (look, left.collect())
}

/// Returns the notice at the top of the page.
pub fn notice() -> Notice {
    Notice {
        tone: Tone::Bad,
        headline: format!("{WORDS}."),
        text: vec![
            "It shows that the experiment runs. Steps, pixels and cases are those of the table \"What ran\", not those of \
             the experiment: nothing follows from the numbers, neither their size nor their order."
                .to_owned(),
        ],
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::compare::source::{Source, built_in};
    use std::path::Path;

    /// No text of an experiment that speaks of its settings is left, and no number that is not from this run.
    #[test]
    fn exact_quick_looks_claim_nothing() {
        for (name, _) in built_in() {
            let (_, text) = Source::find(Path::new(name)).unwrap();
            let experiment = Experiment::parse(&text).unwrap();
            let (look, left) = look(&experiment);
            assert!(look.title.ends_with("(quick look, not a result)"), "{}", look.title);
            assert!(look.setup.is_empty() && look.reading.is_empty());
            assert_eq!(look.table.len() + left.len(), experiment.table.len());
            for table in &look.table {
                assert!(table.beside.is_empty() && table.best_of.is_none());
                assert_eq!(table.caption, "Quick look, not a result.");
            }
            assert!(look.figure.iter().all(|figure| figure.caption == "Quick look, not a result."));
        }
    }
}
