//! Light of what is made of cells, with nodes only where it may shine, and with more of them only
//! where its light is not resolved.
//!
//! A ray's path is halved until a piece cannot shine or is no longer than a cell; what is left
//! are panels of the quadrature. Those that are off by more than their share of the allowed error
//! are halved again, down to a part of a cell.

use super::{FAINT, Media, MediaRay, MediaScratch};
use crate::emission::medium::{CellSize, Emission, Medium, Moment, PathSegment};
use crate::transport::chord::ChordBound;
use crate::transport::optics::Optics;
use crate::transport::polarized::PolarizedRay;
use crate::transport::quadrature::{Quadrature, integrate};
use crate::transport::result::Light;
use crate::transport::tree::Node;
use kerrlight_geodesic::nodes::{self, Leg, NodeColumns};
use kerrlight_geodesic::{Path, PathOfRay};

/// A panel of one ray.
#[derive(Debug, Clone, Copy)]
struct Panel {
    /// Mino times.
    ends: [f64; 2],
    /// Length, M.
    length: f64,
    /// True if it ends at the horizon.
    falls: bool,
    /// Its number among the panels whose nodes are known, if they are.
    known: Option<usize>,
}

/// Scratch space of cells, from ray to ray.
#[derive(Debug, Default)]
pub(super) struct CellScratch {
    intervals: Vec<[f64; 2]>,
    /// Panels of one ray, with their nodes and emission.
    panels: Vec<Panel>,
    nodes: NodeColumns,
    emission: Emission,
    /// Nodes and emission before panels were halved, and emission of one panel.
    before: (NodeColumns, Emission),
    fresh: Emission,
}

/// A piece is halved at most this often.
const DEEPEST: u32 = 40;

/// Light of cells that one ray meets at one time.
struct Cells<'a> {
    optics: &'a Optics,
    medium: &'a dyn Medium,
    cell: CellSize,
    path: &'a Path,
    bound: ChordBound,
    moment: Moment,
    lambda: f64,
    polarized: Option<PolarizedRay<'a>>,
    cuts: Option<[f64; 2]>,
}

impl Media {
    /// Sums up the light of medium number `m`, made of cells, along a ray that was traced step by
    /// step. Each time has nodes of its own, so that no time's light depends on another's.
    pub fn radiate_cells(
        &self,
        (m, medium, cell): (usize, &dyn Medium, CellSize),
        optics: &Optics,
        seen: &MediaRay<'_>,
        PathOfRay { ray, path, tolerance }: PathOfRay<'_>,
        scratch: &mut MediaScratch,
    ) {
        let mut last = Light::default();
        for (j, observed) in seen.times.iter().enumerate() {
            if j == 0 || medium.changes() {
                let cells = Cells {
                    optics,
                    medium,
                    cell,
                    path,
                    bound: ChordBound::new(&optics.hole, ray, path, tolerance),
                    moment: Moment { observed: *observed, slow_light: optics.slow_light },
                    lambda: ray.lambda,
                    polarized: seen.polarized,
                    cuts: seen.cuts,
                };
                let CellScratch { intervals, panels, .. } = &mut scratch.cells;
                cells.find(seen.ray.last_time(), intervals, panels);
                last = cells.light(scratch);
            }
            self.keep(m, seen.number, j, last, scratch);
        }
    }
}

