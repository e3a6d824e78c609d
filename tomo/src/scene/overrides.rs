//! `key.path=value` overrides, applied to the text of a scene so that what ran can be
//! written down.

use super::SceneError;
use toml_edit::{DocumentMut, Item, Table, Value};

/// The scene text with `key.path=value` applied, e.g. `hole.spin=0.5`,
/// `spot.0.phase_deg=90`. A value that is no TOML is taken as a string; an empty one removes
/// the key; `{a=1, b={c=2}}` takes the place of a whole table.
///
/// # Errors
/// If the text is not TOML, or the override has no `=`, an empty key or leads through
/// something that is not a table.
pub fn apply_override(text: &str, assignment: &str) -> Result<String, SceneError> {
    let fail = |why: &str| SceneError::Override(format!("`{assignment}`: {why}"));
    let (path, value) =
        assignment.split_once('=').ok_or_else(|| fail("is not of the form key.path=value"))?;
    let keys: Vec<&str> = path.trim().split('.').map(str::trim).collect();
    if keys.iter().any(|key| key.is_empty()) {
        return Err(fail("has an empty key"));
    }
    let mut document: DocumentMut =
        text.parse().map_err(|e: toml_edit::TomlError| SceneError::Syntax(e.to_string()))?;
    let (last, parents) = keys.split_last().ok_or_else(|| fail("has no key"))?;
    let mut table: &mut Table = document.as_table_mut();
    let mut parts = parents.iter().peekable();
    while let Some(key) = parts.next() {
        let number = parts.peek().and_then(|part| part.parse::<usize>().ok());
        if let (Some(number), false) = (number, table.contains_key(key)) {
            return Err(fail(&format!("there is no `{key}`, so none with number {number}")));
        }
        let item = table.entry(key).or_insert_with(|| Item::Table(Table::new()));
        if item.is_inline_table() {
            *item = spread(core::mem::take(item));
        }
        table = match item {
            Item::Table(table) => table,
            Item::ArrayOfTables(tables) => {
                let index = parts.next().and_then(|part| part.parse::<usize>().ok());
                let count = tables.len();
                index
                    .and_then(|index| tables.get_mut(index))
                    .ok_or_else(|| fail(&format!("`{key}` needs an index below {count}")))?
            }
            _ => return Err(fail(&format!("`{key}` is not a table"))),
        };
    }
    let value = value.trim();
    if value.is_empty() {
        return match table.remove(last) {
            Some(_) => Ok(document.to_string()),
            None => Err(fail("there is no such key to remove")),
        };
    }
    let parsed = value.parse::<Value>().unwrap_or_else(|_| Value::from(value));
    let item = match (table.get(last), parsed) {
        // As a table, so that the next override finds its way in.
        (Some(Item::Table(_)) | None, parsed @ Value::InlineTable(_)) => {
            spread(Item::Value(parsed))
        }
        (Some(Item::ArrayOfTables(_)), parsed @ Value::Array(_)) => Item::Value(parsed)
            .into_array_of_tables()
            .map(Item::ArrayOfTables)
            .map_err(|_| fail("names a list of tables: give a list of tables"))?,
        (Some(Item::Table(_) | Item::ArrayOfTables(_)), _) => {
            return Err(fail("names a table, not a value"));
        }
        (_, parsed) => Item::Value(parsed),
    };
    table.insert(last, item);
    Ok(document.to_string())
}

/// An inline table as one with a heading of its own.
fn spread(item: Item) -> Item {
    match item.into_table() {
        Ok(table) => Item::Table(table),
        Err(item) => item,
    }
}
