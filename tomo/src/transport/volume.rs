//! Light of what fills space, with as many nodes as it takes.

use super::cells::Panel;
use super::quadrature::{Light, Quadrature, Sums, integrate};
use super::rays::{End, TracedRay};
use super::surface::Hit;
use super::{PreparedScene, Scratch};
use crate::emission::medium::{CellSize, Emission, Medium, Moment};
use kerrlight_geodesic::simd::{NodeRequest, PanelRule, RayNodes};
use kerrlight_geodesic::{Observer, OutOfRange, Path, Quantities, ScreenPoint};

/// Nodes of a panel.
const ORDER: usize = 8;

/// Panels are cut into at most so many times as many.
const FINEST: u32 = 256;

/// The same where cells have to be resolved.
const FINEST_OF_CELLS: u32 = 1024;

/// Rays whose nodes are in memory at once: few enough for the second cache.
const TOGETHER: usize = 128;

/// Errors of rays fainter than this share of what the medium can reach are measured by that.
pub(super) const FAINT: f64 = 1e-4;

/// What a volume needs from ray to ray.
#[derive(Debug)]
pub(super) struct Workspace {
    pub quadrature: Quadrature,
    pub emission: Emission,
    pub sums: Sums,
    pub columns: Columns,
    /// Panels of one ray.
    pub panels: Vec<Panel>,
    /// Columns and emission before panels were halved, and emission of one panel.
    pub before: (Columns, Emission),
    pub fresh: Emission,
    /// Light of each ray at each time, as in the result.
    pub lights: Vec<Light>,
    pub profile: DepthProfile,
}

impl Default for Workspace {
    fn default() -> Self {
        Workspace {
            quadrature: Quadrature::new(ORDER),
            emission: Emission::default(),
            sums: Sums::default(),
            columns: Columns::default(),
            panels: Vec::new(),
            before: Default::default(),
            fresh: Emission::default(),
            lights: Vec::new(),
            profile: DepthProfile::default(),
        }
    }
}

/// Optical depth along a ray.
#[derive(Debug, Default)]
pub(super) struct DepthProfile {
    times: Vec<f64>,
    depths: Vec<f64>,
    rates: Vec<f64>,
    /// That of the whole way.
    total: f64,
}

impl DepthProfile {
    /// Forgets its ray: no absorption.
    pub fn clear(&mut self) {
        self.times.clear();
    }

    fn set(&mut self, spin: f64, nodes: &RayNodes<'_>, emission: &Emission, depths: &[f64]) {
        let count = depths.len();
        self.times.clear();
        self.times.extend_from_slice(&nodes.mino_time[..count]);
        self.depths.clear();
        self.depths.extend_from_slice(depths);
        self.rates.clear();
        let places = nodes.radius.iter().zip(nodes.cos_theta).zip(&emission.absorption);
        let rate = |((r, u), k): ((&f64, &f64), &f64)| k * (r * r + (spin * u).powi(2));
        self.rates.extend(places.take(count).map(rate));
    }

    /// The depth in front of the point at a Mino time: cubic between nodes.
    pub fn at(&self, time: f64) -> f64 {
        let k = self.times.partition_point(|t| *t < time);
        let (Some(last), true) = (self.times.len().checked_sub(1), k > 0) else { return 0.0 };
        if k > last {
            return self.total;
        }
        let h = self.times[k] - self.times[k - 1];
        let s = (time - self.times[k - 1]) / h;
        let (d0, d1) = (self.depths[k - 1], self.depths[k]);
        let (m0, m1) = (self.rates[k - 1] * h, self.rates[k] * h);
        let (t2, t3) = (s * s, s * s * s);
        d0 * (2.0 * t3 - 3.0 * t2 + 1.0)
            + m0 * (t3 - 2.0 * t2 + s)
            + d1 * (3.0 * t2 - 2.0 * t3)
            + m1 * (t3 - t2)
    }
}

/// What is summed up along a ray.
struct Along<'a> {
    medium: &'a dyn Medium,
    /// Place of the ray's light at the first time.
    first: usize,
    lambda: f64,
    screen: Option<ScreenPoint>,
    times: &'a [f64],
}

