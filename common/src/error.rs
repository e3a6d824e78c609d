//! The error of this crate.

use crate::frames::ScratchError;
use crate::memory::TooLarge;
use crate::numpy::NumpyError;
use kerrlight_geodesic::Error as OutOfRange;

/// Refusal of a request for memory, or of bytes that cannot be read or written.
#[derive(Debug, thiserror::Error)]
#[error(transparent)]
#[non_exhaustive]
pub enum Error {
    /// A number outside the range that its definition allows.
    Range(#[from] OutOfRange),
    /// More memory would be needed than may be taken.
    Memory(#[from] TooLarge),
    /// A file for what does not fit into memory.
    Scratch(#[from] ScratchError),
    /// Bytes that are no array of NumPy.
    Numpy(#[from] NumpyError),
    /// Reading or writing.
    Io(#[from] std::io::Error),
}

impl Error {
    /// Refusal of `value` for `field`, with the allowed range in words.
    pub const fn out_of_range(field: &'static str, value: f64, allowed: &'static str) -> Self {
        Self::Range(OutOfRange::out_of_range(field, value, allowed))
    }
}
