//! Where the points of a traced ray lie, whichever tracer traced it.

use crate::columns::{Bundle, Points};
use crate::kerr::Kerr;
use crate::path::{Outcome, PathPoint};
use crate::quadrature::{equidistant, gauss_legendre};
use crate::request::{Placement, Request};
use crate::uncertainty::Uncertainty;

/// A traced ray whose position is known at every Mino time up to its end: the horizon,
/// infinity, or back at a finite observer's radius.
pub(crate) trait Trajectory {
    fn outcome(&self) -> Outcome;
    fn total(&self) -> f64;
    fn turning_radius(&self) -> Option<f64>;
    fn crossings(&self, found: &mut Vec<f64>);
    fn at(&self, mino_time: f64) -> PathPoint;
    fn uncertainty(&self, mino_time: f64) -> Uncertainty;
    /// The pieces with lo ≤ r ≤ hi.
    fn within(&self, lo: f64, hi: f64, pieces: &mut Vec<[f64; 2]>);
}

/// Takes from rays what is requested.
pub(crate) struct Sampler<'a> {
    request: &'a Request,
    hole: &'a Kerr,
    at_infinity: bool,
    /// The Gauss–Legendre rule of the request, or that of the path length.
    rule: Vec<(f64, f64)>,
    pub bundle: Bundle,
    times: Vec<f64>,
    pieces: Vec<[f64; 2]>,
}

/// Nodes of the rule that measures path length on each of [`PARTS`] parts of a ray.
const LENGTH_RULE: usize = 12;
/// Parts of a ray whose lengths are measured by one rule each.
const PARTS: usize = 16;

impl<'a> Sampler<'a> {
    pub fn new(request: &'a Request, hole: &'a Kerr, at_infinity: bool) -> Self {
        let rule = match request.samples {
            Placement::GaussLegendre { points, .. } => gauss_legendre(points),
            Placement::PathLength { .. } => gauss_legendre(LENGTH_RULE),
            _ => Vec::new(),
        };
        let (bundle, times, pieces) = (Bundle::default(), Vec::new(), Vec::new());
        Sampler { request, hole, at_infinity, rule, bundle, times, pieces }
    }

    /// Takes a ray with angular momentum `lambda`.
    pub fn take(&mut self, ray: &impl Trajectory, lambda: f64) {
        let outcome = ray.outcome();
        let resolved = !matches!(outcome, Outcome::Unresolved(_));
        let total = ray.total();
        self.times.clear();
        ray.crossings(&mut self.times);
        let bundle = &mut self.bundle;
        bundle.outcome.push(outcome);
        bundle.mino_total.push(if resolved { total } else { f64::NAN });
        bundle.turning_radius.push(ray.turning_radius().unwrap_or(f64::NAN));
        bundle.crossing_count.push(self.times.len() as u32);
        self.times.truncate(self.request.crossings);
        let mut worst = Uncertainty::default();
        for k in 0..self.times.len() {
            self.push(ray, lambda, self.times[k], None, &mut worst);
        }
        self.bundle.crossings.end_ray();
        if resolved {
            self.samples(ray, lambda, total, &mut worst);
        }
        self.bundle.samples.end_ray();
        if self.request.uncertainty {
            self.bundle.uncertainty.push(worst);
        }
    }

    /// Adds the point at a Mino time: a sample if it has a weight dτ, else a crossing.
    fn push(
        &mut self,
        ray: &impl Trajectory,
        lambda: f64,
        mino_time: f64,
        weight: Option<f64>,
        worst: &mut Uncertainty,
    ) {
        let point = ray.at(mino_time);
        let points: &mut Points = match weight {
            Some(_) => &mut self.bundle.samples,
            None => &mut self.bundle.crossings,
        };
        points.push(self.request, self.hole, lambda, &point);
        if let Some(weight) = weight.filter(|_| self.request.weight) {
            points.weight.push(weight * self.hole.sigma(point.radius(), point.cos_theta()));
        }
        if self.request.uncertainty {
            *worst = worst.max(ray.uncertainty(mino_time));
        }
    }

