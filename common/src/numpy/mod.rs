//! Arrays of NumPy (NPY) and archives of them (NPZ), as bytes. Files state sizes that need not be true: nothing is
//! allocated before it is checked against the bytes that are there.

mod archive;
mod array;

pub use archive::{Archive, ArchiveWriter, write_archive};
pub use array::{Headed, Stream, open, read_array, write_array};

/// Reason why bytes are not the arrays that are expected.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum NumpyError {
    /// The array is damaged or of another type; the text says how.
    #[error("{0}")]
    Content(String),
    /// A member of an archive is damaged.
    #[error("{member}: {error}")]
    Member {
        /// The member.
        member: String,
        /// Cause of the failure.
        error: Box<dyn core::error::Error + Send + Sync>,
    },
}

impl NumpyError {
    /// Refusal of what an array or an archive holds.
    pub fn content(message: impl Into<String>) -> Self {
        NumpyError::Content(message.into())
    }

    /// Adds the member of an archive to an error.
    pub fn member(
        member: impl Into<String>,
        error: impl core::error::Error + Send + Sync + 'static,
    ) -> Self {
        NumpyError::Member { member: member.into(), error: Box::new(error) }
    }
}
