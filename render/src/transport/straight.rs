//! Rays without gravity, for comparison: straight lines x = α ê_α + β ê_β + s ô in the coordinates
//! x = r n, that end where they meet the horizon's radius.

use super::ray::Sum;
use super::result::Place;
use super::sources::media::{MediaRay, finest};
use kerrlight_geodesic::nodes::{Leg, Node, NodeColumns};
use kerrlight_geodesic::simd::PanelRule;
use kerrlight_geodesic::{Error, Observer, Outcome, PlaneCrossing, Ray, RayVisitor, TracedRay};

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
        // From infinity the delay is lim (t_o − t) − r_o, that is −s.
        let start = if self.ends[0].is_finite() { self.ends[0] } else { 0.0 };
        let place = Place { radius, azimuth: y.atan2(x) + self.azimuth, delay: start - s };
        (z / radius, place)
    }

    /// The crossing of the equatorial plane.
    fn crossing(&self) -> Option<PlaneCrossing> {
        let s = -self.origin[2] / self.direction[2];
        // Edge-on s is infinite, or NaN within the plane: no crossing.
        let inside = s.is_finite() && s < self.ends[0] && s > self.ends[1];
        let (_, Place { radius, azimuth, delay }) = self.place(s);
        let mino_time = self.parameter(s);
        let (rates, error) = ([0.0; 2], 0.0);
        inside.then_some(PlaneCrossing { mino_time, radius, azimuth, delay, rates, error })
    }

    fn is_captured(&self) -> bool {
        self.ends[1] > 0.0
    }

    /// The direction in which it goes on behind the hole.
    fn exit(&self) -> [f64; 3] {
        let ([x, _, z], (sin, cos)) = (self.direction, self.azimuth.sin_cos());
        [-x * cos, -x * sin, -z]
    }

    /// The legs inside a sphere up to the parameter `until`, either side of the closest approach, and
    /// a bound of the rate at which the ray turns.
    fn legs(&self, sphere: f64, until: f64) -> (Vec<Leg>, f64) {
        if self.impact >= sphere {
            return (Vec::new(), 0.0);
        }
        let reach = ((sphere - self.impact) * (sphere + self.impact)).sqrt();
        let [from, end] =
            [reach.min(self.ends[0]), self.ends[1].max(-reach)].map(|s| self.parameter(s));
        let falls = self.is_captured() && until >= end;
        let (end, middle) = (end.min(until), self.parameter(0.0));
        let middle = middle.clamp(from, end.max(from));
        let legs = [[from, middle], [middle, end]].into_iter().filter(|[from, to]| to > from);
        // r² has its pole at χ = 0.
        (legs.map(|ends| Leg { ends, falls }).collect(), self.impact.max(1.0 / from))
    }

    /// The node at a parameter, for a step of it.
    fn node(&self, parameter: f64, step: f64) -> Node {
        let s = self.distance(parameter);
        let (cos_theta, Place { radius, azimuth, delay }) = self.place(s);
        Node {
            radius,
            cos_theta,
            weight: radius * radius * step,
            mino_time: parameter,
            azimuth,
            delay,
            radial_velocity: s / radius,
            polar_velocity: cos_theta * s - radius * self.direction[2],
        }
    }

    /// Fills `columns` with the nodes inside a sphere.
    fn nodes(
        &self,
        sphere: f64,
        until: f64,
        rule: &PanelRule,
        split: u32,
        columns: &mut NodeColumns,
    ) {
        columns.clear();
        let (legs, rate) = self.legs(sphere, until);
        for leg in legs {
            let node = |parameter, step| self.node(parameter, step);
            leg.place(rule, leg.panels(rate, split), node, columns);
        }
    }

    /// Returns its properties as a whole; `crossing` is that of the plane if it is opaque there.
    fn traced(&self, ray: &Ray, crossings: usize, opaque: Option<&PlaneCrossing>) -> TracedRay {
        let captured = self.is_captured();
        TracedRay {
            lambda: ray.lambda,
            eta: ray.eta,
            outcome: if captured { Outcome::Captured } else { Outcome::Escaped },
            crossing_count: crossings as u32,
            crossings: 0..crossings,
            mino_total: self.parameter(self.ends[1]),
            until: f64::INFINITY,
            surface: opaque.map(|crossing| crossing.mino_time),
            exit: (!captured).then(|| self.exit()),
            stepped: false,
            with_path: false,
        }
    }
}

/// The least impact parameter: through the centre itself χ is no parameter.
const SMALLEST: f64 = 1e-6;

impl Sum<'_> {
    /// Sums up the light along straight rays.
    pub(super) fn along_lines(&mut self, observer: &Observer) -> Result<(), Error> {
        let mut columns = NodeColumns::default();
        for k in 0..self.block.alpha.len() {
            let (alpha, beta) = (self.block.alpha[k], self.block.beta[k]);
            let hole = self.scene.hole();
            let ray = observer.ray(hole, alpha, beta)?;
            let line = Line::new(observer, hole.horizon(), alpha, beta);
            let crossing = line.crossing();
            let opaque = crossing.as_ref().filter(|crossing| self.is_opaque_at(crossing));
            let ray = line.traced(&ray, usize::from(crossing.is_some()), opaque);
            // Crossings of every straight ray are numbered from 0.
            self.sources.media.forget_crossings();
            self.add_media_along(&line, k, &ray, crossing.as_slice(), &mut columns);
            self.take(k, &ray, crossing.as_slice(), None)?;
        }
        Ok(())
    }

    /// Light of all media along straight ray number `k`. What changes has nodes of its own at each
    /// time: no frame depends on another.
    fn add_media_along(
        &mut self,
        line: &Line,
        k: usize,
        ray: &TracedRay,
        crossings: &[PlaneCrossing],
        columns: &mut NodeColumns,
    ) {
        let times = self.block.times;
        for (m, medium) in self.scene.media.iter().enumerate() {
            self.meter.switch(medium.part());
            let together = if medium.changes() { 1 } else { times.len().max(1) };
            for (number, times) in times.chunks(together).enumerate() {
                let mut split = 1;
                loop {
                    let rule = self.sources.media.rule();
                    line.nodes(medium.sphere(), ray.last_time(), rule, split, columns);
                    let done =
                        self.radiate(m, k, (ray, crossings), (times, number * together), columns);
                    if done {
                        break;
                    }
                    if split >= finest(medium) {
                        // Panels that are too long for cells have light at one time alone.
                        let dark = times.len() > 1 && medium.cell_size().is_some();
                        for (n, time) in times.chunks(1).enumerate().filter(|_| dark) {
                            let (rays, place) = ((ray, crossings), number * together + n);
                            self.radiate(m, k, rays, (time, place), columns);
                        }
                        break;
                    }
                    split *= 2;
                }
            }
        }
    }

    fn radiate(
        &mut self,
        m: usize,
        k: usize,
        (ray, crossings): (&TracedRay, &[PlaneCrossing]),
        (times, first): (&[f64], usize),
        columns: &NodeColumns,
    ) -> bool {
        let seen = MediaRay { number: k, ray, crossings, polarized: None, times, cuts: None };
        let nodes = columns.all();
        self.scene.media.radiate(
            m,
            &self.scene.optics,
            &seen,
            first,
            &nodes,
            &mut self.sources.media,
        )
    }
}
