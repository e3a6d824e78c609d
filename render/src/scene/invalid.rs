//! Errors in a scene text that point at the line, and the simplest ranges.

use crate::Error;
use kerrlight_common::toml_file::ReadError;
use kerrlight_common::toml_file::{OutOfRange, shown};
use toml_edit::{Document, Item};

/// Reason why a text is not a scene.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum SceneError {
    /// Not TOML, an unknown or missing key, or a wrong type.
    #[error(transparent)]
    Syntax(#[from] ReadError),
    /// A value out of its range.
    #[error("{}`{key}` = {value} is not allowed: {allowed}", line_prefix(*.line))]
    Range {
        /// Line of the text, counted from 1; `None` where the key is not written out.
        line: Option<usize>,
        /// Dotted path of the key.
        key: String,
        /// The value that was given.
        value: String,
        /// Allowed values.
        allowed: String,
    },
    /// A key that this scene needs.
    #[error("`{key}` is missing: {why}")]
    Missing {
        /// Dotted path of the key.
        key: String,
        /// Reason why it is needed.
        why: String,
    },
    /// An override that cannot be applied.
    #[error("{0}")]
    Override(String),
}

fn line_prefix(line: Option<usize>) -> String {
    line.map(|line| format!("line {line}: ")).unwrap_or_default()
}

impl SceneError {
    /// The same without a line: that of a text which the user never saw.
    pub fn without_line(self) -> Self {
        match self {
            SceneError::Range { key, value, allowed, .. } => {
                SceneError::Range { line: None, key, value, allowed }
            }
            SceneError::Syntax(error) => SceneError::Syntax(error.without_line()),
            other => other,
        }
    }
}

/// A value out of range or missing, not yet located.
pub(super) struct Invalid {
    key: String,
    value: Option<String>,
    allowed: String,
}

impl From<OutOfRange> for Invalid {
    fn from(wrong: OutOfRange) -> Self {
        let allowed = wrong.allowed();
        Invalid::new(wrong.key, shown(wrong.value), allowed)
    }
}

impl Invalid {
    pub(super) fn new(
        key: impl Into<String>,
        value: impl ToString,
        allowed: impl Into<String>,
    ) -> Self {
        Invalid { key: key.into(), value: Some(value.to_string()), allowed: allowed.into() }
    }

    /// Returns the refusal of a number of a part, with the key of that part.
    pub(super) fn of(part: &str, error: &Error) -> Self {
        let key = format!("{part}{}", error.field().unwrap_or_default());
        let allowed = error.allowed().map_or_else(|| error.to_string(), str::to_owned);
        Invalid::new(key, error.value().unwrap_or_default(), allowed)
    }

    pub(super) fn missing(key: impl Into<String>, why: impl Into<String>) -> Self {
        Invalid { key: key.into(), value: None, allowed: why.into() }
    }

    pub(super) fn locate(self, text: &str) -> SceneError {
        let Some(value) = self.value else {
            return SceneError::Missing { key: self.key, why: self.allowed };
        };
        let line = line_of(text, &self.key);
        SceneError::Range { line, key: self.key, value, allowed: self.allowed }
    }
}

/// The line of a TOML text, counted from 1, on which the value at a dotted path such as `spot.0.radius` stands, or
/// the nearest table around it.
pub fn line_of(text: &str, key: &str) -> Option<usize> {
    let document = Document::parse(text).ok()?;
    let mut item: &Item = document.as_item();
    let mut span = None;
    let mut rest = key;
    for part in key.split('.') {
        rest = rest.split_once('.').map_or("", |(_, rest)| rest);
        let next = match part.parse::<usize>() {
            Ok(index) => match item {
                Item::ArrayOfTables(tables) => {
                    span = tables.get(index).and_then(|table| table.span()).or(span);
                    let table = tables.get(index)?;
                    return line_in_table(text, table, rest, span);
                }
                _ => item.get(index),
            },
            Err(_) => item.get(part),
        };
        match next {
            Some(next) => {
                span = next.span().or(span);
                item = next;
            }
            None => break,
        }
    }
    span.map(|span| line_at(text, span.start))
}

fn line_in_table(
    text: &str,
    table: &toml_edit::Table,
    rest: &str,
    around: Option<std::ops::Range<usize>>,
) -> Option<usize> {
    // The deepest part of the way that has a place.
    let (mut item, mut span) = (None::<&Item>, around);
    for part in rest.split('.') {
        let next = match (item, part.parse::<usize>()) {
            (None, _) => table.get(part),
            (Some(item), Ok(index)) => item.get(index),
            (Some(item), Err(_)) => item.get(part),
        };
        let Some(next) = next else { break };
        span = next.span().or(span);
        item = Some(next);
    }
    span.map(|span| line_at(text, span.start))
}

fn line_at(text: &str, offset: usize) -> usize {
    text[..offset.min(text.len())].matches('\n').count() + 1
}

/// Refuses `value` unless `ok`.
pub(super) fn number(
    key: impl Into<String>,
    value: f64,
    ok: bool,
    allowed: &str,
) -> Result<(), Invalid> {
    if ok { Ok(()) } else { Err(Invalid::new(key, shown(value), allowed)) }
}

pub(super) fn positive(key: impl Into<String>, value: f64) -> Result<(), Invalid> {
    number(key, value, value > 0.0 && value.is_finite(), "a finite number above 0")
}

/// Returns the square of the length of an axis, and refuses one without direction.
pub(super) fn square_of_axis(key: impl Into<String>, axis: [f64; 3]) -> Result<f64, Invalid> {
    let square = axis.iter().map(|x| x * x).sum::<f64>();
    if (1e-30..=1e30).contains(&square) {
        return Ok(square);
    }
    let allowed = "three numbers that are not all 0, with a length in [1e-15, 1e15]";
    Err(Invalid::new(key, format!("{axis:?}"), allowed))
}
