//! Templates of starter files, and how numbers and names stand in them.

use crate::fit::Work;
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
    let mut text = String::with_capacity(2 * template.len());
    let mut rest = template;
    // Once from front to back: what a field says, the name of a file perhaps, is no field itself.
    while let Some((before, after)) = rest.split_once('{') {
        let name_of = |(name, _): &&(&str, String)| {
            after.strip_prefix(*name).is_some_and(|after| after.starts_with('}'))
        };
        text.push_str(before);
        match fields.iter().find(name_of) {
            Some((name, value)) => {
                text.push_str(value);
                rest = &after[name.len() + 1..];
            }
            None => {
                text.push('{');
                rest = after;
            }
        }
    }
    text.push_str(rest);
    // With everything filled in: a template that is no fit is found now, not by the user.
    Work::read(&text.replace("#? ", "")).context("the starter file")?;
    Ok(text)
}