    fn samples(&mut self, ray: &impl Trajectory, lambda: f64, total: f64, worst: &mut Uncertainty) {
        match self.request.samples {
            Placement::None => {}
            Placement::MinoTime(n) => self.by_mino_time(ray, lambda, total, n, worst),
            Placement::PathLength { points, radius } => {
                self.by_length(ray, lambda, points, radius, worst)
            }
            Placement::GaussLegendre { from, to, .. } => {
                let mut pieces = core::mem::take(&mut self.pieces);
                ray.within(from, to, &mut pieces);
                for [start, end] in &pieces {
                    for k in 0..self.rule.len() {
                        let (x, weight) = self.rule[k];
                        let (time, length) = (start + (end - start) * x, end - start);
                        self.push(ray, lambda, time, Some(weight * length), worst);
                    }
                }
                self.pieces = pieces;
            }
        }
    }

    fn by_mino_time(
        &mut self,
        ray: &impl Trajectory,
        lambda: f64,
        total: f64,
        n: usize,
        worst: &mut Uncertainty,
    ) {
        let captured = ray.outcome() == Outcome::Captured;
        // At infinity the ends have no finite position; each other end counts half.
        let (from, to) = match (self.at_infinity, captured) {
            (true, true) => (total / n as f64, total),
            (true, false) => {
                let step = total / (n + 1) as f64;
                (step, total - step)
            }
            (false, _) => (0.0, total),
        };
        let step = if n > 1 { (to - from) / (n - 1) as f64 } else { to - from };
        for (k, time) in equidistant(from, to, n).enumerate() {
            let first = k == 0 && !self.at_infinity;
            let last = k + 1 == n && (captured || !self.at_infinity);
            let share = if first || last { 0.5 } else { 1.0 };
            self.push(ray, lambda, time, Some(share * step), worst);
        }
    }

    fn by_length(
        &mut self,
        ray: &impl Trajectory,
        lambda: f64,
        n: usize,
        radius: f64,
        worst: &mut Uncertainty,
    ) {
        let mut pieces = core::mem::take(&mut self.pieces);
        ray.within(0.5 * self.hole.horizon(), radius, &mut pieces);
        if let (Some([start, _]), Some([_, end])) = (pieces.first(), pieces.last()) {
            self.equal_lengths(ray, lambda, [*start, *end], n, worst);
        }
        self.pieces = pieces;
    }

    fn equal_lengths(
        &mut self,
        ray: &impl Trajectory,
        lambda: f64,
        [start, end]: [f64; 2],
        n: usize,
        worst: &mut Uncertainty,
    ) {
        let hole = self.hole;
        let density = |time: f64| {
            let point = ray.at(time);
            hole.sigma(point.radius(), point.cos_theta())
        };
        let rule = core::mem::take(&mut self.rule);
        let length = |from: f64, to: f64| -> f64 {
            rule.iter().map(|(x, w)| w * (to - from) * density(from + (to - from) * x)).sum()
        };
        let part = (end - start) / PARTS as f64;
        let edge = |k: usize| start + part * k as f64;
        let mut so_far = [0.0; PARTS + 1];
        for k in 0..PARTS {
            so_far[k + 1] = so_far[k] + length(edge(k), edge(k + 1));
        }
        let piece = so_far[PARTS] / n as f64;
        for k in 0..n {
            let target = piece * (k as f64 + 0.5);
            let at = so_far[1..PARTS].partition_point(|s| *s <= target);
            // Newton's method from a linear guess; the length grows monotonically.
            let share = (target - so_far[at]) / (so_far[at + 1] - so_far[at]);
            let mut time = edge(at) + part * share;
            for _ in 0..6 {
                let miss = target - so_far[at] - length(edge(at), time);
                let step = miss / density(time);
                time = (time + step).clamp(edge(at), edge(at + 1));
                if step.abs() < 1e-15 * end {
                    break;
                }
            }
            let weight = piece / density(time);
            self.push(ray, lambda, time, Some(weight), worst);
        }
        self.rule = rule;
    }
}