impl PreparedScene {
    /// Light of medium number `m` along all rays of a block that were traced in closed form.
    pub(super) fn fill_block(
        &self,
        m: usize,
        observer: &Observer,
        (alpha, beta): (&[f64], &[f64]),
        times: &[f64],
        scratch: &mut Scratch,
    ) -> Result<(), OutOfRange> {
        let Scratch { traced, hits, nodes, volume, .. } = scratch;
        let mut pending: Vec<usize> = (0..traced.len()).filter(|k| !traced[*k].by_steps).collect();
        let (medium, first) = (&*self.media[m], m * traced.len() * times.len());
        let mut split = 1;
        let together = (TOGETHER / split as usize).clamp(16, TOGETHER);
        while !pending.is_empty() {
            let request = self.request(medium, &volume.quadrature.rule, split);
            let mut more = Vec::new();
            for some in pending.chunks(together) {
                let pick = |column: &[f64]| some.iter().map(|k| column[*k]).collect::<Vec<_>>();
                let until: Vec<f64> = some.iter().map(|k| traced[*k].last_time()).collect();
                let (alpha, beta) = (pick(alpha), pick(beta));
                nodes.trace(&self.hole, observer, &alpha, &beta, Some(&until), &request)?;
                for (number, k) in some.iter().enumerate() {
                    let screen = self.screen_point(alpha[number], beta[number]);
                    let (first, lambda) = (first + k * times.len(), traced[*k].lambda);
                    let along = Along { medium, first, lambda, screen, times };
                    let done = self.radiate(&along, &nodes.ray(number), volume);
                    volume.shade(&mut hits[traced[*k].hits.clone()]);
                    if !done && split < FINEST {
                        more.push(*k);
                    }
                }
            }
            pending = more;
            split *= 2;
        }
        Ok(())
    }

    /// Light of medium number `m` along ray number `k`, which was traced step by step.
    pub(super) fn fill_path(
        &self,
        (m, k): (usize, usize),
        screen: Option<ScreenPoint>,
        times: &[f64],
        scratch: &mut Scratch,
    ) {
        let traced = scratch.traced[k].clone();
        let first = (m * scratch.traced.len() + k) * times.len();
        self.fill_ray((m, k), screen, (times, first), scratch, |split, path, rule, columns| {
            self.place(path, &traced, &*self.media[m], split, rule, columns);
        });
    }

    /// Light of medium number `m` along ray number `k`, whose nodes are put into columns by `place`,
    /// to place `first` of the lights and the following.
    pub(super) fn fill_ray(
        &self,
        (m, k): (usize, usize),
        screen: Option<ScreenPoint>,
        (times, first): (&[f64], usize),
        scratch: &mut Scratch,
        place: impl Fn(u32, &Path, &PanelRule, &mut Columns),
    ) {
        let Scratch { path, traced, hits, volume, .. } = scratch;
        let medium = &*self.media[m];
        let along = Along { medium, first, lambda: traced[k].lambda, screen, times };
        let mut split = 1;
        loop {
            let mut columns = core::mem::take(&mut volume.columns);
            columns.iter_mut().for_each(Vec::clear);
            place(split, path, &volume.quadrature.rule, &mut columns);
            let done = self.radiate(&along, &ray_nodes(&columns, 0..usize::MAX), volume);
            volume.columns = columns;
            if done || split >= finest(medium) {
                break;
            }
            split *= 2;
        }
        volume.shade(&mut hits[traced[k].hits.clone()]);
    }

    fn request(&self, medium: &dyn Medium, rule: &PanelRule, split: u32) -> NodeRequest {
        let polarized =
            Quantities { velocity: self.polarization.is_some(), ..Quantities::default() };
        NodeRequest {
            radius: medium.sphere(),
            rule: rule.clone(),
            split,
            quantities: medium.quantities().or(self.places).or(polarized),
        }
    }

    /// Light along the nodes of a ray at all times; whether they are enough.
    fn radiate(&self, along: &Along<'_>, nodes: &RayNodes<'_>, volume: &mut Workspace) -> bool {
        let Workspace { quadrature, emission, sums, lights, profile, .. } = volume;
        let lights = &mut lights[along.first..along.first + along.times.len()];
        let mut done = true;
        let cell = along.medium.cell_size();
        let (mut resolved, mut finest) = (true, false);
        if let Some(cell) = cell {
            let longest = cell.longest(nodes, quadrature.rule.order());
            resolved = longest <= ROUNDING * cell.size;
            finest = longest <= ROUNDING * CellSize::FINEST * cell.size;
            if !resolved && along.times.len() > 1 {
                // Not worth the light of all times.
                return false;
            }
        }
        let steady = !along.medium.changes();
        for (j, observed) in along.times.iter().enumerate() {
            if steady && j > 0 {
                lights[j] = lights[0];
                continue;
            }
            emission.clear();
            let moment = Moment { observed: *observed, slow_light: self.slow_light };
            along.medium.fill(nodes, along.lambda, moment, emission);
            if let Some(screen) = &along.screen {
                self.polarize(along.medium, nodes, along.lambda, screen, emission);
            }
            let light = integrate(quadrature, nodes, emission, sums);
            let enough = self.tolerance * (light.intensity + FAINT * along.medium.scale());
            done &= resolved && (finest || light.error <= enough);
            lights[j] = light;
        }
        profile.clear();
        if along.medium.absorbs() {
            profile.set(self.hole.spin(), nodes, emission, &sums.depths);
            profile.total = lights.first().map_or(0.0, |light| light.depth);
        }
        done
    }

