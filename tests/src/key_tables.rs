//! Tables of keys in the reference are those of the types that files are read into.
//!
//! A page has a line `<!-- keys of a fit: hole, observer -->` above each of them. With `KERRLIGHT_WRITE_REFERENCE=1` in
//! the environment this test writes the tables.

use crate::documents::read;
use crate::support::root;
use kerrlight_common::toml_file::{Key, Keys, bound};
use kerrlight_imaging::settings::StaticImageFile;
use kerrlight_render::scene::Scene;
use kerrlight_tomo::fit::settings::FitFile;
use std::collections::BTreeSet;

/// Begins the line above a table.
const MARK: &str = "<!-- keys of a ";

/// Keys that hold a copy of what stands elsewhere, or what is not ours.
const COPIES: [&str; 9] = [
    "motion.velocity.perturbed.of",
    "volume.rotation.perturbed.of",
    "simulation.hole",
    "simulation.observer",
    "simulation.region",
    "simulation.effects",
    "simulation.motion",
    "simulation.polarization",
    "representation.own.settings",
];

/// Numbers that may have a prior, which is described once, under the first of them.
const PRIORS: [&str; 6] = [
    "hole.spin",
    "observer.inclination_deg",
    "observer.position_angle_deg",
    "motion.velocity.infall.xi",
    "motion.velocity.infall.beta_r",
    "motion.velocity.infall.beta_phi",
];

/// Type of a number with a prior.
const PRIOR: &str = "number or [prior](#priors)";

fn is_described_elsewhere(path: &str) -> bool {
    COPIES.contains(&path) || PRIORS[1..].contains(&path)
}

/// A page with its tables made anew, and the paths that they have.
struct Page<'a> {
    keys: &'a Keys,
    /// Tables with a mark of their own.
    own: Vec<String>,
    described: BTreeSet<String>,
}

impl Page<'_> {
    fn table(&mut self, paths: &[&str]) -> String {
        let mut out = "| key | meaning | value | default |\n|---|---|---|---|\n".to_owned();
        for path in paths {
            let prefix = if paths.len() > 1 { format!("{path}.") } else { String::new() };
            self.rows(path, &prefix, false, &mut out);
        }
        out
    }

    fn rows(&mut self, path: &str, prefix: &str, is_choice: bool, out: &mut String) {
        for key in self.keys.table(path) {
            let below = below(path, &key.name);
            let has_prior = PRIORS.contains(&&*below);
            let is_new = self.described.insert(below.clone());
            if !has_prior && (self.own.contains(&below) || !is_new) {
                continue;
            }
            *out += &row(&key, prefix, is_choice);
            if !has_prior && !is_described_elsewhere(&below) {
                let is_choice = key.choices.iter().any(|(word, _)| word.starts_with('{'));
                self.rows(&below, &format!("{prefix}{}.", key.name), is_choice, out);
            }
        }
    }
}

/// The path of a key in the table at a path, empty for the whole file.
fn below(path: &str, name: &str) -> String {
    if path.is_empty() { name.to_owned() } else { format!("{path}.{name}") }
}

/// A row; keys of which just one is given are not called required.
fn row(key: &Key, prefix: &str, is_choice: bool) -> String {
    let is_word = |(word, _): &&(String, String)| word.starts_with('"');
    let words = key.choices.iter().filter(is_word);
    let words: Vec<String> = words.map(|(word, about)| format!("`{word}`: {about}")).collect();
    let meaning = [&key.meaning, &*words.join(" ")].join(" ");
    let default = match &key.default {
        Some(default) => format!("`{default}`"),
        None if key.is_required && !is_choice => "required".to_owned(),
        None => String::new(),
    };
    let cells = [meaning.trim(), &value(key), &default].map(|cell| cell.replace('|', "\\|"));
    format!("| `{prefix}{}` | {} |\n", key.name, cells.join(" | "))
}

/// Returns the type of a value, with its range.
fn value(key: &Key) -> String {
    let kind = match &*key.kind {
        kind if kind.starts_with("number, { uniform") => PRIOR.to_owned(),
        kind if kind.contains(['"', '{']) => format!("`{kind}`"),
        "table" => return String::new(),
        kind => kind.to_owned(),
    };
    let shown = |value: f64| bound(value).replace('-', "−").replace("e−", "e-");
    match &key.range {
        Some(range) if range.is_given() => match (range.least, range.most) {
            (Some(least), Some(most)) => format!("{kind}, {} to {}", shown(least), shown(most)),
            (Some(least), None) => format!("{kind}, ≥ {}", shown(least)),
            (_, most) => format!("{kind}, ≤ {}", shown(most.unwrap_or(f64::MAX))),
        },
        _ => kind,
    }
}

/// The tables that the line above them names.
fn paths<'a>(line: &'a str, kind: &str) -> Option<Vec<&'a str>> {
    let rest = line.strip_prefix(MARK)?.strip_prefix(kind)?.strip_prefix(':')?;
    Some(rest.trim_end_matches("-->").split(',').map(str::trim).collect())
}

/// The page with the tables of these keys made anew.
fn renewed(text: &str, keys: &Keys, kind: &str) -> (String, BTreeSet<String>) {
    let all = text.lines().filter_map(|line| paths(line, kind)).flatten();
    let own = all.filter(|path| !path.is_empty()).map(str::to_owned);
    let own: Vec<String> = own.collect();
    let mut page = Page { keys, described: own.iter().cloned().collect(), own };
    let mut out = String::new();
    let mut lines = text.lines().peekable();
    while let Some(line) = lines.next() {
        out += &format!("{line}\n");
        let Some(paths) = paths(line, kind) else { continue };
        while lines.next_if(|line| line.starts_with('|')).is_some() {}
        out += &page.table(&paths);
    }
    (out, page.described)
}

/// All keys of a type, with those of its tables.
fn all(keys: &Keys, path: &str, out: &mut BTreeSet<String>) {
    for key in keys.table(path) {
        let below = below(path, &key.name);
        out.insert(below.clone());
        if !is_described_elsewhere(&below) {
            all(keys, &below, out);
        }
    }
}

#[test]
fn exact_tables_of_keys_are_those_of_the_types() {
    check("fit-file.md", &[(FitFile::keys(), "fit"), (StaticImageFile::keys(), "static image")]);
    check("scene-file.md", &[(Scene::keys(), "scene")]);
}

fn check(page: &str, kinds: &[(&Keys, &str)]) {
    let path = root().join("docs/reference").join(page);
    let mut text = read(&path);
    let before = text.clone();
    for (keys, kind) in kinds {
        let (renewed, described) = renewed(&text, keys, kind);
        let mut wanted = BTreeSet::new();
        all(keys, "", &mut wanted);
        let missing: Vec<_> = wanted.difference(&described).collect();
        assert!(missing.is_empty(), "{page} has no table with {missing:?} of a {kind}");
        text = renewed;
    }
    if std::env::var_os("KERRLIGHT_WRITE_REFERENCE").is_some() {
        std::fs::write(&path, &text).unwrap();
    } else {
        let differs = before.lines().zip(text.lines()).find(|(old, new)| old != new);
        assert!(before == text, "run this test with KERRLIGHT_WRITE_REFERENCE=1: {differs:?}");
    }
}
