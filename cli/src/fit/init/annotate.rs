//! Comments for settings: what each key means, and what is left to the user.

use super::keys::{KEYS, Key, TABLES};

/// Column at which comments start, unless the value is longer.
const COLUMN: usize = 34;

/// The settings with a comment for each key and, commented out, the keys that may be added. In `plain` a line
/// `key = value #! why` is an assumption, and `#? key = value # why` one that the user has to fill in.
pub fn annotate(plain: &str) -> String {
    let mut out = String::new();
    let mut table = "";
    let mut there: Vec<&str> = Vec::new();
    for line in plain.lines() {
        if let Some(heading) = heading(line) {
            out += &left_out(table, &there);
            (table, there) = (heading, Vec::new());
            let about = TABLES.iter().find(|(name, _)| *name == table);
            out += &about.map_or(String::new(), |(_, text)| format!("\n# {text}"));
            out += &format!("\n{line}\n");
        } else if let Some(name) = name_of(line) {
            there.push(name);
            out += &key_line(line, find(table, name));
        } else if !line.trim().is_empty() && table.is_empty() {
            out += &format!("{line}\n");
        }
    }
    out + &left_out(table, &there)
}

fn heading(line: &str) -> Option<&str> {
    line.starts_with('[').then(|| line.trim_matches(['[', ']']))
}

/// The key of a line of the plain settings.
fn name_of(line: &str) -> Option<&str> {
    let line = line.strip_prefix("#? ").unwrap_or(line);
    (!line.starts_with('#')).then(|| line.split_once(" = ")).flatten().map(|(name, _)| name)
}

fn find(table: &str, name: &str) -> Option<&'static Key> {
    KEYS.iter().find(|key| key.table == table && key.name == name)
}

fn key_line(line: &str, key: Option<&Key>) -> String {
    let note = key.map_or("", |key| key.note);
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

/// Keys of a table that may be added.
fn left_out(table: &str, there: &[&str]) -> String {
    // One of two that exclude each other is there.
    let rival = |name: &str| {
        matches!((name, there), ("utc", all) if all.contains(&"gmst"))
            || (name == "gmst" && there.contains(&"utc"))
    };
    let more = KEYS.iter().filter(|key| {
        key.table == table
            && !key.example.is_empty()
            && !there.contains(&key.name)
            && !rival(key.name)
    });
    more.map(|key| beside(&format!("# {} = {}", key.name, key.example), key.note)).collect()
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
        for line in text.lines().filter(|line| line.contains(" = ")) {
            assert!(line.contains(" # ") || line.starts_with("# "), "{line} says nothing");
        }
    }

    /// Examples of keys that may be added are settings.
    #[test]
    fn exact_examples_are_settings() {
        let all: toml::Table = include_str!("../built_in.toml").parse().unwrap();
        let optional = KEYS.iter().filter(|key| !key.example.is_empty());
        for key in optional.filter(|key| !matches!(key.name, "utc" | "gmst")) {
            let path = match key.table {
                "truth.spot" => "truth.spot.0".to_owned(),
                other => other.to_owned(),
            };
            let assignment = format!("{path}.{}={}", key.name, key.example);
            let text = crate::fit::assigned(&all.to_string(), &assignment).unwrap();
            crate::fit::parse(&text).unwrap_or_else(|error| panic!("{assignment}: {error:#}"));
        }
    }
}
