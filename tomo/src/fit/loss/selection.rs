//! Data of a step.

/// Data of a step.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Drawn {
    /// (ray, frame) pairs of images.
    Pixels(Vec<(u32, u32)>),
    /// Whole frames, of all data.
    Frames(Vec<usize>),
}
