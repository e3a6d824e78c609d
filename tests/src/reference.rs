//! The reference is complete: it has every verb, option, key and channel of the program, and no options that the
//! program does not have.

use crate::documents::read;
use crate::support::{kerrlight, message, root};
use std::collections::BTreeSet;
use std::path::Path;

/// The verbs of the program, as its help lists them.
fn verbs() -> Vec<String> {
    let help = String::from_utf8(kerrlight(&root(), &["--help"]).stdout).expect("text");
    let named = |line: &str| {
        let (verb, about) = line.strip_prefix("  ")?.split_once("  ")?;
        let is_verb =
            verb.chars().all(|c| c.is_ascii_lowercase() || c == '-') && !verb.starts_with('-');
        (is_verb && !verb.is_empty() && !about.trim().is_empty()).then(|| verb.to_owned())
    };
    help.lines().filter_map(named).filter(|verb| verb != "help").collect()
}

/// The long options that a line of a help page or of a table introduces.
fn options(line: &str) -> impl Iterator<Item = &str> {
    let introduced = line.split("  ").find(|part| !part.is_empty()).unwrap_or("");
    let words = introduced.split(|c: char| !c.is_ascii_alphanumeric() && c != '-');
    words.filter(|word| word.starts_with("--") && word.len() > 2)
}

/// Each verb has a page of the reference, whose tables have its options, all of them and no others.
#[test]
fn regress_the_reference_has_every_option() {
    const COMMON: [&str; 5] = ["--help", "--version", "--threads", "--memory", "--json"];
    let verbs = verbs();
    assert!(verbs.len() > 8, "only {verbs:?}");
    for verb in verbs {
        let page = read(&root().join(format!("docs/reference/{verb}.md")));
        let help = kerrlight(&root(), &[verb.as_str(), "--help"]);
        let help = String::from_utf8(help.stdout).expect("text");
        let introduces = |line: &&str| line.trim_start().starts_with('-');
        let known: BTreeSet<&str> = help.lines().filter(introduces).flat_map(options).collect();
        let rows = page.lines().filter(|line| line.starts_with("| `-"));
        let described: BTreeSet<&str> =
            rows.flat_map(|row| options(row.split(" | ").next().unwrap())).collect();
        for option in &known {
            let has = described.contains(option) || COMMON.contains(option);
            assert!(has, "docs/reference/{verb}.md does not describe {option}");
        }
        for option in described {
            assert!(known.contains(option), "docs/reference/{verb}.md describes {option}");
        }
    }
}

/// The table of channels is that of the program.
#[test]
fn regress_channels_are_documented() {
    let table = read(&root().join("docs/reference/exr.md"));
    for channel in &kerrlight_render::picture::CHANNELS {
        assert!(table.contains(&format!("`{}`", channel.name)), "{}", channel.name);
    }
}

/// Words of the spans of code of a page, or of one of its sections.
fn code_words(text: &str) -> BTreeSet<&str> {
    let is_word = |c: char| c.is_ascii_alphanumeric() || c == '_' || c == '-';
    let spans = text.split('`').skip(1).step_by(2);
    spans.flat_map(|span| span.split(move |c| !is_word(c))).collect()
}

/// The keys that a table may have, as the refusal of an unknown one lists them behind its name.
fn allowed(folder: &Path, arguments: &[&str]) -> Vec<String> {
    const AROUND: [&str; 7] = ["expected", "one", "of", "or", "in", "available", "keys"];
    let output = kerrlight(folder, arguments);
    let errors = message(&output);
    assert!(!output.status.success() && errors.contains("nonsense"), "{arguments:?}: {errors}");
    let list = errors.rsplit("nonsense").next().unwrap();
    let words = list.split(|c: char| !c.is_ascii_alphanumeric() && c != '_' && c != '-');
    words.filter(|word| !word.is_empty() && !AROUND.contains(word)).map(str::to_owned).collect()
}

fn check(page: &str, text: &str, keys: &[String]) {
    assert!(!keys.is_empty());
    let words = code_words(text);
    for key in keys {
        assert!(words.contains(key.as_str()), "docs/reference/{page} does not describe {key}");
    }
}

#[test]
fn regress_the_reference_has_every_key_of_an_experiment() {
    let folder = tempfile::tempdir().unwrap();
    let page = read(&root().join("docs/reference/experiment-file.md"));
    let text = read(&root().join("experiments/cost.toml"));
    for heading in ["[quick]", "[[factor]]", "[[factor.level]]", "[[table]]", "[[figure]]"] {
        let unknown =
            text.replacen(&format!("\n{heading}\n"), &format!("\n{heading}\nnonsense = 1\n"), 1);
        std::fs::write(folder.path().join("unknown.toml"), unknown).unwrap();
        let keys = allowed(folder.path(), &["compare", "unknown.toml", "--list"]);
        check("experiment-file.md", &page, &keys);
    }
}
