//! A traced ray: what became of it, where its events lie, and its position at any Mino
//! time. Positions come from dense output, so they owe nothing to the stepper's own steps.

use crate::hermite::Quintic;
use crate::kerr::Kerr;
use crate::mino::{FULL, index};
use crate::observer::Ray;

/// What became of a ray followed backward from the observer.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Outcome {
    /// It reaches the outer horizon.
    Captured,
    /// It returns to infinity.
    Escaped,
    /// It was given up.
    Unresolved(Unresolved),
}

/// Why a ray was given up.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Unresolved {
    /// It lies on the critical curve within rounding and circles on a photon orbit.
    PhotonOrbit,
    /// The limit on the number of steps was reached.
    StepLimit,
}

impl Outcome {
    /// The word that tables use.
    pub fn name(self) -> &'static str {
        match self {
            Outcome::Captured => "captured",
            Outcome::Escaped => "escaped",
            Outcome::Unresolved(_) => "unresolved",
        }
    }
}

/// State at the end of a step, with what dense output needs.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Node {
    /// Scaled Mino time bτ.
    pub s: f64,
    pub y: [f64; FULL],
    pub f: [f64; FULL],
    /// Second derivatives of I_φ and I_t/b.
    pub second: [f64; 2],
    /// +1 where the step that starts here goes inwards, −1 where it goes outwards.
    pub leg: f64,
    /// Constants that keep azimuth and time continuous from leg to leg.
    pub constants: [f64; 2],
    /// Unwrapped atan2(y, x).
    pub turned: f64,
}

impl Node {
    /// Value, slope and curvature of a variable that has its own derivative in the state.
    fn end(&self, k: usize) -> [f64; 3] {
        [self.y[k], self.f[k], self.f[k + 1]]
    }

    fn azimuth_end(&self) -> [f64; 3] {
        [self.y[index::AZIMUTH], self.f[index::AZIMUTH], self.second[0]]
    }

    fn time_end(&self) -> [f64; 3] {
        [self.y[FULL - 1], self.f[FULL - 1], self.second[1]]
    }
}

/// A point of a path.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PathPoint {
    /// Mino time since the observer, growing backward in time.
    pub mino_time: f64,
    /// w = 1/r.
    pub inverse_radius: f64,
    /// dw/dτ of the backward ray: positive on the way in.
    pub inverse_radius_rate: f64,
    /// n = (sin θ cos φ, sin θ sin φ, cos θ). Without azimuth: (sin θ, 0, cos θ).
    pub direction: [f64; 3],
    /// dn/dτ of the backward ray less its frame dragging, so that the photon's covariant
    /// momentum on the sphere is p·v = −velocity·v. Zero without azimuth.
    pub velocity: [f64; 3],
    /// Azimuth, unwrapped from the observer on; 0 unless asked for.
    pub azimuth: f64,
    /// How much earlier the photon was here: t_o − t for an observer at finite radius,
    /// lim \[(t_o − t) − r_o − 2 ln r_o\] for one at infinity; 0 unless asked for.
    pub delay: f64,
}

impl PathPoint {
    /// Boyer–Lindquist radius.
    pub fn radius(&self) -> f64 {
        1.0 / self.inverse_radius
    }

    /// cos θ.
    pub fn cos_theta(&self) -> f64 {
        self.direction[2]
    }

    /// Polar angle θ, accurate at the poles.
    pub fn theta(&self) -> f64 {
        self.direction[0].hypot(self.direction[1]).atan2(self.direction[2])
    }

    /// r n: the point in the coordinates in which a = 0 is flat-looking.
    pub fn cartesian(&self) -> [f64; 3] {
        self.direction.map(|x| x / self.inverse_radius)
    }
}

/// A ray traced to its end. Reuse one for many rays: its memory stays.
#[derive(Debug, Clone)]
pub struct Path {
    pub(crate) hole: Kerr,
    pub(crate) nodes: Vec<Node>,
    pub(crate) outcome: Outcome,
    pub(crate) crossings: Vec<f64>,
    pub(crate) turning: Option<f64>,
    pub(crate) turning_w: Option<f64>,
    pub(crate) end: f64,
    pub(crate) scale: f64,
    pub(crate) rotation_sign: f64,
    pub(crate) has_azimuth: bool,
    pub(crate) has_time: bool,
    pub(crate) from_infinity: bool,
    pub(crate) steps: u32,
}

