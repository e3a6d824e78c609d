//! Settings, scenes and experiments read from TOML: the crate `toml` parses, this module hands the result to serde.
//!
//! Every type that is read from a file goes through [`read`]. Its deserialiser asks a table for a table and a number for
//! a number, so each type is compiled once; with the general one of `toml`, which accepts anything anywhere, the settings
//! alone took a fifth of the time in which this crate compiles. In return an error names the line and the whole key.

mod deserializer;
mod error;
mod keys;

pub use error::ReadError;
pub use keys::{Key, Keys, OutOfRange, Range, bound, shown};

use serde::Serialize;
use serde::de::DeserializeOwned;
use toml::de::{DeTable, DeValue};
use toml::ser::ValueSerializer;
use toml::{Spanned, Table};

/// The value that a TOML text describes.
///
/// # Errors
/// On syntax, unknown or missing keys and wrong types: with the line and the dotted path of the key.
///
/// # Examples
/// ```
/// # use kerrlight_common::toml_file;
/// #[derive(Debug, serde::Deserialize)]
/// struct Hole { spin: f64 }
/// #[derive(Debug, serde::Deserialize)]
/// struct File { hole: Hole }
///
/// let file: File = toml_file::read("[hole]\nspin = 1").unwrap();
/// assert_eq!(file.hole.spin, 1.0);
/// let error = toml_file::read::<File>("[hole]\nspin = true").unwrap_err();
/// assert_eq!(error.to_string(), "line 2: hole.spin: invalid type: boolean `true`, expected a number");
/// ```
pub fn read<T: DeserializeOwned>(text: &str) -> Result<T, ReadError> {
    let table = DeTable::parse(text).map_err(|error| ReadError::syntax(&error))?;
    let root = Spanned::new(table.span(), DeValue::Table(table.into_inner()));
    T::deserialize(deserializer::Value(&root)).map_err(|error| error.in_text(text))
}

/// The value that a table describes.
///
/// # Errors
/// Those of [`read`], without a line.
pub fn read_table<T: DeserializeOwned>(table: &Table) -> Result<T, ReadError> {
    // By way of text, so that no type is compiled for a second deserialiser.
    read(&table.to_string()).map_err(ReadError::without_line)
}

/// The TOML text of a value, its keys in the order of the fields.
///
/// # Errors
/// If TOML cannot hold it, such as a whole number above 2^63 − 1.
pub fn write<T: Serialize>(value: &T) -> Result<String, ReadError> {
    written(value).map(|(text, _)| text)
}

/// Returns the table that would be written for a value.
///
/// # Errors
/// Those of [`write()`].
pub fn table_of<T: Serialize>(value: &T) -> Result<Table, ReadError> {
    written(value).map(|(_, table)| table)
}

fn written<T: Serialize>(value: &T) -> Result<(String, Table), ReadError> {
    let text = toml::to_string(value).map_err(|error| ReadError::syntax(&error))?;
    let table = readable(&text)?;
    Ok((text, table))
}

/// Reads what was written: whole numbers are written that TOML does not have.
fn readable(text: &str) -> Result<Table, ReadError> {
    let refused =
        |_| ReadError::new("a whole number above 2^63 − 1 is too large for TOML".to_owned());
    text.parse::<Table>().map_err(refused)
}

