//! Rows of data to which all rays add: a number for every node.

use super::active::NONE;
use super::operator::Operator;
use super::ray_weights::Buffers;
use super::rows::Rows;
use crate::representation::spline::STENCIL;
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
        let (wanted, degree) = (Some(self.active.cells.as_slice()), self.walk.voxels.degree);
        let mut weights = [T::zero(); STENCIL];
        self.walk.frame(frame, wanted, &mut Buffers::default(), |pixel, places| {
            let row = &mut sums[pixel as usize * columns..][..columns];
            for at in places {
                at.weights(degree, &mut weights);
                for (corner, entry) in self.corners.iter().zip(weights) {
                    let column = self.active.column[at.corner as usize + corner];
                    if column != NONE {
                        row[column as usize] += entry;
                    }
                }
            }
        });
        let mut rows = Rows::default();
        // No column counts where all nodes are dark; chunks of length 0 panic.
        for (pixel, row) in sums.chunks_exact(columns.max(1)).enumerate() {
            rows.push_dense(pixel as u32, row);
        }
        rows
    }
}