impl Default for Path {
    fn default() -> Self {
        Path::new()
    }
}

impl Path {
    /// An empty path, to be filled by [`Tracer::trace`](crate::Tracer::trace).
    pub fn new() -> Self {
        Path {
            hole: Kerr::new(0.0).expect("0 is a spin"), // constant, in range
            nodes: Vec::new(),
            outcome: Outcome::Unresolved(Unresolved::StepLimit),
            crossings: Vec::new(),
            turning: None,
            turning_w: None,
            end: 0.0,
            scale: 1.0,
            rotation_sign: 1.0,
            has_azimuth: false,
            has_time: false,
            from_infinity: true,
            steps: 0,
        }
    }

    pub(crate) fn reset(&mut self, hole: &Kerr, ray: &Ray, scale: f64) {
        self.hole = *hole;
        self.nodes.clear();
        self.crossings.clear();
        self.turning = None;
        self.turning_w = None;
        self.outcome = Outcome::Unresolved(Unresolved::StepLimit);
        self.end = 0.0;
        self.scale = scale;
        self.rotation_sign = ray.rotation_sign;
        self.from_infinity = ray.inverse_radius == 0.0;
        self.steps = 0;
    }

    /// What became of the ray.
    pub fn outcome(&self) -> Outcome {
        self.outcome
    }

    /// Mino time from the observer to the horizon or back to infinity.
    pub fn mino_total(&self) -> f64 {
        self.end / self.scale
    }

