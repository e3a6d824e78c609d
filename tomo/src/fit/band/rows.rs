//! Rows of a light curve on rings about the axis: what each ring and layer adds, by harmonics of the azimuth.

use super::Sampling;
use crate::fit::ForwardModel;
use crate::fit::forward::batch::Batch;
use core::f64::consts::TAU;
use kerrlight_common::simd::Float;
use kerrlight_render::dynamics::Axis;
use nalgebra::DMatrix;

/// Nodes of emission in distance from the axis, azimuth and z; linear between them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PolarGrid {
    /// The largest distance from the axis, M; the first ring is the axis.
    pub radius: f64,
    /// Number of rings, two or more.
    pub rings: usize,
    /// Nodes of a ring, four or more.
    pub azimuths: usize,
    /// The largest |z|, M.
    pub height: f64,
    /// Number of layers, two or more.
    pub layers: usize,
}

impl PolarGrid {
    /// Distances of the rings from the axis, M.
    pub fn rings(&self) -> Vec<f64> {
        (0..self.rings).map(|k| self.radius * k as f64 / (self.rings - 1) as f64).collect()
    }

    /// Heights of the layers, M.
    pub fn layers(&self) -> Vec<f64> {
        let part = |k: usize| 2.0 * k as f64 / (self.layers - 1) as f64 - 1.0;
        (0..self.layers).map(|k| self.height * part(k)).collect()
    }

    /// Number of nodes: layer by layer, ring by ring, azimuth by azimuth.
    pub fn count(&self) -> usize {
        self.layers * self.rings * self.azimuths
    }

    /// Functions of the azimuth that it tells apart: 1, and the cosine and sine of each harmonic.
    pub fn waves(&self) -> usize {
        // Of an even number of nodes the last cosine has no sine beside it, and is left out.
        2 * ((self.azimuths - 1) / 2) + 1
    }

    /// Adds a point's share to the eight nodes about it; none outside of the grid.
    fn add(&self, [x, y, z]: [f64; 3], weight: f64, row: &mut [f64]) {
        let across = x.hypot(y) / self.radius * (self.rings - 1) as f64;
        let up = (z / self.height + 1.0) * 0.5 * (self.layers - 1) as f64;
        let round = y.atan2(x).rem_euclid(TAU) / TAU * self.azimuths as f64;
        let inside = |u: f64, nodes: usize| u >= 0.0 && u <= (nodes - 1) as f64;
        if !(inside(across, self.rings) && inside(up, self.layers) && round.is_finite()) {
            return;
        }
        let halves = |u: f64, last: usize| {
            // The last node belongs to the cell before it.
            let first = (u as usize).min(last);
            [(first, 1.0 + first as f64 - u), (first + 1, u - first as f64)]
        };
        for (layer, of_layer) in halves(up, self.layers - 2) {
            for (ring, of_ring) in halves(across, self.rings - 2) {
                let start = (layer * self.rings + ring) * self.azimuths;
                // Rings are closed: behind the last node comes the first.
                for (azimuth, part) in halves(round, self.azimuths - 1) {
                    row[start + azimuth % self.azimuths] += weight * of_layer * of_ring * part;
                }
            }
        }
    }
}

/// A light curve as a linear function of emission on rings, all numbers over the standard deviations of the data.
#[derive(Clone, Debug)]
pub struct CurveRows {
    /// The grid.
    pub grid: PolarGrid,
    /// Mask of the data that are used; the others judge.
    pub used: Vec<bool>,
    /// Times and errors of the data.
    pub sampling: Sampling,
    /// A column for each layer of each datum of each function of the azimuth (the first slowest), ring by ring.
    pub(super) waves: DMatrix<f64>,
}

impl CurveRows {
    /// Takes the numbers of all nodes of the grid for each datum, over its standard deviation.
    pub fn new(grid: PolarGrid, rows: &[Vec<f64>], used: Vec<bool>, sampling: Sampling) -> Self {
        let trigonometric = trigonometric(&grid);
        let mut waves = DMatrix::zeros(grid.rings, grid.waves() * rows.len() * grid.layers);
        for (datum, row) in rows.iter().enumerate() {
            for (place, ring) in row.chunks_exact(grid.azimuths).enumerate() {
                if ring.iter().all(|x| *x == 0.0) {
                    continue;
                }
                for (wave, values) in trigonometric.iter().enumerate() {
                    let column = (wave * rows.len() + datum) * grid.layers + place / grid.rings;
                    waves[(place % grid.rings, column)] =
                        ring.iter().zip(values).map(|(a, b)| a * b).sum();
                }
            }
        }
        Self { grid, used, sampling, waves }
    }

    /// Takes light curves of a model, whose pixels are the numbers of a frame and whose frames are the samples.
    pub fn of<T: Float>(
        model: &ForwardModel<T>,
        axis: Axis,
        grid: PolarGrid,
        sampling: Sampling,
        used: Vec<bool>,
    ) -> Self {
        let (count, mut batch) = (model.pixels(), Batch::default());
        let scales = &sampling.scales;
        let mut rows = Vec::with_capacity(scales.len());
        for (frame, scales) in scales.chunks_exact(count).enumerate() {
            batch.set((0..model.rays()).map(|ray| (ray as u32, frame as u32)));
            batch.gather(model, axis, None);
            let mut of_frame = vec![vec![0.0; grid.count()]; count];
            for k in 0..batch.points() {
                let (at, weight) = point(&batch, k);
                let factors = model.planes.as_ref().map(|planes| planes.of(batch.columns.node[k]));
                for (plane, (row, scale)) in of_frame.iter_mut().zip(scales).enumerate() {
                    let factor = factors.map_or(1.0, |factors| factors[plane].double());
                    grid.add(at, weight * factor * scale, row);
                }
            }
            rows.append(&mut of_frame);
        }
        Self::new(grid, &rows, used, sampling)
    }

    /// Number of data.
    pub fn data(&self) -> usize {
        self.used.len()
    }

    /// Numbers of the data that are used, or of the others.
    pub(super) fn numbers(&self, used: bool) -> Vec<usize> {
        (0..self.used.len()).filter(|k| self.used[*k] == used).collect()
    }
}

/// Returns the place of the matter of a node at the reference time, and the weight of its light.
fn point<T: Float>(batch: &Batch<T>, k: usize) -> ([f64; 3], f64) {
    let [x, y, z] = &batch.columns.pulled;
    ([x[k], y[k], z[k]].map(T::double), batch.columns.weight[k].double())
}

/// 1, √2 cos φ, √2 sin φ, √2 cos 2φ, … at the nodes of a ring: of unit mean square.
fn trigonometric(grid: &PolarGrid) -> Vec<Vec<f64>> {
    let at = |wave: usize, node: usize| {
        let (sin, cos) = (TAU * (wave.div_ceil(2) * node) as f64 / grid.azimuths as f64).sin_cos();
        match wave {
            0 => 1.0,
            _ if wave % 2 == 1 => cos * core::f64::consts::SQRT_2,
            _ => sin * core::f64::consts::SQRT_2,
        }
    };
    (0..grid.waves()).map(|wave| (0..grid.azimuths).map(|node| at(wave, node)).collect()).collect()
}
