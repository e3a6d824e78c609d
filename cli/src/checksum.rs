//! Checksums: of bytes, and of texts that carry their own.

use serde::{Deserialize, Serialize};
use std::io::{BufRead, Write};
use std::ops::Deref;

/// Checksum and length of bytes.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Sum {
    /// Number of bytes.
    pub bytes: u64,
    /// Their CRC-32, as eight hexadecimal digits.
    pub crc32: String,
}

impl Sum {
    /// Returns the checksum of these bytes.
    pub fn of(bytes: &[u8]) -> Self {
        Sum { bytes: bytes.len() as u64, crc32: format!("{:08x}", crc32fast::hash(bytes)) }
    }

    /// Returns the checksum of the rest of a file.
    pub fn of_file(file: &mut impl BufRead) -> std::io::Result<Self> {
        let (mut bytes, mut sum) = (0, crc32fast::Hasher::new());
        loop {
            let some = file.fill_buf()?;
            if some.is_empty() {
                return Ok(Sum { bytes, crc32: format!("{:08x}", sum.finalize()) });
            }
            sum.update(some);
            let length = some.len();
            bytes += length as u64;
            file.consume(length);
        }
    }
}

/// An object that [`sealed`] has written, with its checksum.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Sealed<T> {
    checksum: String,
    #[serde(flatten)]
    object: T,
}

impl<T> Deref for Sealed<T> {
    type Target = T;

    fn deref(&self) -> &T {
        &self.object
    }
}

/// Text before the checksum of an object (not of one inside it), and the eight digits until it is known.
const KEY: &str = "\n  \"checksum\": \"";
const NONE: &str = "00000000";

/// An object as text, with the checksum of all the rest of it.
pub fn sealed(mut object: serde_json::Value) -> String {
    object["checksum"] = serde_json::json!(NONE);
    let text = format!("{object:#}\n");
    let sum = crc32fast::hash(text.as_bytes());
    // JSON escapes line ends in strings and indents inner keys further: KEY occurs once.
    text.replacen(&format!("{KEY}{NONE}"), &format!("{KEY}{sum:08x}"), 1)
}

/// Writes what [`sealed`] makes of an object with a list under `name`, before `checksum` in the alphabet: of the list,
/// whose entries come as [`listed`], one entry at a time is in memory.
pub fn seal_list(
    out: &mut impl Write,
    mut object: serde_json::Value,
    name: &str,
    mut entries: impl Iterator<Item = String>,
) -> std::io::Result<()> {
    let Some(first) = entries.next() else {
        // An empty list is printed on one line and has no place for entries.
        object[name] = serde_json::json!([]);
        return out.write_all(sealed(object).as_bytes());
    };
    object["checksum"] = serde_json::json!(NONE);
    // The single zero marks where the entries go in the printed text.
    object[name] = serde_json::json!([0]);
    let text = format!("{object:#}\n");
    let (before, behind) = text.split_once("\n    0\n").unwrap_or((&text, ""));
    let mut sum = crc32fast::Hasher::new();
    let mut put = |text: &str| {
        sum.update(text.as_bytes());
        out.write_all(text.as_bytes())
    };
    put(before)?;
    put("\n    ")?;
    put(&first)?;
    for entry in entries {
        put(",\n    ")?;
        put(&entry)?;
    }
    let behind = format!("\n{behind}");
    sum.update(behind.as_bytes());
    let sum = sum.finalize();
    let behind = behind.replacen(&format!("{KEY}{NONE}"), &format!("{KEY}{sum:08x}"), 1);
    out.write_all(behind.as_bytes())
}

/// An entry for [`seal_list`].
pub fn listed(entry: &serde_json::Value) -> String {
    format!("{entry:#}").replace('\n', "\n    ")
}

/// Returns whether a text is as [`sealed`] has written it.
pub fn is_whole(text: &str) -> bool {
    let Some(at) = text.find(KEY).map(|at| at + KEY.len()) else { return false };
    let Some(digits) = text.get(at..at + NONE.len()) else { return false };
    let blank = [&text[..at], NONE, &text[at + NONE.len()..]].concat();
    format!("{:08x}", crc32fast::hash(blank.as_bytes())) == digits
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn exact_a_list_is_sealed_entry_by_entry() {
        let entry = |k: i32| json!({"k": k, "checksum": "00000000", "of": [k, "a\nb"]});
        for count in 0..3 {
            let entries: Vec<_> = (0..count).map(entry).collect();
            let object = json!({"title": "t", "quick": false});
            let mut text = Vec::new();
            let each = entries.iter().map(listed);
            seal_list(&mut text, object.clone(), "cases", each).unwrap();
            let text = String::from_utf8(text).unwrap();
            let mut whole = object;
            whole["cases"] = json!(entries);
            assert!(is_whole(&text));
            assert_eq!(text, sealed(whole));
        }
    }

    #[test]
    fn exact_every_flipped_bit_of_a_sealed_text_is_found() {
        let text = sealed(
            json!({"psnr_db": 34.5, "axis": [0.1, 0.2], "name": "checksum", "inner": {"checksum": "00000000"}}),
        );
        assert!(is_whole(&text));
        for at in 0..text.len() {
            for bit in 0..7 {
                let mut bytes = text.clone().into_bytes();
                bytes[at] ^= 1 << bit;
                let flipped = String::from_utf8(bytes).unwrap();
                assert!(!is_whole(&flipped), "{flipped}");
            }
            assert!(!is_whole(&text[..at]));
        }
    }
}
