//! The error of this crate.

use crate::array::ArrayError;
use crate::data_terms::DataTermError;
use crate::earth::EarthError;
use crate::files::FileError;
use crate::observation::MissingMetadata;
use crate::polarimetry::NoFeeds;
use crate::schedule::ScheduleError;
use kerrlight_common::numpy::NumpyError;

/// Refusal of what a function of this crate was given. The message names the field, its value and what is allowed; an error
/// in a file also names its line or byte.
#[derive(Debug, thiserror::Error)]
#[error(transparent)]
#[non_exhaustive]
pub enum Error {
    /// An array of telescopes.
    Array(#[from] ArrayError),
    /// A day or a direction of the sky.
    Earth(#[from] EarthError),
    /// A schedule of observations.
    Schedule(#[from] ScheduleError),
    /// A file of visibilities or images.
    File(#[from] FileError),
    /// Metadata that the data lack.
    MissingMetadata(#[from] MissingMetadata),
    /// Products that are not of feeds.
    Feeds(#[from] NoFeeds),
    /// Data that make no χ².
    DataTerm(#[from] DataTermError),
    /// Memory, or bytes that cannot be read or written.
    Common(#[from] kerrlight_common::Error),
}

impl Error {
    /// Refusal of `value` for `field`, with the allowed range in words.
    pub const fn out_of_range(field: &'static str, value: f64, allowed: &'static str) -> Self {
        Self::Common(kerrlight_common::Error::out_of_range(field, value, allowed))
    }

    /// The line of the text, counted from 1.
    pub fn line(&self) -> Option<usize> {
        match self {
            Self::File(FileError::Line { line, .. })
            | Self::Array(ArrayError::Line { line, .. }) => Some(*line),
            _ => None,
        }
    }
}

impl From<NumpyError> for Error {
    fn from(error: NumpyError) -> Self {
        Self::Common(error.into())
    }
}

impl From<std::io::Error> for Error {
    fn from(error: std::io::Error) -> Self {
        Self::Common(error.into())
    }
}