    /// Mino times of the crossings of the equatorial plane outside the horizon, in the
    /// order of the backward ray.
    pub fn equatorial_crossings(&self) -> impl ExactSizeIterator<Item = f64> + '_ {
        self.crossings.iter().map(|s| s / self.scale)
    }

    /// Mino time and radius of the radial turning point, if the ray turned.
    pub fn turning_point(&self) -> Option<(f64, f64)> {
        Some((self.turning? / self.scale, 1.0 / self.turning_w?))
    }

    /// An upper bound of the angle by which the direction changes per Mino time, frame
    /// dragging aside: √max(1, η + λ²) and a little.
    pub fn angular_rate(&self) -> f64 {
        (self.scale * self.scale + 1.0).sqrt()
    }

    /// Number of accepted steps.
    pub fn steps(&self) -> u32 {
        self.steps
    }

    /// The position at Mino time `mino_time` ∈ \[0, [`mino_total`](Self::mino_total)\]
    /// (clamped to it). At the horizon, where azimuth and time diverge logarithmically, it
    /// is that of the last float outside.
    pub fn at(&self, mino_time: f64) -> PathPoint {
        let s = (mino_time * self.scale).clamp(0.0, self.end);
        let k = self.nodes.partition_point(|node| node.s <= s).clamp(1, self.nodes.len() - 1);
        self.interpolate(k - 1, s)
    }

    fn interpolate(&self, k: usize, s: f64) -> PathPoint {
        let (a, b) = (&self.nodes[k], &self.nodes[k + 1]);
        let h = b.s - a.s;
        let x = if h > 0.0 { (s - a.s) / h } else { 0.0 };
        let value = |k: usize| Quintic::new(h, a.end(k), b.end(k));
        let radial = value(index::W);
        let horizon = (1.0 - f64::EPSILON) / self.hole.horizon();
        let w = (radial.value(x) / self.scale).clamp(0.0, horizon);
        let mut point = PathPoint {
            mino_time: s / self.scale,
            inverse_radius: w,
            inverse_radius_rate: radial.slope(x) / h,
            direction: [0.0; 3],
            velocity: [0.0; 3],
            azimuth: 0.0,
            delay: 0.0,
        };
        let u = value(index::U);
        let cos_theta = u.value(x).clamp(-1.0, 1.0);
        if self.has_azimuth {
            let rate = self.scale / h;
            let (px, py) = (value(index::X), value(index::Y));
            let n = [px.value(x), py.value(x), cos_theta];
            let v = [px.slope(x) * rate, py.slope(x) * rate, u.slope(x) * rate];
            let regular = Quintic::new(h, a.azimuth_end(), b.azimuth_end()).value(x);
            let dragged = regular + a.constants[0] + a.leg * self.hole.azimuth_closed_form(w);
            let (sin, cos) = dragged.sin_cos();
            point.direction = rotate(n, sin, cos);
            point.velocity = rotate(v, sin, cos);
            let turned =
                a.turned + turn(self.rotation_sign, [a.y[index::X], a.y[index::Y]], [n[0], n[1]]);
            point.azimuth = turned + dragged;
        } else {
            point.direction = [(1.0 - cos_theta * cos_theta).max(0.0).sqrt(), 0.0, cos_theta];
        }
        if self.has_time {
            let regular = Quintic::new(h, a.time_end(), b.time_end()).value(x) * self.scale;
            point.delay = regular + a.constants[1] - a.leg * self.hole.tortoise(w);
        }
        point
    }

    /// The pieces of the path with lo ≤ r ≤ hi as intervals of Mino time, in order.
    pub fn intervals_within(&self, lo: f64, hi: f64, intervals: &mut Vec<[f64; 2]>) {
        intervals.clear();
        let (outer, inner) = (self.scale / hi, self.scale / lo);
        for k in 0..self.nodes.len().saturating_sub(1) {
            let (a, b) = (&self.nodes[k], &self.nodes[k + 1]);
            let stop = b.s.min(self.end);
            if stop <= a.s {
                continue;
            }
            match self.turning.filter(|t| (a.s..stop).contains(t)) {
                Some(turning) => {
                    self.clip(k, [a.s, turning], [outer, inner], intervals);
                    self.clip(k, [turning, stop], [outer, inner], intervals);
                }
                None => self.clip(k, [a.s, stop], [outer, inner], intervals),
            }
        }
    }

    /// Adds the part of a monotonic piece of step `k` that lies between two (scaled)
    /// inverse radii.
    fn clip(&self, k: usize, span: [f64; 2], band: [f64; 2], intervals: &mut Vec<[f64; 2]>) {
        let (a, b) = (&self.nodes[k], &self.nodes[k + 1]);
        let h = b.s - a.s;
        let radial = Quintic::new(h, a.end(index::W), b.end(index::W));
        let x = span.map(|s| ((s - a.s) / h).clamp(0.0, 1.0));
        let w = x.map(|x| radial.value(x));
        let (least, most) = (w[0].min(w[1]), w[0].max(w[1]));
        if most < band[0] || least > band[1] {
            return;
        }
        let bound = |end: usize| {
            let limit = w[end].clamp(band[0], band[1]);
            let x = if limit == w[end] { x[end] } else { radial.solve(limit, x[0], x[1]) };
            (a.s + h * x) / self.scale
        };
        let piece = [bound(0), bound(1)];
        if piece[1] <= piece[0] {
            return;
        }
        match intervals.last_mut() {
            Some(last) if piece[0] <= last[1] * (1.0 + 1e-14) => last[1] = piece[1],
            _ => intervals.push(piece),
        }
    }
}

fn rotate(v: [f64; 3], sin: f64, cos: f64) -> [f64; 3] {
    [v[0] * cos - v[1] * sin, v[0] * sin + v[1] * cos, v[2]]
}

/// The angle by which a point turns about the axis from `from` to `to` in one step, in the
/// sense of `sign`: a step past a pole turns by up to π and a little, any other by little.
pub(crate) fn turn(sign: f64, from: [f64; 2], to: [f64; 2]) -> f64 {
    use core::f64::consts::{FRAC_PI_2, TAU};
    if from == [0.0, 0.0] {
        // From the axis itself the direction of departure is the starting angle.
        return 0.0;
    }
    let cross = from[0] * to[1] - from[1] * to[0];
    let dot = from[0] * to[0] + from[1] * to[1];
    let angle = sign * cross.atan2(dot);
    sign * if angle < -FRAC_PI_2 { angle + TAU } else { angle }
}
