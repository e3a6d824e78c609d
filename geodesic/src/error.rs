//! What misuse of the crate looks like.

use core::fmt;

/// A value outside the range that its definition allows.
#[derive(Debug, Clone, PartialEq)]
pub struct OutOfRange {
    /// The field's name, as in the documentation.
    pub field: &'static str,
    /// The value that was given.
    pub value: f64,
    /// The allowed range, in words.
    pub allowed: &'static str,
}

impl fmt::Display for OutOfRange {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} = {} is not allowed: {}", self.field, self.value, self.allowed)
    }
}

impl core::error::Error for OutOfRange {}

/// `value` if `ok`, else the error that names it.
pub(crate) fn check(
    field: &'static str,
    value: f64,
    ok: bool,
    allowed: &'static str,
) -> Result<f64, OutOfRange> {
    if ok { Ok(value) } else { Err(OutOfRange { field, value, allowed }) }
}
