//! Light of what is made of cells, with nodes only where it may shine, and with more of them only
//! where its light is not resolved.
//!
//! A ray's path is halved until a piece cannot shine or is no longer than a cell; what is left
//! are panels of the quadrature. Those that are off by more than their share of the allowed error
//! are halved again, down to a part of a cell.

use super::chord::ChordBound;
use super::quadrature::{Light, integrate};
use super::rays::{End, TracedRay};
use super::tree::Node;
use super::volume::{Columns, FAINT, Piece, Workspace, ray_nodes};
use super::{PreparedScene, Scratch};
use crate::emission::medium::{CellSize, Medium, Moment, PathSegment};
use kerrlight_geodesic::{Path, Ray, ScreenPoint};

/// A panel of one ray.
#[derive(Debug, Clone, Copy)]
pub(super) struct Panel {
    /// Mino times.
    ends: [f64; 2],
    /// In M.
    length: f64,
    /// Whether it ends at the horizon.
    falls: bool,
    /// Its number among the panels whose nodes are known, if they are.
    known: Option<usize>,
}

/// A piece is halved at most this often.
const DEEPEST: u32 = 40;

/// Light of cells that one ray meets at one time.
struct Cells<'a> {
    prepared: &'a PreparedScene,
    medium: &'a dyn Medium,
    cell: CellSize,
    path: &'a Path,
    bound: ChordBound,
    moment: Moment,
    lambda: f64,
    screen: Option<ScreenPoint>,
}

impl PreparedScene {
    /// Light of medium number `m`, made of cells, along ray number `k`, which was traced step by
    /// step. Each time has nodes of its own, so that no time's light depends on another's.
    pub(super) fn fill_cells(
        &self,
        (m, k): (usize, usize),
        ray: &Ray,
        (screen, cell): (Option<ScreenPoint>, CellSize),
        times: &[f64],
        scratch: &mut Scratch,
    ) {
        let Scratch { path, traced, intervals, volume, .. } = scratch;
        let (medium, first) = (&*self.media[m], (m * traced.len() + k) * times.len());
        for (j, observed) in times.iter().enumerate() {
            if j > 0 && !medium.changes() {
                volume.lights[first + j] = volume.lights[first];
                continue;
            }
            let cells = Cells {
                prepared: self,
                medium,
                cell,
                path,
                bound: ChordBound::new(&self.hole, ray, path, self.tracer.tolerance()),
                moment: Moment { observed: *observed, slow_light: self.slow_light },
                lambda: ray.lambda,
                screen,
            };
            cells.find(&traced[k], intervals, &mut volume.panels);
            volume.lights[first + j] = cells.light(volume);
        }
    }
}

impl Cells<'_> {
    /// The panels on which there may be light.
    fn find(&self, traced: &TracedRay, intervals: &mut Vec<[f64; 2]>, panels: &mut Vec<Panel>) {
        panels.clear();
        let (outer, last) = (self.medium.sphere(), traced.last_time());
        let inner = self.cell.inner.min(outer).max(0.5 * self.prepared.hole.horizon());
        self.path.intervals_within(inner, outer, intervals);
        let turning = self.path.turning_point().map_or(f64::INFINITY, |(time, _)| time);
        let whole = self.path.mino_total();
        for [start, end] in intervals.iter().copied() {
            let falls = traced.end == End::Captured && end >= whole && last >= end;
            let end = end.min(last);
            let middle = turning.clamp(start, end.max(start));
            for [from, to] in [[start, middle], [middle, end]] {
                if to > from {
                    let ends = [from, to].map(|time| Node::at(self.path, time));
                    self.search([&ends[0], &ends[1]], falls && to >= end, 0, panels);
                }
            }
        }
    }

    fn search(&self, [start, end]: [&Node; 2], falls: bool, depth: u32, panels: &mut Vec<Panel>) {
        if !self.medium.may_shine(&self.segment([start, end]), self.moment) {
            return;
        }
        let ends = [start.point.mino_time, end.point.mino_time];
        let reach = 1.0 / (start.point.inverse_radius * end.point.inverse_radius);
        // ∫ Σ dτ: on a straight line to the centre Δτ is the difference of 1/r.
        let length = (ends[1] - ends[0]) * (reach + self.prepared.hole.spin().powi(2));
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
    fn light(&self, volume: &mut Workspace) -> Light {
        if volume.panels.is_empty() {
            return Light::default();
        }
        let all = usize::MAX;
        loop {
            self.fill(volume);
            let Workspace { quadrature, columns, emission, sums, panels, .. } = volume;
            let light = integrate(quadrature, &ray_nodes(columns, 0..all), emission, sums);
            let scale = light.intensity + FAINT * self.medium.scale();
            let enough = self.prepared.tolerance * scale;
            let share = enough / panels.len() as f64;
            if light.error <= enough || !self.halve(panels, &sums.misses, share) {
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

    /// Columns and emission of all panels; those that are known are kept.
    fn fill(&self, volume: &mut Workspace) {
        let Workspace { quadrature, columns, emission, panels, before, fresh, .. } = volume;
        let rule = &quadrature.rule;
        let order = rule.order();
        core::mem::swap(columns, &mut before.0);
        core::mem::swap(emission, &mut before.1);
        columns.iter_mut().for_each(Vec::clear);
        emission.clear();
        for (number, panel) in panels.iter_mut().enumerate() {
            if let Some(old) = panel.known.replace(number) {
                let range = old * order..(old + 1) * order;
                copy(columns, &before.0, range.clone());
                emission.append(&before.1, range);
                continue;
            }
            let place = |time, step| self.prepared.node_of(self.path, time, step);
            Piece::single(panel.ends, panel.falls).nodes(rule, place, columns);
            fresh.clear();
            let nodes = ray_nodes(columns, number * order..(number + 1) * order);
            self.medium.fill(&nodes, self.lambda, self.moment, fresh);
            if let Some(screen) = &self.screen {
                self.prepared.polarize(self.medium, &nodes, self.lambda, screen, fresh);
            }
            emission.append(fresh, 0..order);
        }
    }
}

fn copy(columns: &mut Columns, from: &Columns, range: core::ops::Range<usize>) {
    for (column, old) in columns.iter_mut().zip(from) {
        column.extend_from_slice(&old[range.clone()]);
    }
}