impl Cells<'_> {
    /// The panels on which there may be light.
    fn find(&self, last: f64, intervals: &mut Vec<[f64; 2]>, panels: &mut Vec<Panel>) {
        panels.clear();
        let outer = self.medium.sphere();
        let inner = self.cell.inner.min(outer).max(0.5 * self.optics.hole.horizon());
        nodes::legs(self.path, [inner, outer], last, intervals, |Leg { ends, falls }| {
            let ends = ends.map(|time| Node::at(self.path, time));
            self.search([&ends[0], &ends[1]], falls, 0, panels);
        });
    }

    fn search(&self, [start, end]: [&Node; 2], falls: bool, depth: u32, panels: &mut Vec<Panel>) {
        if !self.medium.may_shine(&self.segment([start, end]), self.moment) {
            return;
        }
        let ends = [start.point.mino_time, end.point.mino_time];
        let reach = 1.0 / (start.point.inverse_radius * end.point.inverse_radius);
        // ∫ Σ dτ: on a straight line to the centre Δτ is the difference of 1/r.
        let length = (ends[1] - ends[0]) * (reach + self.optics.hole.spin().powi(2));
        if length <= self.cell.size || depth >= DEEPEST {
            return panels.push(Panel { ends, length, falls, known: None });
        }
        let middle = Node::at(self.path, 0.5 * (ends[0] + ends[1]));
        self.search([start, &middle], false, depth + 1, panels);
        self.search([&middle, end], falls, depth + 1, panels);
    }

    fn segment(&self, nodes: [&Node; 2]) -> PathSegment {
        let points = nodes.map(|node| &node.point);
        let error = self.bound.error(self.bound.reach(points));
        let radii = points.map(|point| point.radius());
        let winds = self.bound.winds(points);
        PathSegment {
            positions: nodes.map(|node| node.position),
            radii: [radii[0].min(radii[1]) - error, radii[0].max(radii[1]) + error],
            delays: [points[1].delay + error, points[0].delay - error],
            off: if winds { f64::INFINITY } else { self.bound.distance(points) },
        }
    }

    /// Light of the panels, which are halved as long as that makes sense.
    fn light(&self, media: &mut MediaScratch) -> Light {
        if media.cells.panels.is_empty() {
            return Light::default();
        }
        let MediaScratch { quadrature, sums, cells, .. } = media;
        loop {
            self.fill(quadrature, cells);
            let light = integrate(quadrature, &cells.nodes.all(), &cells.emission, self.cuts, sums);
            let scale = light.intensity + FAINT * self.medium.scale();
            let enough = self.optics.tolerance * scale;
            let share = enough / cells.panels.len() as f64;
            if light.error <= enough || !self.halve(&mut cells.panels, &sums.misses, share) {
                return light;
            }
        }
    }

    /// Halves the panels that are off by more than `share`; whether there are any.
    fn halve(&self, panels: &mut Vec<Panel>, misses: &[f64], share: f64) -> bool {
        let before = panels.len();
        let finest = CellSize::FINEST * self.cell.size;
        let mut halved = Vec::with_capacity(2 * before);
        for (panel, miss) in panels.iter().zip(misses) {
            if *miss <= share || panel.length <= finest {
                halved.push(*panel);
                continue;
            }
            let Panel { ends: [from, to], length, falls, .. } = *panel;
            let (middle, half) = (0.5 * (from + to), 0.5 * length);
            let first = Panel { ends: [from, middle], length: half, falls: false, known: None };
            halved.extend([first, Panel { ends: [middle, to], falls, ..first }]);
        }
        *panels = halved;
        panels.len() > before
    }

    /// Nodes and emission of all panels; those that are known are kept.
    fn fill(&self, quadrature: &Quadrature, scratch: &mut CellScratch) {
        let CellScratch { nodes, emission, panels, before, fresh, .. } = scratch;
        let rule = &quadrature.rule;
        let order = rule.order();
        core::mem::swap(nodes, &mut before.0);
        core::mem::swap(emission, &mut before.1);
        nodes.clear();
        emission.clear();
        for (number, panel) in panels.iter_mut().enumerate() {
            // From here on it is known under its new number.
            if let Some(old) = panel.known.replace(number) {
                let range = old * order..(old + 1) * order;
                nodes.extend(&before.0, range.clone());
                emission.append(&before.1, range);
                continue;
            }
            let (hole, path) = (&self.optics.hole, self.path);
            let node = |time, step| nodes::Node::of_path(hole, path, time, step);
            Leg { ends: panel.ends, falls: panel.falls }.place(rule, 1, node, nodes);
            fresh.clear();
            let nodes = nodes.view(number * order..(number + 1) * order);
            self.medium.fill(&nodes, self.lambda, self.moment, fresh);
            if let Some(polarized) = &self.polarized {
                polarized.polarize(self.medium, &nodes, fresh);
            }
            emission.append(fresh, 0..order);
        }
    }
}
