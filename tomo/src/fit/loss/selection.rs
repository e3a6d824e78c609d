//! Selection of the data of a step.

/// Part of the data that a step looks at.
#[derive(Clone, Copy, Debug)]
pub enum Selection<'a> {
    /// (ray, frame) pairs of images.
    Pixels(&'a [(u32, u32)]),
    /// Whole frames, of all data.
    Frames(&'a [usize]),
}

impl Selection<'_> {
    /// Returns the number of pairs or frames.
    pub fn len(&self) -> usize {
        match self {
            Self::Pixels(pairs) => pairs.len(),
            Self::Frames(frames) => frames.len(),
        }
    }

    /// Returns whether there are none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }
}
