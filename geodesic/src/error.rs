//! The error of this crate.

use core::fmt;

/// A number outside the range that its definition allows: the only error of this crate.
///
/// Every function that can refuse its arguments returns it, and nothing panics on misuse. What
/// becomes of a ray is never an error: it is an [`Outcome`](crate::Outcome).
///
/// The message is complete in itself; [`field`](Self::field), [`value`](Self::value) and
/// [`allowed`](Self::allowed) are its parts, for a program that words its own.
///
/// ```
/// let error = kerrlight_geodesic::Kerr::new(1.5).unwrap_err();
///
/// assert_eq!(error.field(), "spin");
/// assert_eq!(error.value(), 1.5);
/// assert_eq!(error.allowed(), "a number in [-1, 1]");
/// assert_eq!(error.to_string(), "spin = 1.5 is not allowed: a number in [-1, 1]");
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct Error {
    field: &'static str,
    value: f64,
    allowed: &'static str,
}

impl Error {
    /// States that `field` cannot be `value`, with the allowed range in words. A
    /// [`RayVisitor`](crate::RayVisitor) reports its own refusals with it.
    pub const fn out_of_range(field: &'static str, value: f64, allowed: &'static str) -> Self {
        Self { field, value, allowed }
    }

    /// The name of the argument or field, as in the documentation.
    pub const fn field(&self) -> &'static str {
        self.field
    }

    /// The value that was given, in the unit of the field.
    pub const fn value(&self) -> f64 {
        self.value
    }

    /// The allowed range in words.
    pub const fn allowed(&self) -> &'static str {
        self.allowed
    }
}

impl fmt::Display for Error {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Error { field, value, allowed } = self;
        // In full, 1e300 has three hundred zeros.
        if value.is_finite() && value.abs() >= 1e16 {
            return write!(f, "{field} = {value:e} is not allowed: {allowed}");
        }
        write!(f, "{field} = {value} is not allowed: {allowed}")
    }
}

impl core::error::Error for Error {}

/// `value` if `ok`, else the error that names it.
pub(crate) fn check(
    field: &'static str,
    value: f64,
    ok: bool,
    allowed: &'static str,
) -> Result<f64, Error> {
    if ok { Ok(value) } else { Err(Error::out_of_range(field, value, allowed)) }
}
