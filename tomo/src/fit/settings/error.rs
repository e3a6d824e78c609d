//! Errors in settings, which name the key and, where there is a text, its line.

use crate::Error;
use kerrlight_common::Error as Common;
use kerrlight_common::memory::TooLarge;
use kerrlight_common::toml_file::ReadError;
use kerrlight_render::scene::line_of;
use kerrlight_render::{Error as RenderError, Parts};
use kerrlight_vlbi::Error as VlbiError;

/// Reason why settings are not those of a fit.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum FitError {
    /// Not TOML, an unknown or missing key, or a wrong type.
    #[error(transparent)]
    Syntax(#[from] ReadError),
    /// A value out of its range.
    #[error("{}{key} = {value} is not allowed: {allowed}", line_prefix(*.line))]
    Range {
        /// Line of the text, counted from 1; `None` without a text.
        line: Option<usize>,
        /// Dotted path of the key.
        key: String,
        /// The value that was given.
        value: String,
        /// Allowed values.
        allowed: String,
    },
    /// A key that these settings need.
    #[error("{key} is missing: {why}")]
    Missing {
        /// Dotted path of the key.
        key: String,
        /// Reason why it is needed, and what to write.
        why: String,
    },
    /// Settings that contradict each other or the data.
    #[error("{0}")]
    Conflict(String),
    /// A part of the settings, such as `loss 1`, is wrong.
    #[error("{part}: {error}")]
    Part {
        /// The part.
        part: String,
        /// Error of the part.
        error: Box<FitError>,
    },
    /// More memory would be needed than there is.
    #[error(transparent)]
    Memory(#[from] TooLarge),
    /// A number that its consumer refuses.
    #[error(transparent)]
    Other(Box<dyn std::error::Error + Send + Sync>),
}

fn line_prefix(line: Option<usize>) -> String {
    line.map(|line| format!("line {line}: ")).unwrap_or_default()
}

impl FitError {
    /// A value out of its range.
    pub fn range(key: impl Into<String>, value: impl ToString, allowed: &str) -> Self {
        let (key, value) = (key.into(), value.to_string());
        FitError::Range { line: None, key, value, allowed: allowed.to_owned() }
    }

    /// A key that is needed.
    pub fn missing(key: &str, why: impl Into<String>) -> Self {
        FitError::Missing { key: key.to_owned(), why: why.into() }
    }

    /// Field, value, allowed range and line, where this error has them.
    pub(crate) fn parts(&self) -> Parts<'_> {
        match self {
            FitError::Range { line, key, value, allowed } => {
                (Some(key), Some(value.into()), Some(allowed), *line)
            }
            FitError::Missing { key, .. } => (Some(key), None, None, None),
            FitError::Part { error, .. } => error.parts(),
            _ => (None, None, None, None),
        }
    }

    /// Adds the line of the text on which the key stands.
    pub(super) fn located(self, text: &str) -> Self {
        match self {
            FitError::Range { key, value, allowed, .. } => {
                FitError::Range { line: line_of(text, &key), key, value, allowed }
            }
            other => other,
        }
    }
}

impl From<Error> for FitError {
    fn from(error: Error) -> Self {
        match error {
            Error::Fit(error) => error,
            Error::Common(Common::Memory(error))
            | Error::Render(RenderError::Common(Common::Memory(error)))
            | Error::Vlbi(VlbiError::Common(Common::Memory(error))) => FitError::Memory(error),
            other => FitError::Other(Box::new(other)),
        }
    }
}

/// Errors of the crates that settings are handed to.
macro_rules! through {
    ($($error:ty),* $(,)?) => {
        $(impl From<$error> for FitError {
            fn from(error: $error) -> Self {
                Error::from(error).into()
            }
        })*
    };
}

through!(Common, RenderError, VlbiError);

/// Errors of what numbers of settings are handed to.
macro_rules! other {
    ($($error:ty),* $(,)?) => {
        $(impl From<$error> for FitError {
            fn from(error: $error) -> Self {
                FitError::Other(Box::new(error))
            }
        })*
    };
}

other!(kerrlight_geodesic::Error, toml::de::Error, toml::ser::Error,);

impl From<Box<dyn std::error::Error + Send + Sync>> for FitError {
    fn from(error: Box<dyn std::error::Error + Send + Sync>) -> Self {
        FitError::Other(error)
    }
}

/// Names the part of the settings that an error is about.
pub trait Within<T> {
    /// The same result, whose error begins with the part.
    ///
    /// # Errors
    /// That of the result.
    fn within(self, part: impl Into<String>) -> Result<T, Error>;
}

impl<T, E: Into<FitError>> Within<T> for Result<T, E> {
    fn within(self, part: impl Into<String>) -> Result<T, Error> {
        self.map_err(|error| {
            FitError::Part { part: part.into(), error: Box::new(error.into()) }.into()
        })
    }
}

/// Refuses settings that contradict each other: returns [`FitError::Conflict`] with these words, as `format!` takes them.
#[macro_export]
macro_rules! refuse {
    ($($words:tt)*) => {
        return Err($crate::fit::settings::FitError::Conflict(format!($($words)*)).into())
    };
}
pub use refuse;
