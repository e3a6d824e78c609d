//! Occupancy: the co-rotating cells where anything shines; empty ones are not evaluated.

use super::sightlines::Region;
use crate::representation::{Representation, Workspace};
use kerrlight_common::simd::Float;
use kerrlight_render::points::Coordinates;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Mask of what shines.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct OccupancySettings {
    /// Cells along each axis.
    #[schemars(range(min = 2, max = 256), extend("unit" = "cells along each axis"))]
    pub cells: usize,
    /// Cells below this fraction of the peak are empty, 0 to 1, 1 excluded; neighbours of lit cells are kept.
    pub threshold: f64,
    /// Fraction of the old brightness kept at each update, 0 to 1, 1 excluded.
    pub memory: f64,
    /// Steps before the mask is used.
    pub warm_up: u64,
    /// Steps between updates, each at a random point of every cell.
    pub every: u64,
}

impl Default for OccupancySettings {
    fn default() -> Self {
        Self { cells: 24, threshold: 0.003, memory: 0.8, warm_up: 0, every: 20 }
    }
}

/// Number of times at which a field that changes is looked at, once it has been looked at at all of them.
const LATER: usize = 4;

/// Cells of a cube about the hole that shine, or may.
#[derive(Clone, Debug, PartialEq)]
pub struct Occupancy {
    settings: OccupancySettings,
    half_width: f64,
    /// Largest emission of each cell that is remembered, z fastest.
    pub(in crate::fit) brightness: Vec<f32>,
    occupied: Vec<bool>,
}

impl Occupancy {
    /// A mask of a region in which everything counts until it has been refreshed.
    pub fn new(settings: OccupancySettings, region: Region) -> Self {
        let count = settings.cells.pow(3);
        Self {
            settings,
            half_width: region.r_max,
            brightness: vec![0.0; count],
            occupied: vec![true; count],
        }
    }

    /// Part of the cells that may shine.
    pub fn fraction(&self) -> f64 {
        self.occupied.iter().filter(|cell| **cell).count() as f64 / self.occupied.len() as f64
    }

    /// Returns whether a point lies in a cell that may shine; none does outside the cube.
    #[inline]
    pub fn holds(&self, point: [f64; 3]) -> bool {
        let n = self.settings.cells;
        let per_length = n as f64 / (2.0 * self.half_width);
        let mut cell = 0;
        for x in point {
            let place = (x + self.half_width) * per_length;
            // What is no number is in no cell either.
            if !(0.0..=n as f64).contains(&place) {
                return false;
            }
            // The upper face belongs to the last cell.
            cell = cell * n + (place as usize).min(n - 1);
        }
        self.occupied[cell]
    }

    /// Cells along each axis, and half the width of the cube, M.
    #[cfg(feature = "wgpu")]
    pub(in crate::fit) fn shape(&self) -> (u32, f32) {
        (self.settings.cells as u32, self.half_width as f32)
    }

    /// Iterates over whether each cell may shine, z fastest.
    #[cfg(feature = "wgpu")]
    pub(in crate::fit) fn cells(&self) -> impl Iterator<Item = bool> {
        self.occupied.iter().copied()
    }

    /// Looks at one random point of every cell, the same for the same seed. A field that changes while matter carries it is
    /// looked at there at all of its `times` (M since the reference time) as long as nothing has been seen, and at some of
    /// them later.
    pub fn refresh<T: Float>(
        &mut self,
        representation: &dyn Representation<T>,
        parameters: &[T],
        seed: u64,
        times: &[f64],
        workspace: &mut Workspace,
    ) {
        let mut random = Pcg64::seed_from_u64(seed);
        let n = self.settings.cells;
        let width = self.cell_width();
        let mut points: [Vec<T>; 3] = Default::default();
        for cell in 0..n.pow(3) {
            for (column, k) in points.iter_mut().zip([cell / (n * n), cell / n % n, cell % n]) {
                let within: f64 = random.random();
                column.push(T::of((k as f64 + within) * width - self.half_width));
            }
        }
        let [x, y, z] = &points;
        let mut values = vec![T::zero(); n.pow(3)];
        let is_new = self.brightness.iter().all(|b| *b == 0.0);
        // One random point of a cell may miss what shines in it: what was seen before fades over
        // several looks.
        let memory = self.settings.memory;
        self.brightness.iter_mut().for_each(|b| *b = (f64::from(*b) * memory) as f32);
        for time in looks(times, is_new, &mut random) {
            let time = vec![T::of(time); x.len()];
            let at = Coordinates::of(representation.dimension(), &time, [x, y, z]);
            representation.eval(parameters, at, &mut values, workspace);
            let pairs = self.brightness.iter_mut().zip(&values);
            pairs.for_each(|(b, value)| *b = b.max(value.double() as f32));
        }
        self.mark();
    }

