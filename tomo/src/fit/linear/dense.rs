//! Rows of data to which all rays add: a number for every node.

use super::operator::Operator;
use super::ray_weights::Buffers;
use super::rows::Rows;
use kerrlight_common::simd::Float;

impl<T: Float> Rows<T> {
    /// Adds a row of all columns.
    fn push_dense(&mut self, pixel: u32, row: &[T]) {
        let lit = row.iter().enumerate().filter(|(_, entry)| **entry != T::zero());
        for (column, entry) in lit {
            self.columns.push(column as u32);
            self.entries.push(*entry);
        }
        self.pixel.push(pixel);
        self.starts.push(self.columns.len() as u32);
    }
}

impl<T: Float + Default> Operator<'_, T> {
    /// Rows to which all rays add.
    pub fn fluxes_of(&self, frame: usize) -> Rows<T> {
        let columns = self.active.count();
        // Rays pass the same nodes: a row for each ray would hold a column many times.
        let mut sums = vec![T::zero(); self.pixels * columns];
        let wanted = Some(self.active.cells.as_slice());
        self.walk.frame(frame, wanted, &mut Buffers::default(), |pixel, places| {
            let row = &mut sums[pixel as usize * columns..][..columns];
            self.entries(places, |column, entry| row[column as usize] += entry);
        });
        let mut rows = Rows::default();
        // No column counts where all nodes are dark; chunks of length 0 panic.
        for (pixel, row) in sums.chunks_exact(columns.max(1)).enumerate() {
            rows.push_dense(pixel as u32, row);
        }
        rows
    }
}
