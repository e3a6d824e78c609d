//! Reasons why bytes are no mesh.

/// Reason why bytes are no mesh.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum MeshError {
    /// A line of a text that is not understood.
    #[error("line {line}: {why}")]
    Line {
        /// Its number, from 1.
        line: usize,
        /// Reason for the refusal.
        why: String,
    },
    /// A fault of a file that it refers to.
    #[error("`{name}`, to which it refers: {error}")]
    Within {
        /// The name as it stands in the file.
        name: String,
        /// The fault.
        error: Box<MeshError>,
    },
    /// Not a glTF or GLB file.
    #[error("not a readable glTF file: {0}")]
    Gltf(#[from] gltf::Error),
    /// A file that it refers to cannot be read.
    #[error("`{name}`, to which it refers, cannot be read: {why}")]
    Resource {
        /// The name as it stands in the file.
        name: String,
        /// Reason for the refusal.
        why: String,
    },
    /// It is no mesh of triangles.
    #[error("{0}")]
    Content(String),
}
