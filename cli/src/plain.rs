//! Names and titles that others gave, in files and on a terminal, where a control character would end a line, move the
//! cursor or change colours.

use anyhow::ensure;
use std::borrow::Cow;
use std::ffi::OsString;
use std::path::Path;

/// Text in lines: escapes such as `\u{1b}` stand for control characters other than tabs and ends of lines.
pub fn lines(text: &str) -> Cow<'_, str> {
    let is_end = |k: usize| text[k..].starts_with("\r\n");
    escaped(text, |k, letter| matches!(letter, '\n' | '\t') || is_end(k))
}

/// Text in a single line: escapes such as `\n` stand for all control characters.
pub fn line(text: &str) -> Cow<'_, str> {
    escaped(text, |_, _| false)
}

/// A path in a single line.
pub fn path(path: &Path) -> String {
    line(&path.to_string_lossy()).into_owned()
}

/// A path as a shell reads it.
pub fn word(path: &Path) -> String {
    quoted(&path.to_string_lossy())
}

/// A word as a shell reads it.
pub fn quoted(word: &str) -> String {
    let is_plain = |c: char| c.is_ascii_alphanumeric() || "-_=./:,+@%".contains(c);
    if !word.is_empty() && word.chars().all(is_plain) {
        return word.to_owned();
    }
    format!("'{}'", word.replace('\'', r"'\''"))
}

/// An error with its reasons, each told once: many errors name their reason themselves.
pub fn reasons(error: &anyhow::Error) -> String {
    let mut told = String::new();
    for reason in error.chain().map(ToString::to_string) {
        if told.is_empty() {
            told = reason;
        } else if !told.ends_with(&reason) {
            told = format!("{told}: {reason}");
        }
    }
    told
}

fn escaped(text: &str, stays: impl Fn(usize, char) -> bool) -> Cow<'_, str> {
    let is_plain = |(k, letter): (usize, char)| !letter.is_control() || stays(k, letter);
    if text.char_indices().all(is_plain) {
        return Cow::Borrowed(text);
    }
    let mut safe = String::with_capacity(text.len() + 8);
    for (k, letter) in text.char_indices() {
        match is_plain((k, letter)) {
            true => safe.push(letter),
            false => safe.extend(letter.escape_default()),
        }
    }
    Cow::Owned(safe)
}

/// Refuses a name that cannot stand in a line of a file.
///
/// # Errors
/// Names it, with the first control character in it.
pub fn check_name(name: &str) -> anyhow::Result<()> {
    let found = name.chars().find(|letter| letter.is_control());
    let code = found.map_or(0, u32::from);
    ensure!(
        found.is_none(),
        "`{}` holds a control character (U+{code:04X}): names have to fit in a line of a file; give another",
        line(name)
    );
    Ok(())
}

/// Refuses words of a command line with control characters. Only the TOML of `--set` may have several lines.
///
/// # Errors
/// Names the first such word.
pub fn check_words(words: &[OsString]) -> anyhow::Result<()> {
    let mut is_value = false;
    for word in words.iter().skip(1).map(|word| word.to_string_lossy()) {
        let is_toml = std::mem::replace(&mut is_value, word == "--set");
        if !is_toml && !word.starts_with("--set=") {
            check_name(&word)?;
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exact_control_characters_are_escaped() {
        for (text, in_lines, in_line) in [
            ("M87*, 95 %\u{a0}µas", "M87*, 95 %\u{a0}µas", "M87*, 95 %\u{a0}µas"),
            ("a\nb\tc\r\n", "a\nb\tc\r\n", "a\\nb\\tc\\r\\n"),
            ("\u{1b}[31mred\r", "\\u{1b}[31mred\\r", "\\u{1b}[31mred\\r"),
            ("\u{9b}2J\u{7f}\0", "\\u{9b}2J\\u{7f}\\u{0}", "\\u{9b}2J\\u{7f}\\u{0}"),
        ] {
            assert_eq!((&*lines(text), &*line(text)), (in_lines, in_line));
        }
    }

    #[test]
    fn exact_reasons_are_told_once() {
        let error = anyhow::anyhow!("no such key").context("bad header: no such key");
        assert_eq!(reasons(&error.context("a.fits")), "a.fits: bad header: no such key");
        let error = anyhow::anyhow!("line 3").context("a.toml");
        assert_eq!(reasons(&error), "a.toml: line 3");
    }

    #[test]
    fn exact_only_settings_have_several_lines() {
        let check = |words: &[&str]| {
            let words: Vec<OsString> = words.iter().map(OsString::from).collect();
            check_words(&words).map_err(|error| error.to_string())
        };
        check(&["kerrlight", "fit", "a b.toml", "--set", "a=[\n1]", "--set=b={\n}"]).unwrap();
        let refused = check(&["kerrlight", "fit", "--set", "a=1", "new\nline"]).unwrap_err();
        assert!(
            refused.starts_with("`new\\nline` holds a control character (U+000A)"),
            "{refused}"
        );
        assert!(check(&["kerrlight", "inspect", "\u{1b}c.uvfits"]).is_err());
    }
}