    /// The nodes of a path: panels between the medium's sphere, the turning point and the end.
    fn place(
        &self,
        path: &Path,
        traced: &TracedRay,
        medium: &dyn Medium,
        split: u32,
        rule: &PanelRule,
        columns: &mut Columns,
    ) {
        let mut intervals = Vec::new();
        path.intervals_within(0.5 * self.hole.horizon(), medium.sphere(), &mut intervals);
        let turning = path.turning_point().map_or(f64::INFINITY, |(time, _)| time);
        let captured = traced.end == End::Captured;
        for [start, end] in intervals {
            let falls = captured && end >= path.mino_total() && traced.last_time() >= end;
            let end = end.min(traced.last_time());
            let middle = turning.clamp(start, end.max(start));
            for [from, to] in [[start, middle], [middle, end]] {
                if to > from {
                    let piece = Piece::new([from, to], path.angular_rate(), split, falls);
                    piece.nodes(rule, |time, step| self.node_of(path, time, step), columns);
                }
            }
        }
    }

    pub(super) fn node_of(&self, path: &Path, time: f64, step: f64) -> [f64; 8] {
        let point = path.at(time);
        let (r, u) = (point.radius(), point.cos_theta());
        let weight = self.hole.sigma(r, u) * step;
        let [w_rate, u_rate] = [point.inverse_radius_rate, point.velocity[2]];
        [r, u, weight, time, point.azimuth, point.delay, w_rate, u_rate]
    }
}

/// Panels may be longer than cells by so much that rounding does not cut them once more.
const ROUNDING: f64 = 1.05;

fn finest(medium: &dyn Medium) -> u32 {
    if medium.cell_size().is_some() { FINEST_OF_CELLS } else { FINEST }
}

/// Columns of nodes, as in [`RayNodes`].
pub(super) type Columns = [Vec<f64>; 8];

/// Some nodes of a ray, or all that there are.
pub(super) fn ray_nodes(columns: &Columns, range: core::ops::Range<usize>) -> RayNodes<'_> {
    let part = |k: usize| -> &[f64] {
        let end = range.end.min(columns[k].len());
        columns[k].get(range.start..end).unwrap_or(&[])
    };
    RayNodes {
        radius: part(0),
        cos_theta: part(1),
        weight: part(2),
        mino_time: part(3),
        azimuth: part(4),
        delay: part(5),
        radial_velocity: part(6),
        polar_velocity: part(7),
        error: 0.0,
    }
}

/// A segment of a ray between the places where its integrand is not smooth.
#[derive(Debug, Clone, Copy)]
pub(super) struct Piece {
    from: f64,
    to: f64,
    panels: usize,
    /// Whether it ends at the horizon.
    falls: bool,
}

/// Longest panel of a path, as an angle.
const LONGEST: f64 = 0.4;

impl Piece {
    /// A piece of a ray that turns at so many radians per unit of its parameter.
    pub fn new([from, to]: [f64; 2], rate: f64, split: u32, falls: bool) -> Self {
        let panels = ((to - from) * rate / LONGEST).ceil().clamp(1.0, 1e4);
        Piece { from, to, panels: (f64::from(split) * panels) as usize, falls }
    }

    /// A piece of one panel.
    pub fn single([from, to]: [f64; 2], falls: bool) -> Self {
        Piece { from, to, panels: 1, falls }
    }

    /// Puts the nodes of all panels into columns: `node` makes a row of a parameter and a step.
    pub fn nodes(
        &self,
        rule: &PanelRule,
        node: impl Fn(f64, f64) -> [f64; 8],
        columns: &mut Columns,
    ) {
        let length = (self.to - self.from) / self.panels as f64;
        for k in 0..self.panels {
            let start = self.from + length * k as f64;
            let falls = self.falls && k + 1 == self.panels;
            for (s, weight) in rule.nodes().iter().zip(rule.weights()) {
                // The pace of `PanelRule` before the horizon.
                let (place, pace) =
                    if falls { (s * (2.0 - s), 2.0 * (1.0 - s)) } else { (*s, 1.0) };
                let row = node(start + length * place, length * weight * pace);
                columns.iter_mut().zip(row).for_each(|(column, x)| column.push(x));
            }
        }
    }
}

impl Workspace {
    /// Room for the light of so many rays at so many times.
    pub fn reset(&mut self, count: usize) {
        self.lights.clear();
        self.lights.resize(count, Light::default());
        self.profile.clear();
    }

    /// The depths of the present ray's profile in front of surfaces.
    fn shade(&self, hits: &mut [Hit]) {
        for hit in hits {
            hit.depth = self.profile.at(hit.mino_time);
        }
    }
}
