//! Quadrature nodes along single rays: panels on the legs of a path, and the columns that hold
//! their nodes. For whole blocks of rays in closed form see [`Nodes`](crate::simd::Nodes).

use crate::integrate::outcome::Outcome;
use crate::integrate::path::Path;
use crate::simd::{LONGEST_PANEL, PanelRule, RayNodes};
use crate::spacetime::kerr::Kerr;
use core::ops::Range;

/// A node of a quadrature along a ray.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Node {
    /// Boyer–Lindquist radius, in M.
    pub radius: f64,
    /// cos θ.
    pub cos_theta: f64,
    /// Σ dτ, the weight in an integral over the affine parameter, in M.
    pub weight: f64,
    /// Mino time since the observer, in 1/M.
    pub mino_time: f64,
    /// Azimuth, in radians.
    pub azimuth: f64,
    /// Delay, in M.
    pub delay: f64,
    /// d(1/r)/dτ, dimensionless.
    pub radial_velocity: f64,
    /// d cos θ/dτ.
    pub polar_velocity: f64,
}

impl Node {
    /// The node at a Mino time of a path, for a step of Mino time, both in M⁻¹.
    pub fn of_path(hole: &Kerr, path: &Path, mino_time: f64, step: f64) -> Self {
        let point = path.at(mino_time);
        let (radius, cos_theta) = (point.radius(), point.cos_theta());
        Node {
            radius,
            cos_theta,
            weight: hole.sigma(radius, cos_theta) * step,
            mino_time,
            azimuth: point.azimuth,
            delay: point.delay,
            radial_velocity: point.inverse_radius_rate,
            polar_velocity: point.velocity[2],
        }
    }

    /// Its numbers, in their order.
    fn values(&self) -> [f64; 8] {
        let Node { radius, cos_theta, weight, mino_time, azimuth, delay, .. } = *self;
        let [radial, polar] = [self.radial_velocity, self.polar_velocity];
        [radius, cos_theta, weight, mino_time, azimuth, delay, radial, polar]
    }
}

/// Nodes in columns, in order along a ray.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct NodeColumns {
    /// Radii, cos θ, weights, Mino times and so on, in the order of [`Node`].
    columns: [Vec<f64>; 8],
}

impl NodeColumns {
    /// Number of nodes.
    pub fn len(&self) -> usize {
        self.columns[0].len()
    }

    /// Returns whether there is no node.
    pub fn is_empty(&self) -> bool {
        self.columns[0].is_empty()
    }

    /// Removes all nodes and keeps the memory.
    pub fn clear(&mut self) {
        self.columns.iter_mut().for_each(Vec::clear);
    }

    /// Appends a node.
    pub fn push(&mut self, node: Node) {
        self.columns.iter_mut().zip(node.values()).for_each(|(column, value)| column.push(value));
    }

    /// Appends the nodes `range` of another.
    ///
    /// # Panics
    /// If it has no such nodes.
    pub fn extend(&mut self, other: &NodeColumns, range: Range<usize>) {
        for (to, from) in self.columns.iter_mut().zip(&other.columns) {
            to.extend_from_slice(&from[range.clone()]);
        }
    }

    /// Mino times of all nodes.
    pub fn mino_times(&self) -> &[f64] {
        &self.columns[3]
    }

    /// Puts `node` in the place of node `k`.
    ///
    /// # Panics
    /// If there is no such node.
    pub fn set(&mut self, k: usize, node: Node) {
        self.columns.iter_mut().zip(node.values()).for_each(|(column, value)| column[k] = value);
    }

    /// Weights of all nodes, in M.
    pub fn weights(&self) -> &[f64] {
        &self.columns[2]
    }

    /// All nodes.
    pub fn all(&self) -> RayNodes<'_> {
        self.view(0..self.len())
    }

    /// The nodes `range`.
    ///
    /// # Panics
    /// If there are no such nodes.
    pub fn view(&self, range: Range<usize>) -> RayNodes<'_> {
        RayNodes::of(self.columns.each_ref().map(|column| &column[range.clone()]), 0.0)
    }
}

/// A part of a ray on which integrands are smooth: it ends at the edge of a region, at the radial
/// turning point, or at the horizon.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Leg {
    /// Start and end, in Mino time (M⁻¹) or another parameter of the ray.
    pub ends: [f64; 2],
    /// True if it ends at the horizon: its last panel is followed at a pace that falls to zero.
    pub falls: bool,
}

impl Leg {
    /// The number of panels for a ray that turns by `rate` radians per unit of its parameter, with
    /// each of the coarsest panels cut into `split`.
    pub fn panels(&self, rate: f64, split: u32) -> usize {
        let [from, to] = self.ends;
        let panels = ((to - from) * rate / LONGEST_PANEL).ceil().clamp(1.0, 1e4);
        (f64::from(split) * panels) as usize
    }

    /// Appends the nodes of `panels` equal panels: `node` makes a node of a parameter and of the
    /// step that it stands for.
    pub fn place(
        &self,
        rule: &PanelRule,
        panels: usize,
        node: impl Fn(f64, f64) -> Node,
        columns: &mut NodeColumns,
    ) {
        let [from, to] = self.ends;
        let length = (to - from) / panels as f64;
        for k in 0..panels {
            let start = from + length * k as f64;
            let falls = self.falls && k + 1 == panels;
            for (s, weight) in rule.nodes().iter().zip(rule.weights()) {
                let (place, pace) = PanelRule::pace(*s, falls);
                columns.push(node(start + length * place, length * weight * pace));
            }
        }
    }
}

/// Calls `take` with the legs of a path that lie in a shell of radii (M), up to the Mino time `until` (M⁻¹).
/// `intervals` is memory to be reused.
pub fn legs(
    path: &Path,
    [inner, outer]: [f64; 2],
    until: f64,
    intervals: &mut Vec<[f64; 2]>,
    mut take: impl FnMut(Leg),
) {
    path.intervals_within(inner, outer, intervals);
    let turning = path.turning_point().map_or(f64::INFINITY, |(time, _)| time);
    let captured = path.outcome() == Outcome::Captured;
    for [start, end] in intervals.iter().copied() {
        let falls = captured && end >= path.mino_total() && until >= end;
        let end = end.min(until);
        let middle = turning.clamp(start, end.max(start));
        for [from, to] in [[start, middle], [middle, end]] {
            if to > from {
                take(Leg { ends: [from, to], falls: falls && to >= end });
            }
        }
    }
}

/// Fills `columns` with the nodes of a path inside a sphere, up to the Mino time `until`: panels of
/// at most 0.4/√max(1, η + λ²) of Mino time, each cut into `split`.
pub fn on_path(
    (hole, path): (&Kerr, &Path),
    (radius, until): (f64, f64),
    (rule, split): (&PanelRule, u32),
    intervals: &mut Vec<[f64; 2]>,
    columns: &mut NodeColumns,
) {
    columns.clear();
    legs(path, [0.5 * hole.horizon(), radius], until, intervals, |leg| {
        let panels = leg.panels(path.angular_rate(), split);
        leg.place(rule, panels, |time, step| Node::of_path(hole, path, time, step), columns);
    });
}
