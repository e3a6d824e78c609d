//! `key.path=value` overrides, applied to the text of a scene so that what ran can be
//! written down.

use super::SceneError;
use crate::Error;
use kerrlight_common::toml_file::ReadError;
use toml_edit::{ArrayOfTables, DocumentMut, Item, Table, Value};

/// Most keys of a path: no table lies deeper, and each is a step of a recursion.
const MOST_KEYS: usize = 32;

/// The scene text with `key.path=value` applied, e.g. `hole.spin=0.5`,
/// `spot.0.phase_deg=90`. A value that is no TOML is taken as a string; an empty one removes
/// the key; `{a=1, b={c=2}}` takes the place of a whole table, and so does a string. The element after the last one of a
/// list of tables adds one: `loss.1.data=amplitudes` where there is one loss.
///
/// # Errors
/// If the text is not TOML, or the override has no `=`, an empty key or leads through
/// something that is not a table.
pub fn apply_override(text: &str, assignment: &str) -> Result<String, Error> {
    let fail = |why: String| SceneError::Override(format!("`{assignment}`: {why}"));
    let (path, value) = assignment
        .split_once('=')
        .ok_or_else(|| fail("is not of the form key.path=value".to_owned()))?;
    let keys: Vec<&str> = path.trim().split('.').map(str::trim).collect();
    if keys.iter().any(|key| key.is_empty()) {
        return Err(fail("has an empty key".to_owned()).into());
    }
    if keys.len() > MOST_KEYS {
        return Err(
            fail(format!("has {} keys: at most {MOST_KEYS} are allowed", keys.len())).into()
        );
    }
    let mut document: DocumentMut = text
        .parse()
        .map_err(|e: toml_edit::TomlError| SceneError::Syntax(ReadError::syntax(&e)))?;
    assign(document.as_table_mut(), &keys, value.trim()).map_err(fail)?;
    Ok(document.to_string())
}

/// Follows the keys into `table` and puts the value there.
fn assign(table: &mut Table, keys: &[&str], value: &str) -> Result<(), String> {
    let Some((key, rest)) = keys.split_first() else { return Err("has no key".to_owned()) };
    if rest.is_empty() {
        return put(table, key, value);
    }
    let number = rest[0].parse::<usize>().ok();
    let empty = match number {
        Some(0) => Item::ArrayOfTables(ArrayOfTables::new()),
        Some(number) if !table.contains_key(key) => {
            return Err(format!("there is no `{key}`, so none with number {number}"));
        }
        _ => Item::Table(Table::new()),
    };
    let item = table.entry(key).or_insert(empty);
    *item = spread(core::mem::take(item));
    match item {
        Item::Table(table) => assign(table, rest, value),
        Item::ArrayOfTables(tables) => in_list(tables, key, rest, value),
        _ => Err(format!("`{key}` is not a table")),
    }
}

/// Follows the keys, the first of which is a number, into a list of tables.
fn in_list(tables: &mut ArrayOfTables, of: &str, keys: &[&str], value: &str) -> Result<(), String> {
    let count = tables.len();
    let number = keys[0].parse::<usize>().ok().filter(|number| *number <= count);
    let Some(number) = number else {
        return Err(format!(
            "`{of}` needs a number from 0 to {count}: it has {count} elements, and the next one adds one"
        ));
    };
    let is_new = number == count;
    if keys.len() > 1 {
        if is_new {
            tables.push(Table::new());
        }
        let Some(table) = tables.get_mut(number) else { return Ok(()) };
        return assign(table, &keys[1..], value);
    }
    if value.is_empty() {
        if is_new {
            return Err(format!("`{of}` has {count} elements: there is no such one to remove"));
        }
        tables.remove(number);
        return Ok(());
    }
    let Some(Item::Table(table)) = value.parse::<Value>().ok().map(|v| spread(Item::Value(v)))
    else {
        return Err(format!("names a table of `{of}`, not a value: give {{key = value, …}}"));
    };
    match tables.get_mut(number) {
        Some(old) => *old = table,
        None => tables.push(table),
    }
    Ok(())
}

/// Puts the value of the last key into its table.
fn put(table: &mut Table, key: &str, value: &str) -> Result<(), String> {
    if value.is_empty() {
        let removed = table.remove(key).map(drop);
        return removed.ok_or_else(|| "there is no such key to remove".to_owned());
    }
    let parsed = value.parse::<Value>().unwrap_or_else(|_| Value::from(value));
    let item = match (table.get(key), parsed) {
        // As a table, so that the next override finds its way in.
        (Some(Item::Table(_)) | None, parsed @ Value::InlineTable(_)) => {
            spread(Item::Value(parsed))
        }
        (Some(Item::ArrayOfTables(_)), parsed @ Value::Array(_)) => Item::Value(parsed)
            .into_array_of_tables()
            .map(Item::ArrayOfTables)
            .map_err(|_| "names a list of tables: give a list of tables".to_owned())?,
        // A choice without settings in place of one that has some: `start=drawn`.
        (Some(Item::Table(_)), word @ Value::String(_)) => Item::Value(word),
        (Some(Item::Table(_) | Item::ArrayOfTables(_)), _) => {
            return Err("names a table, not a value".to_owned());
        }
        (_, parsed) => Item::Value(parsed),
    };
    table.insert(key, item);
    Ok(())
}

/// An inline table as one with a heading of its own, and a list of such tables as well.
fn spread(item: Item) -> Item {
    if item.is_inline_table() {
        return item.into_table().map_or_else(|item| item, Item::Table);
    }
    if item
        .as_array()
        .is_some_and(|array| array.iter().all(Value::is_inline_table) && !array.is_empty())
    {
        return item.into_array_of_tables().map_or_else(|item| item, Item::ArrayOfTables);
    }
    item
}
