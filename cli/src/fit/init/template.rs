//! Templates of starter files, and how numbers and names stand in them.

use crate::fit::Work;
use crate::report;
use anyhow::Context;

/// A number with three digits, as TOML has it.
pub fn digits(value: f64) -> String {
    let rounded: f64 = format!("{value:.2e}").parse().unwrap_or(value);
    format!("{rounded:?}")
}

/// A name without what would end a string.
pub fn plain_words(name: &str) -> String {
    name.chars().filter(|c| !c.is_control() && !matches!(c, '"' | '\\')).collect()
}

/// The template with its fields; what comes out is a fit's file once all is filled in.
pub fn complete(template: &str, fields: &[(&str, String)]) -> anyhow::Result<String> {
    let text = report::fill(template, fields);
    // With everything filled in: a template that is no fit is found now, not by the user.
    Work::read(&text.replace("#? ", "")).context("the starter file")?;
    Ok(text)
}
