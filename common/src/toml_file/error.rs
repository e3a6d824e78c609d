//! Errors in TOML texts.

use serde::de;
use std::fmt::Display;
use std::ops::Range;

/// Reason why a TOML text cannot be read.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ReadError {
    message: String,
    /// Keys from the innermost to the outermost.
    keys: Vec<String>,
    /// Bytes of the text.
    span: Option<Range<usize>>,
    line: Option<usize>,
}

/// Rust's types, of which serde speaks, and what a value of each has to be.
const TYPES: [(&str, &str); 9] = [
    ("f64", "a number"),
    ("f32", "a number"),
    ("usize", "a whole number, 0 or more"),
    ("u64", "a whole number, 0 or more"),
    ("u32", "a whole number, 0 to 4294967295"),
    ("u16", "a whole number, 0 to 65535"),
    ("u8", "a whole number, 0 to 255"),
    ("i64", "a whole number"),
    ("i32", "a whole number, -2147483648 to 2147483647"),
];

/// Most bytes of a line of the text that is shown.
const LINE: usize = 160;
/// Most letters of a name or a value that are shown.
const WORD: usize = 80;

/// A name or a value in a single line, its end left out where it is long.
pub(super) fn brief(text: &str) -> String {
    let mut short = String::new();
    for letter in text.chars().take(WORD) {
        match letter.is_control() {
            true => short.extend(letter.escape_default()),
            false => short.push(letter),
        }
    }
    if text.chars().nth(WORD).is_some() {
        short.push('…');
    }
    short
}

impl ReadError {
    pub(super) fn new(message: String) -> Self {
        ReadError { message, keys: Vec::new(), span: None, line: None }
    }

    /// Wraps the parser's message, which shows the line.
    pub fn syntax(error: &dyn Display) -> Self {
        let text = error.to_string();
        let is_long = |line: &str| line.len() > LINE;
        if !text.lines().any(is_long) {
            return ReadError::new(text.trim_end().to_owned());
        }
        // Without the line itself, and the mark under it: `4 | text`.
        let digits = |c: char| c == ' ' || c.is_ascii_digit();
        let is_shown = |line: &&str| line.trim_start_matches(digits).starts_with('|');
        let left: Vec<&str> = text.lines().filter(|line| !is_shown(line)).collect();
        ReadError::new(left.join(": "))
    }

    /// The same of the value at a key.
    pub(super) fn under(mut self, key: String, span: Range<usize>) -> Self {
        self.keys.push(key);
        self.at(span)
    }

    /// The same at a place, where none is known yet.
    pub(super) fn at(mut self, span: Range<usize>) -> Self {
        self.span.get_or_insert(span);
        self
    }

    /// The same with its line.
    pub(super) fn in_text(mut self, text: &str) -> Self {
        let before = self.span.as_ref().map(|span| &text.as_bytes()[..span.start.min(text.len())]);
        self.line = before.map(|bytes| 1 + bytes.iter().filter(|byte| **byte == b'\n').count());
        self
    }

    /// The same without a line: that of a text which the user never saw.
    pub fn without_line(mut self) -> Self {
        self.line = None;
        self
    }

    /// Dotted path of the key, empty for the whole text.
    pub fn key(&self) -> String {
        self.keys.iter().rev().map(String::as_str).collect::<Vec<_>>().join(".")
    }

    /// Line of the text, counted from 1.
    pub fn line(&self) -> Option<usize> {
        self.line
    }
}

impl Display for ReadError {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        if let Some(line) = self.line {
            write!(f, "line {line}: ")?;
        }
        if !self.keys.is_empty() {
            let keys: Vec<String> = self.keys.iter().rev().map(|key| brief(key)).collect();
            write!(f, "{}: ", keys.join("."))?;
        }
        f.write_str(&self.message)
    }
}

impl std::error::Error for ReadError {}

impl de::Error for ReadError {
    fn custom<T: Display>(message: T) -> Self {
        let plain = |text: String, (name, meaning): &(&str, &str)| {
            text.replace(&format!("expected {name}"), &format!("expected {meaning}"))
        };
        // Names stand between such quotes.
        let message = message.to_string();
        let quoted = |(k, part): (usize, &str)| match k % 2 {
            0 => part.to_owned(),
            _ => brief(part),
        };
        let message: Vec<String> = message.split('`').enumerate().map(quoted).collect();
        ReadError::new(TYPES.iter().fold(message.join("`"), plain))
    }
}
