//! Fields to start from where a dark one has no slope: χ² of amplitudes has a kink there, closure quantities are not
//! defined.

use super::ray_weights::Voxels;
use core::f64::consts::TAU;
use kerrlight_render::dynamics::Axis;

/// Radius of the ring, its width and its thickness (standard deviations), in half-widths of the grid.
const RING: [f64; 3] = [0.6, 0.25, 0.15];
/// Standard deviation of a spot, in half-widths of the grid.
const SPOT: f64 = 0.1;
/// Spots are dark beyond so many standard deviations.
const EDGE: f64 = 3.0;

/// Numbers of spots that are tried: circles about the axis, and spots on each.
#[derive(Clone, Copy)]
pub(super) struct Spots {
    pub circles: usize,
    pub on_each: usize,
}

/// A lit field and where the descent from it ended.
pub(super) struct InitialField {
    /// The field that it began with, at the nodes that count.
    pub start: Vec<f64>,
    /// Field at its end.
    pub x: Vec<f64>,
    /// The value there.
    pub value: f64,
}

/// Trials of lit fields.
#[derive(Clone, Copy)]
pub(super) struct Trials {
    /// Number of candidate spots.
    pub spots: Spots,
    /// The best of them, from which descents begin, beside the wide fields.
    pub best: usize,
    /// Iterations of a descent.
    pub iterations: usize,
}

/// Grid points in coordinates about an axis.
pub(super) struct Around {
    basis: [[f64; 3]; 3],
    nodes: Vec<[f64; 3]>,
    half: f64,
}

impl Around {
    /// Nodes of a grid about the hole.
    pub fn new(voxels: &Voxels, axis: Axis) -> Self {
        let nodes = (0..voxels.count()).map(|k| voxels.position(k)).collect();
        Self { basis: axis.basis(), nodes, half: 0.5 * (voxels.high[0] - voxels.low[0]) }
    }

    fn field(&self, light: impl Fn([f64; 3]) -> f64) -> Vec<f64> {
        let along =
            |a: [f64; 3], x: &[f64; 3]| (a[0] * x[0] + a[1] * x[1] + a[2] * x[2]) / self.half;
        self.nodes.iter().map(|x| light(self.basis.map(|a| along(a, x)))).collect()
    }

    /// No emission.
    pub fn dark(&self) -> Vec<f64> {
        vec![0.0; self.nodes.len()]
    }

    /// Emission of 1 everywhere; a ring about the axis.
    pub fn wide(&self) -> [Vec<f64>; 2] {
        let ring = |[h, u, v]: [f64; 3]| bell((u.hypot(v) - RING[0]) / RING[1]) * bell(h / RING[2]);
        [self.field(|_| 1.0), self.field(ring)]
    }

    /// A spot on a circle about the axis, in the plane of the hole.
    pub fn spot(&self, spots: Spots, k: usize) -> Vec<f64> {
        let (circle, place) = (k / spots.on_each, k % spots.on_each);
        let radius = (circle as f64 + 1.0) / (spots.circles as f64 + 1.0);
        // Every other circle is turned by half a place, so that spots fill the gaps between others.
        let turn = (place as f64 + 0.5 * (circle % 2) as f64) / spots.on_each as f64;
        let (sin, cos) = (TAU * turn).sin_cos();
        self.field(|[h, u, v]| {
            let square = h * h + (u - radius * cos).powi(2) + (v - radius * sin).powi(2);
            let distance = square.sqrt() / SPOT;
            if distance < EDGE { bell(distance) } else { 0.0 }
        })
    }
}

impl Spots {
    /// All of them.
    pub fn count(self) -> usize {
        self.circles * self.on_each
    }
}

fn bell(u: f64) -> f64 {
    (-0.5 * u * u).exp()
}
