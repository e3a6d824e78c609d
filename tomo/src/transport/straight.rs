//! Rays without gravity, for comparison: straight lines x = α ê_α + β ê_β + s ô in the coordinates
//! x = r n, that end where they meet the horizon's radius.

use super::rays::{End, TracedRay};
use super::result::Place;
use super::surface::Hit;
use super::volume::{Columns, Piece};
use super::{PreparedScene, Scratch};
use kerrlight_geodesic::simd::PanelRule;
use kerrlight_geodesic::{Observer, Ray};

/// A straight ray. Its parameter χ takes the place of Mino time: dχ = −ds/r², so that χ times the
/// impact parameter is the angle by which it has turned about the hole.
pub(super) struct Line {
    origin: [f64; 3],
    direction: [f64; 3],
    /// Impact parameter.
    impact: f64,
    /// s at the observer and where the ray ends.
    ends: [f64; 2],
    azimuth: f64,
}

impl Line {
    /// The ray that arrives at (α, β), around a hole with a horizon at `horizon`.
    pub fn new(observer: &Observer, horizon: f64, alpha: f64, beta: f64) -> Self {
        let (sin, cos) = (observer.inclination().sin(), observer.inclination().cos());
        // In the observer's meridian.
        let (right, up) = ([0.0, 1.0, 0.0], [-cos, 0.0, sin]);
        let impact = alpha.hypot(beta);
        let start = 1.0 / observer.inverse_radius();
        let far = ((start - impact) * (start + impact)).max(0.0).sqrt();
        let near = ((horizon - impact) * (horizon + impact)).max(0.0).sqrt();
        Line {
            origin: core::array::from_fn(|k| alpha * right[k] + beta * up[k]),
            direction: [sin, 0.0, cos],
            impact: impact.max(SMALLEST),
            ends: [far, if impact < horizon { near } else { -far }],
            azimuth: observer.azimuth(),
        }
    }

    /// χ at s.
    fn parameter(&self, s: f64) -> f64 {
        self.impact.atan2(s) / self.impact
    }

    /// s at χ.
    fn distance(&self, parameter: f64) -> f64 {
        self.impact / (self.impact * parameter).tan()
    }

    fn at(&self, s: f64) -> [f64; 3] {
        core::array::from_fn(|k| self.origin[k] + s * self.direction[k])
    }

    /// r, cos θ, azimuth and delay at s.
    fn place(&self, s: f64) -> (f64, Place) {
        let [x, y, z] = self.at(s);
        let radius = x.hypot(y).hypot(z);
        let start = if self.ends[0].is_finite() { self.ends[0] } else { 0.0 };
        let place = Place { radius, azimuth: y.atan2(x) + self.azimuth, delay: start - s };
        (z / radius, place)
    }

    /// The crossing of the equatorial plane.
    fn hit(&self) -> Option<Hit> {
        let s = -self.origin[2] / self.direction[2];
        let inside = s.is_finite() && s < self.ends[0] && s > self.ends[1];
        let (_, place) = self.place(s);
        inside.then(|| Hit { mino_time: self.parameter(s), place, rates: [0.0; 2], depth: 0.0 })
    }

    fn is_captured(&self) -> bool {
        self.ends[1] > 0.0
    }

    /// The direction in which it goes on behind the hole.
    fn exit(&self) -> [f64; 3] {
        let ([x, _, z], (sin, cos)) = (self.direction, self.azimuth.sin_cos());
        [-x * cos, -x * sin, -z]
    }

    /// The pieces inside a sphere up to the parameter `until`, either side of the closest approach.
    fn pieces(&self, sphere: f64, until: f64, split: u32) -> Vec<Piece> {
        if self.impact >= sphere {
            return Vec::new();
        }
        let reach = ((sphere - self.impact) * (sphere + self.impact)).sqrt();
        let [from, end] =
            [reach.min(self.ends[0]), self.ends[1].max(-reach)].map(|s| self.parameter(s));
        let falls = self.is_captured() && until >= end;
        let (end, middle) = (end.min(until), self.parameter(0.0));
        let middle = middle.clamp(from, end.max(from));
        let legs = [[from, middle], [middle, end]].into_iter().filter(|[from, to]| to > from);
        // r² has its pole at χ = 0.
        let rate = self.impact.max(1.0 / from);
        legs.map(|[from, to]| Piece::new([from, to], rate, split, falls)).collect()
    }

    /// Nodes of the quadrature.
    pub fn nodes(&self, rule: &PanelRule, pieces: &[Piece], columns: &mut Columns) {
        for piece in pieces {
            piece.nodes(
                rule,
                |parameter, step| {
                    let s = self.distance(parameter);
                    let (u, place) = self.place(s);
                    let Place { radius: r, azimuth, delay } = place;
                    let rates = [s / r, u * s - r * self.direction[2]];
                    [r, u, r * r * step, parameter, azimuth, delay, rates[0], rates[1]]
                },
                columns,
            );
        }
    }
}

/// The least impact parameter: through the centre itself χ is no parameter.
const SMALLEST: f64 = 1e-6;

impl PreparedScene {
    /// A straight ray, traced, along a straight ray.
    pub(super) fn trace_line(&self, line: &Line, ray: &Ray, scratch: &mut Scratch) -> TracedRay {
        let first = scratch.hits.len();
        scratch.hits.extend(line.hit());
        let end = if line.is_captured() { End::Captured } else { End::Escaped };
        let hits = first..scratch.hits.len();
        TracedRay {
            lambda: ray.lambda,
            eta: ray.eta,
            end,
            crossings: hits.len() as u32,
            total: line.parameter(line.ends[1]),
            until: f64::INFINITY,
            surface: self.surface(scratch.hits[hits.clone()].iter().copied(), f64::INFINITY),
            hits,
            exit: Some(line.exit()).filter(|_| end == End::Escaped),
            by_steps: false,
        }
    }

    /// Light of all media along straight ray number `k`.
    pub(super) fn fill_line(&self, line: &Line, k: usize, times: &[f64], scratch: &mut Scratch) {
        let until = scratch.traced[k].last_time();
        for (m, medium) in self.media.iter().enumerate() {
            let first = (m * scratch.traced.len() + k) * times.len();
            // What changes has nodes of its own at each time: no frame depends on another.
            let together = if medium.changes() { 1 } else { times.len().max(1) };
            for (number, times) in times.chunks(together).enumerate() {
                let times = (times, first + number * together);
                self.fill_ray((m, k), None, times, scratch, |split, _, rule, columns| {
                    let pieces = line.pieces(medium.sphere(), until, split);
                    line.nodes(rule, &pieces, columns);
                });
            }
        }
    }
}
