//! Numbers that are not finite, in files that have no words for them.

use serde::{Deserialize, Deserializer};

/// Reads a number that is null where it is not finite, as JSON writes it.
pub fn or_nan<'de, D: Deserializer<'de>>(reader: D) -> Result<f64, D::Error> {
    Ok(Option::deserialize(reader)?.unwrap_or(f64::NAN))
}
