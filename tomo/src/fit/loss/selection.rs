//! Selection of the data of a step.

/// Part of the data that a step looks at.
#[derive(Clone, Copy, Debug)]
pub enum Selection<'a> {
    /// (ray, frame) pairs of images.
    Pixels(&'a [(u32, u32)]),
    /// Whole frames, of all data.
    Frames(&'a [usize]),
}
