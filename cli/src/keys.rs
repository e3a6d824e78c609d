//! Values of settings by keys with dots.

use toml::{Table, Value};

/// The value of a key; of a list of tables that of the last one that has it.
pub fn at<'a>(table: &'a Table, key: &str) -> Option<&'a Value> {
    let mut words = key.split('.');
    let first = table.get(words.next()?)?;
    words.try_fold(first, |value, word| match value {
        Value::Array(list) => list.iter().rev().find_map(|item| item.get(word)),
        value => value.get(word),
    })
}

/// The same as text: a string without its quotes.
pub fn text(table: &Table, key: &str) -> Option<String> {
    let value = at(table, key)?;
    Some(value.as_str().map_or_else(|| value.to_string(), str::to_owned))
}
