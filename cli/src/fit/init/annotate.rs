//! Comments for settings: what each key means, and what is left to the user.

use kerrlight_common::toml_file::{Key, Keys};
use kerrlight_imaging::settings::StaticImageFile;
use kerrlight_tomo::fit::settings::FitFile;

/// Column at which comments start, unless the value is longer.
const COLUMN: usize = 34;

/// The settings with a comment for each key and, commented out, the keys that may be added. In `plain` a line
/// `key = value #! why` is an assumption, and `#? key = value # why` one that the user has to fill in.
pub fn annotate(plain: &str) -> String {
    let mut out = String::new();
    let mut table = "";
    let mut there: Vec<&str> = Vec::new();
    let is_image = plain.lines().any(|line| line == "[image]");
    let keys = if is_image { StaticImageFile::keys() } else { FitFile::keys() };
    for line in plain.lines() {
        if let Some(heading) = heading(line) {
            out += &left_out(keys, plain, table, &there);
            (table, there) = (heading, Vec::new());
            out += &format!("\n# {}\n{line}\n", keys.about(table));
        } else if let Some(name) = name_of(line) {
            there.push(name);
            out += &key_line(line, keys.at(&format!("{table}.{name}")));
        } else if !line.trim().is_empty() && table.is_empty() {
            out += &format!("{line}\n");
        }
    }
    out + &left_out(keys, plain, table, &there)
}

fn heading(line: &str) -> Option<&str> {
    line.starts_with('[').then(|| line.trim_matches(['[', ']']))
}

/// The key of a line of the plain settings.
fn name_of(line: &str) -> Option<&str> {
    let line = line.strip_prefix("#? ").unwrap_or(line);
    (!line.starts_with('#')).then(|| line.split_once(" = ")).flatten().map(|(name, _)| name)
}

fn key_line(line: &str, key: Option<Key>) -> String {
    let note = &*key.map_or(String::new(), |key| key.note());
    if let Some((value, why)) = line.split_once(" #! ") {
        return format!("# ASSUMED: {why}\n{}", beside(value, note));
    }
    if let Some((value, why)) = line.strip_prefix("#? ").and_then(|line| line.split_once(" # ")) {
        return format!("# FILL IN: {why}\n{}", beside(&format!("# {value}"), note));
    }
    beside(line, note)
}

fn beside(value: &str, note: &str) -> String {
    if note.is_empty() { format!("{value}\n") } else { format!("{value:COLUMN$} # {note}\n") }
}

/// Keys of a table that may be added: none that has a heading of its own in the settings.
fn left_out(keys: &Keys, plain: &str, table: &str, there: &[&str]) -> String {
    let is_headed = |key: &Key| {
        let mut headings = plain.lines().filter_map(heading);
        table.is_empty() && headings.any(|heading| heading.split('.').next() == Some(&*key.name))
    };
    let is_there = |key: &Key| there.contains(&&*key.name) || key.is_table() || is_headed(key);
    let more = keys.table(table).into_iter().filter(|key| !is_there(key));
    let line = |key: Key| {
        let value = key.example.as_ref().or(key.default.as_ref())?;
        Some(beside(&format!("# {} = {value}", key.name), &key.note()))
    };
    more.filter_map(line).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exact_comments_change_no_setting() {
        let plain = include_str!("../built_in.toml");
        let text = annotate(plain);
        let table = |text: &str| text.parse::<toml::Table>().unwrap();
        assert_eq!(table(&text), table(plain));
        // What has a heading is not offered once more above it.
        assert!(!text.contains("# axis = ") && !text.contains("# output = "), "{text}");
        for line in text.lines().filter(|line| line.contains(" = ")) {
            assert!(line.contains(" # ") || line.starts_with("# "), "{line} says nothing");
        }
    }

    /// Examples of keys that may be added are settings.
    #[test]
    fn exact_examples_are_settings() {
        let all: toml::Table = include_str!("../built_in.toml").parse().unwrap();
        for (table, key) in [
            "hole",
            "screen",
            "region",
            "effects",
            "motion",
            "simulation.truth.spot",
            "observation",
            "training",
            "linear",
        ]
        .iter()
        .flat_map(|table| FitFile::keys().table(table).into_iter().map(move |key| (table, key)))
        {
            let Some(example) = &key.example else { continue };
            let path = table.replace("spot", "spot.0");
            let assignment = format!("{path}.{}={example}", key.name);
            let text = crate::fit::assigned(&all.to_string(), &assignment).unwrap();
            crate::fit::parse(&text).unwrap_or_else(|error| panic!("{assignment}: {error:#}"));
        }
    }
}
