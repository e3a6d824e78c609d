//! Rows of the sparse matrix from nodes to the pixels of a frame.

use kerrlight_common::simd::Float;

/// Rows of a frame that are not empty: `starts` of each, and where the last ends.
#[derive(Clone)]
pub(super) struct Rows<T> {
    pub pixel: Vec<u32>,
    pub starts: Vec<u32>,
    pub columns: Vec<u32>,
    pub entries: Vec<T>,
}

impl<T> Default for Rows<T> {
    fn default() -> Self {
        let (pixel, columns, entries) = (Vec::new(), Vec::new(), Vec::new());
        Self { pixel, starts: vec![0], columns, entries }
    }
}

impl<T: Float> Rows<T> {
    /// Takes all rows away.
    pub fn clear(&mut self) {
        self.pixel.clear();
        self.starts.truncate(1);
        self.columns.clear();
        self.entries.clear();
    }

    pub fn forward(&self, x: &[T], image: &mut [T]) {
        for (pixel, ends) in self.pixel.iter().zip(self.starts.windows(2)) {
            let range = ends[0] as usize..ends[1] as usize;
            let (columns, entries) = (&self.columns[range.clone()], &self.entries[range]);
            let sum = columns.iter().zip(entries).map(|(c, e)| *e * x[*c as usize]);
            image[*pixel as usize] += sum.fold(T::zero(), |sum, x| sum + x);
        }
    }

    pub fn adjoint(&self, gradient: &[T], sums: &mut [T]) {
        for (pixel, ends) in self.pixel.iter().zip(self.starts.windows(2)) {
            let slope = gradient[*pixel as usize];
            if slope == T::zero() {
                continue;
            }
            let range = ends[0] as usize..ends[1] as usize;
            let (columns, entries) = (&self.columns[range.clone()], &self.entries[range]);
            for (column, entry) in columns.iter().zip(entries) {
                sums[*column as usize] += *entry * slope;
            }
        }
    }

    pub fn bytes(&self) -> usize {
        self.entries.len() * (size_of::<T>() + 4) + self.pixel.len() * 8
    }
}

/// Storage of a frame: rows add up in another order than a walk, so that this decides the last bits, and whether
/// rows are kept or made again does not.
pub(super) enum Held<T> {
    /// Rows that are kept.
    Kept(Rows<T>),
    /// Rows that are made each time, one after the other.
    Made,
    /// Node by node.
    Walked,
}
