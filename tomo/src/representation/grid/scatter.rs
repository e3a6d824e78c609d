//! Adds what points contribute to nodes, by all threads and yet always in the same order.
//!
//! Points are sorted by slabs of cells. A slab touches its own nodes and the first layer of the
//! next; so the even slabs can be worked on at the same time, and then the odd ones, straight into the
//! gradient.

use kerrlight_common::simd::Float;
use rayon::prelude::*;

/// The most slabs.
const SLABS: usize = 32;

/// Index of a point that contributes nothing.
pub const NOWHERE: u32 = u32::MAX;

/// Contribution of a point to the eight nodes of its cell.
#[derive(Clone, Copy, Debug, Default)]
pub struct Contribution<T> {
    /// First node of the cell, or [`NOWHERE`].
    pub corner: u32,
    /// Position in the cell along x, y, z.
    pub within: [T; 3],
    /// The activation's slope.
    pub weight: T,
}

/// Contributions of a batch and their order.
#[derive(Default)]
pub struct Scatter<T> {
    contributions: Vec<Contribution<T>>,
    order: Vec<u32>,
    /// Starts of the slabs in the order.
    starts: Vec<usize>,
}

impl<T: Float> Scatter<T> {
    /// Room for a batch.
    pub fn contributions(&mut self, points: usize) -> &mut [Contribution<T>] {
        self.contributions.resize(points, Contribution::default());
        self.order.resize(points, 0);
        &mut self.contributions
    }

    /// Adds all contributions, times their cotangents, to the nodes.
    pub fn add_to(&mut self, cotangents: &[T], sums: &mut [T], nodes: [usize; 3]) {
        self.sort(nodes);
        self.add_sorted(|point| cotangents[point], sums, nodes);
    }

    /// The same for contributions that have been sorted.
    pub fn add_sorted(
        &self,
        cotangent: impl Fn(usize) -> T + Sync,
        sums: &mut [T],
        nodes: [usize; 3],
    ) {
        let [_, ny, nz] = nodes;
        let slab = slab(nodes);
        for parity in 0..2 {
            let Some(sums) = sums.get_mut(parity * slab..) else { return };
            sums.par_chunks_mut(2 * slab).enumerate().for_each(|(k, sums)| {
                let s = 2 * k + parity;
                // The last chunk may be nothing but the last layer of nodes, behind all slabs.
                let Some([from, to]) = self.starts.get(s..s + 2) else { return };
                for index in &self.order[*from..*to] {
                    let mut contribution = self.contributions[*index as usize];
                    contribution.weight *= cotangent(*index as usize);
                    add(&contribution, sums, s * slab, ny, nz);
                }
            });
        }
    }

    /// Sorts indices by slab, in their order within.
    pub fn sort(&mut self, nodes: [usize; 3]) {
        let slab = slab(nodes);
        // A counting sort keeps the order of points in a slab, and so every bit of the sums.
        let mut starts = [0; SLABS + 1];
        let of = |c: &Contribution<T>| (c.corner != NOWHERE).then(|| c.corner as usize / slab);
        for s in self.contributions.iter().filter_map(of) {
            starts[s + 1] += 1;
        }
        for s in 0..SLABS {
            starts[s + 1] += starts[s];
        }
        let mut next = starts;
        for (index, contribution) in self.contributions.iter().enumerate() {
            if let Some(s) = of(contribution) {
                self.order[next[s]] = index as u32;
                next[s] += 1;
            }
        }
        self.starts.clear();
        self.starts.extend(starts);
    }
}

/// Nodes of a slab, but for the first layer of the next.
fn slab([nx, ny, nz]: [usize; 3]) -> usize {
    (nx - 1).div_ceil(SLABS) * ny * nz
}

#[inline(always)]
fn add<T: Float>(c: &Contribution<T>, sums: &mut [T], first: usize, ny: usize, nz: usize) {
    let corner = c.corner as usize - first;
    let [x, y, z] = c.within;
    let one = T::one();
    let (left, right) = (c.weight * (one - x), c.weight * x);
    let rows = [left * (one - y), left * y, right * (one - y), right * y];
    for (start, row) in [0, nz, ny * nz, (ny + 1) * nz].into_iter().zip(rows) {
        let pair = &mut sums[corner + start..corner + start + 2];
        pair[0] += row * (one - z);
        pair[1] += row * z;
    }
}