/// A value as it stands behind `key = `, tables in braces.
///
/// # Errors
/// If TOML cannot hold it.
pub fn inline<T: Serialize>(value: &T) -> Result<String, ReadError> {
    let mut text = String::new();
    let written = value.serialize(ValueSerializer::new(&mut text)).map(drop);
    written.map_err(|error| ReadError::syntax(&error))?;
    readable(&format!("x = {text}")).map(|_| text)
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde::{Deserialize, Serialize};
    use std::collections::BTreeMap;

    #[derive(Debug, PartialEq, Serialize, Deserialize)]
    #[serde(deny_unknown_fields, rename_all = "kebab-case")]
    enum Law {
        Rigid,
        Power(f64),
        Infall {
            xi: f64,
        },
        #[serde(untagged)]
        Own(String),
    }

    #[derive(Debug, PartialEq, Serialize, Deserialize)]
    #[serde(rename_all = "kebab-case")]
    enum Shape {
        Disc(f64),
        Ball,
    }

    #[derive(Debug, PartialEq, Serialize, Deserialize)]
    #[serde(deny_unknown_fields)]
    struct File {
        title: String,
        seed: u64,
        #[serde(default)]
        center: [f64; 3],
        law: Option<Law>,
        shape: Option<Shape>,
        #[serde(default)]
        spot: Vec<Spot>,
        #[serde(default)]
        tables: BTreeMap<String, f64>,
        #[serde(default)]
        own: Table,
    }

    #[derive(Debug, PartialEq, Serialize, Deserialize)]
    #[serde(deny_unknown_fields)]
    struct Spot {
        sigma: f64,
    }

    const TEXT: &str = "title = \"a\"\nseed = 3\n";

    fn refused(more: &str) -> String {
        read::<File>(&format!("{TEXT}{more}")).unwrap_err().to_string()
    }

    /// The crate's own deserialiser and its tables are the authority.
    #[test]
    fn code_reads_and_writes_what_the_crate_does() {
        for more in [
            "",
            "center = [1, 2.5, -inf]",
            "law = \"rigid\"",
            "law = \"something\"",
            "law = { power = 2 }",
            "law = { infall = { xi = 0x10 } }",
            "[[spot]]\nsigma = 1e-3\n[[spot]]\nsigma = 2",
            "[tables]\n\"a.b\" = 1\nb = 1_000.5",
            "own = { a = [1, \"b\", { c = true }], d = -1.5, big = 9223372036854775807 }",
            "spot = []\n[law.infall]\nxi = 0.5",
        ] {
            let text = format!("{TEXT}{more}");
            let crates: File = toml::from_str(&text).unwrap();
            assert_eq!(read::<File>(&text).unwrap(), crates, "{more}");
            let table: Table = text.parse().unwrap();
            assert_eq!(read_table::<File>(&table).unwrap(), crates, "{more}");
            assert_eq!(table_of(&crates).unwrap(), Table::try_from(&crates).unwrap());
        }
    }

    #[test]
    fn exact_text_of_a_value() {
        let text = "title = \"a\"\nseed = 3\ncenter = [0.0, 0.0000001, -inf]\n\n[law.infall]\nxi = 0.5\n\n\
                    [[spot]]\nsigma = 1.0\n\n[tables]\n\"a.b\" = 0.1\n\n[own]\n";
        let value: File = read(text).unwrap();
        assert_eq!(write(&value).unwrap(), text);
        assert_eq!(inline(&value.law).unwrap(), "{ infall = { xi = 0.5 } }");
        let large = File { seed: u64::MAX, ..value };
        for refused in [write(&large).unwrap_err(), inline(&large).unwrap_err()] {
            assert!(!refused.to_string().contains('\n'), "{refused}");
        }
    }

    #[test]
    fn exact_errors_name_the_line_and_the_key() {
        for (more, says) in [
            (
                "center = [1, true, 2]",
                "line 3: center.1: invalid type: boolean `true`, expected a number",
            ),
            ("center = [1, 2]", "line 3: center: invalid length 2, expected an array of length 3"),
            (
                "center = [1, 2, 3, 4]",
                "line 3: center: invalid length 4, expected an array of length 3",
            ),
            (
                "shape = { disc = 2, ball = {} }",
                "line 3: shape: more than one key, expected one of `disc`, `ball`",
            ),
            ("shape = {}", "line 3: shape: an empty table, expected one of `disc`, `ball`"),
            ("shape = \"disc\"", "line 3: shape: `disc` needs values: a table of this key"),
            (
                "shape = { ball = 1 }",
                "line 3: shape.ball: invalid type: integer `1`, expected no value",
            ),
            (
                "shape = \"cube\"",
                "line 3: shape: unknown variant `cube`, expected `disc` or `ball`",
            ),
            ("[[spot]]\n[[spot]]\nsigma = 1", "line 3: spot.0: missing field `sigma`"),
            (
                "[[spot]]\nsigma = 1\nsize = 2",
                "line 5: spot.0: unknown field `size`, expected `sigma`",
            ),
            (
                "\n\n[tables]\na = \"x\"",
                "line 6: tables.a: invalid type: string \"x\", expected a number",
            ),
            ("tables = 3", "line 3: tables: invalid type: integer `3`, expected a map"),
            ("spot = { sigma = 1 }", "line 3: spot: invalid type: map, expected a sequence"),
            ("law = 1979-05-27", "line 3: law: dates are not used here"),
        ] {
            assert!(refused(more).starts_with(says), "{more}: {}", refused(more));
        }
        let error = read::<File>("title = 3\nseed = -1").unwrap_err().to_string();
        assert_eq!(error, "line 1: title: invalid type: integer `3`, expected a string");
        let error = read::<File>("title = \"\"\nseed = -1").unwrap_err().to_string();
        assert_eq!(
            error,
            "line 2: seed: invalid value: integer `-1`, expected a whole number, 0 or more"
        );
        assert!(read::<File>("title = \"\"\nseed = ").unwrap_err().to_string().contains("line 2"));
    }

    /// Long text is cut, and line ends are escaped.
    #[test]
    fn regress_errors_are_short_and_in_a_line() {
        let long = "x".repeat(300);
        for (more, says) in [
            (format!("shape = {:?}", long), "line 3: shape: unknown variant `xxx"),
            (format!("{long} = 1"), "line 3: unknown field `xxx"),
            (format!("tables = {{ {long} = true }}"), "line 3: tables.xxx"),
            (
                format!("center = [1, {:?}, 2]", long),
                "line 3: center.1: invalid type: string \"xxx",
            ),
            (format!("center = [1, {}, 2]", "1".repeat(300)), "line 3: center.1: 111"),
            (format!("a = [{} = ]", "1, ".repeat(300)), "TOML parse error at line 3, column 907: "),
        ] {
            let text = refused(&more);
            assert!(text.starts_with(says) && text.len() < 250, "{more}: {text}");
        }
        let odd = refused("\"a\\n\\u001b\" = 1");
        assert!(odd.starts_with("line 3: unknown field `a\\n\\u{1b}`, expected"), "{odd}");
    }

    #[test]
    fn exact_errors_in_a_table_have_no_line() {
        let table: Table = "title = 3\nseed = 1".parse().unwrap();
        let error = read_table::<File>(&table).unwrap_err().to_string();
        assert_eq!(error, "title: invalid type: integer `3`, expected a string");
    }
}