    /// A random point of these cells, M.
    pub(in crate::fit) fn draw(&self, lit: &[usize], random: &mut Pcg64) -> [f64; 3] {
        let n = self.settings.cells;
        let width = self.cell_width();
        let cell = lit[random.random_range(0..lit.len())];
        let at = [cell / (n * n), cell / n % n, cell % n];
        at.map(|k| (k as f64 + random.random::<f64>()) * width - self.half_width)
    }

    /// Returns the cells that may shine.
    pub(in crate::fit) fn lit(&self) -> Vec<usize> {
        (0..self.occupied.len()).filter(|cell| self.occupied[*cell]).collect()
    }

    /// M.
    pub(in crate::fit) fn cell_width(&self) -> f64 {
        2.0 * self.half_width / self.settings.cells as f64
    }

    /// Marks cells that are bright enough, and their neighbours.
    pub(in crate::fit) fn mark(&mut self) {
        let peak = self.brightness.iter().fold(0.0f32, |peak, b| peak.max(*b));
        // As long as all is dark this is 0 and every cell counts: without any, nothing would be
        // evaluated, and nothing learnt.
        let least = (f64::from(peak) * self.settings.threshold) as f32;
        let bright = self.brightness.iter().map(|b| *b >= least).collect();
        self.occupied = dilated(bright, [self.settings.cells; 3], 1);
    }
}

/// Marks what is not farther than this many cells or nodes along each axis, and knots in time.
pub(in crate::fit) fn dilated(
    mut marked: Vec<bool>,
    [nx, ny, nz]: [usize; 3],
    steps: usize,
) -> Vec<bool> {
    let count = marked.len();
    let knots = count / (nx * ny * nz);
    // One axis after the other: three passes of a step reach all 26 neighbours.
    for (stride, n) in [(1, nz), (nz, ny), (ny * nz, nx), (nx * ny * nz, knots)] {
        for _ in 0..steps {
            let spread = |k: usize| {
                let place = k / stride % n;
                marked[k]
                    || (place > 0 && marked[k - stride])
                    || (place + 1 < n && marked[k + stride])
            };
            marked = (0..count).map(spread).collect();
        }
    }
    marked
}

/// Times at which a field is looked at: all of them at first, then [`LATER`] random ones, and the reference time where there
/// are none.
fn looks(times: &[f64], is_new: bool, random: &mut Pcg64) -> Vec<f64> {
    match times {
        [] => vec![0.0],
        _ if is_new || times.len() <= LATER => times.to_vec(),
        _ => (0..LATER).map(|_| times[random.random_range(0..times.len())]).collect(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::representation::{Activation, Grid, GridSettings};

    /// One node of a grid shines: its cells and their neighbours are kept, nothing else.
    #[test]
    fn exact_cells_about_what_shines_are_kept() {
        let settings = GridSettings {
            nodes: [11; 3],
            low: [-5.0; 3],
            high: [5.0; 3],
            activation: Activation::Linear,
            initial: 0.0,
        };
        let grid = Grid::new(settings).unwrap();
        let mut parameters = vec![0.0f32; 1331];
        parameters[(8 * 11 + 5) * 11 + 2] = 1.0; // at (3, 0, −3)
        let region = Region { r_min: 0.0, r_max: 5.0, z_width: f64::INFINITY };
        let (threshold, memory, rest) = (1e-4, 0.9, OccupancySettings::default());
        let settings = OccupancySettings { cells: 10, threshold, memory, ..rest };
        let mut mask = Occupancy::new(settings, region);
        assert!(mask.holds([-4.0, 4.0, 4.0]) && !mask.holds([5.1, 0.0, 0.0]));
        mask.refresh(&grid, &parameters, 7, &[], &mut Workspace::new());
        // Two cells along each axis shine, four are kept.
        assert!((mask.fraction() - 0.064).abs() < 1e-12, "{}", mask.fraction());
        assert!(mask.holds([3.0, 0.0, -3.0]) && mask.holds([4.9, 1.9, -1.1]));
        assert!(!mask.holds([0.9, 0.0, -3.0]) && !mask.holds([-3.0, 0.0, 3.0]));
    }
}
