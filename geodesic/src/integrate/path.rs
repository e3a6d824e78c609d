//! A traced ray: what became of it, where its events lie, and its position at any Mino
//! time. Positions come from dense output, so they owe nothing to the stepper's own steps.

use crate::integrate::mino::{has_azimuth, has_time};
use crate::integrate::outcome::{Outcome, Unresolved};
use crate::integrate::series::{Series, rows};
use crate::integrate::uncertainty::{Budget, Uncertainty};
use crate::numbers::polynomial::Polynomial;
use crate::numbers::scalar::Elementary;
use crate::screen::observer::Ray;
use crate::spacetime::kerr::Kerr;
use crate::spacetime::point::PathPoint;

/// A step: a polynomial for each row of [`Series`], and what turns them into a position.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Segment<T> {
    /// Scaled Mino time bτ where it starts: a constant.
    pub s: T,
    /// Its length.
    pub h: f64,
    /// +1 on a step that goes inwards, −1 on one that goes outwards.
    pub leg: f64,
    /// Constants that keep azimuth and time continuous from leg to leg.
    pub constants: [T; 2],
    /// Unwrapped atan2(y, x) where it starts.
    pub turned: T,
    /// Sum of the errors of all steps up to its end.
    pub budget: Budget,
}

/// A ray traced to its end. Reuse one for many rays: its memory stays.
#[derive(Debug, Clone)]
pub struct Path<T = f64> {
    pub(crate) hole: Kerr<T>,
    pub(crate) segments: Vec<Segment<T>>,
    /// Coefficients of all rows of all segments.
    pub(crate) coefficients: Vec<T>,
    /// Rows of a segment.
    pub(crate) rows: usize,
    /// Coefficients of a row.
    pub(crate) width: usize,
    pub(crate) series: Box<Series<T>>,
    pub(crate) outcome: Outcome,
    pub(crate) crossings: Vec<T>,
    pub(crate) turning: Option<T>,
    pub(crate) turning_w: Option<T>,
    pub(crate) end: T,
    pub(crate) scale: f64,
    pub(crate) rotation_sign: f64,
    pub(crate) has_azimuth: bool,
    pub(crate) has_time: bool,
    pub(crate) lambda: f64,
    /// Error budget at the start.
    pub(crate) start: Budget,
}

impl<T: Elementary> Default for Path<T> {
    fn default() -> Self {
        Path::empty()
    }
}

impl Path {
    /// An empty path, to be filled by [`Tracer::trace`](crate::Tracer::trace).
    pub fn new() -> Self {
        Path::empty()
    }
}

impl<T: Elementary> Path<T> {
    /// An empty path for any kind of number, to be filled by
    /// [`trace_series`](crate::trace_series).
    pub fn empty() -> Self {
        let zero = T::constant(0.0);
        Path {
            hole: Kerr::from_spin(zero).expect("0 is a spin"), // constant, in range
            segments: Vec::new(),
            coefficients: Vec::new(),
            rows: 0,
            width: 0,
            series: Box::new(Series::new()),
            outcome: Outcome::Unresolved(Unresolved::StepLimit),
            crossings: Vec::new(),
            turning: None,
            turning_w: None,
            end: zero,
            scale: 1.0,
            rotation_sign: 1.0,
            has_azimuth: false,
            has_time: false,
            lambda: 0.0,
            start: Budget::default(),
        }
    }

    pub(crate) fn reset<const N: usize>(&mut self, hole: &Kerr<T>, ray: &Ray<T>, scale: f64) {
        self.hole = *hole;
        self.segments.clear();
        self.coefficients.clear();
        self.crossings.clear();
        self.turning = None;
        self.turning_w = None;
        self.outcome = Outcome::Unresolved(Unresolved::StepLimit);
        self.end = T::constant(0.0);
        self.scale = scale;
        self.rotation_sign = ray.rotation_sign;
        self.lambda = ray.lambda.value();
        self.has_azimuth = has_azimuth(N);
        self.has_time = has_time(N);
        self.rows = rows(N);
    }

    /// Returns the outcome of the ray.
    pub fn outcome(&self) -> Outcome {
        self.outcome
    }

    /// Mino time from the start to the end of the path: the horizon or infinity, wherever the observer is. Tables and
    /// blocks of rays ([`RayTable`](crate::RayTable), [`TracedRay`](crate::TracedRay)) end a ray where it is back at the
    /// radius of a finite observer.
    pub fn mino_total(&self) -> T {
        self.end / T::constant(self.scale)
    }

    /// Mino times of the crossings of the equatorial plane outside the horizon, in the
    /// order of the backward ray.
    pub fn equatorial_crossings(&self) -> impl ExactSizeIterator<Item = T> + '_ {
        self.crossings.iter().map(|s| *s / T::constant(self.scale))
    }

    /// Mino time and radius of the radial turning point, if the ray turned.
    pub fn turning_point(&self) -> Option<(T, T)> {
        Some((self.turning? / T::constant(self.scale), T::constant(1.0) / self.turning_w?))
    }

    /// An upper bound of the angle by which the direction changes per Mino time, frame
    /// dragging aside: √max(1, η + λ²) and a little.
    pub fn angular_rate(&self) -> f64 {
        (self.scale * self.scale + 1.0).sqrt()
    }

    /// Number of accepted steps.
    pub fn steps(&self) -> u32 {
        self.segments.len() as u32
    }

    /// Row number `row` of segment number `k`.
    pub(crate) fn polynomial(&self, k: usize, row: usize) -> Polynomial<'_, T> {
        let start = (k * self.rows + row) * self.width;
        Polynomial(&self.coefficients[start..start + self.width])
    }

    /// The segment that holds the scaled time `s`, and where in it.
    fn find(&self, s: T) -> (usize, T) {
        let k = self.segments.partition_point(|segment| segment.s.value() <= s.value()).max(1) - 1;
        let segment = &self.segments[k];
        (k, (s - segment.s) / T::constant(segment.h))
    }

    fn clamped(&self, mino_time: T) -> T {
        let s = mino_time * T::constant(self.scale);
        if s.value() <= 0.0 {
            T::constant(0.0)
        } else if s.value() >= self.end.value() {
            self.end
        } else {
            s
        }
    }

    /// The position at Mino time `mino_time` ∈ \[0, [`mino_total`](Self::mino_total)\]
    /// (clamped to it). At the horizon, where azimuth and time diverge logarithmically, it
    /// is that of the last float outside. All NaN on a path without a step: one that has not
    /// been traced, or by a tracer that may make none, or of a photon that [comes from the
    /// horizon](Ray::is_from_horizon).
    pub fn at(&self, mino_time: T) -> PathPoint<T> {
        if self.segments.is_empty() {
            return PathPoint::nowhere();
        }
        let s = self.clamped(mino_time);
        let (k, x) = self.find(s);
        self.interpolate(k, x, s, None)
    }

    /// The position at a Mino time at which w = 1/r is known better than the time, with its estimated errors.
    pub(crate) fn at_inverse_radius(&self, mino_time: T, w: T) -> (PathPoint<T>, Uncertainty) {
        let (point, budget) = self.with_budget(mino_time, Some(w));
        (point, budget.at_inverse_radius(&self.hole, self.lambda, self.scale, &point))
    }

    /// Mino time at which the ray, which has turned, is back at w = 1/r.
    pub(crate) fn time_back_at(&self, w: f64) -> T {
        let w = T::constant(w * self.scale);
        let start = |k: usize| self.polynomial(k, 0).0[0].value();
        let turning = self.turning.map_or(0.0, T::value);
        let after = |k: &usize| self.segments[*k].s.value() > turning && start(*k) >= w.value();
        let last = (0..self.segments.len()).rev().find(after);
        let k = last.unwrap_or(self.find(T::constant(turning)).0);
        let Segment { s, h, .. } = self.segments[k];
        let first = ((turning - s.value()) / h).max(0.0);
        (s + T::constant(h) * self.polynomial(k, 0).solve(w, first, 1.0)) / T::constant(self.scale)
    }

    /// w = 1/r at a Mino time.
    pub(crate) fn inverse_radius_at(&self, mino_time: T) -> f64 {
        let (k, x) = self.find(self.clamped(mino_time));
        self.polynomial(k, 0).value(x).value() / self.scale
    }

    /// The estimated errors of [`at`](Self::at): see [`Uncertainty`]. Infinite on a path without
    /// a step.
    pub fn uncertainty_at(&self, mino_time: T) -> Uncertainty {
        if self.segments.is_empty() {
            return Uncertainty::UNKNOWN;
        }
        let (point, budget) = self.with_budget(mino_time, None);
        budget.at(&self.hole, self.lambda, self.scale, &point)
    }

    /// The estimated errors of [`at`](Self::at) a Mino time of
    /// [`equatorial_crossings`](Self::equatorial_crossings), as those of the crossing itself: its
    /// Mino time has an error of its own, by which the ray goes on. Infinite on a path without a
    /// step.
    pub fn uncertainty_at_crossing(&self, mino_time: T) -> Uncertainty {
        if self.segments.is_empty() {
            return Uncertainty::UNKNOWN;
        }
        let (point, budget) = self.with_budget(mino_time, None);
        budget.at_crossing(&self.hole, self.lambda, self.scale, &point)
    }

    fn with_budget(&self, mino_time: T, known: Option<T>) -> (PathPoint<T>, Budget) {
        let s = self.clamped(mino_time);
        let (k, x) = self.find(s);
        // In the first step little has gone wrong yet at the observer.
        let part = if k == 0 { x.value() } else { 1.0 };
        let budget = self.start.towards(&self.segments[k].budget, part);
        (self.interpolate(k, x, s, known), budget)
    }

    /// The position at `x` in segment `k`, scaled time `s`; `known` is its w, if that is not the segment's.
    fn interpolate(&self, k: usize, x: T, s: T, known: Option<T>) -> PathPoint<T> {
        let segment = &self.segments[k];
        let scale = T::constant(self.scale);
        let rate = T::constant(1.0 / segment.h);
        let radial = self.polynomial(k, 0);
        let horizon = (T::constant(1.0 - f64::EPSILON)) / self.hole.horizon();
        let (value, slope) = radial.both(x);
        let mut w = known.unwrap_or(value / scale);
        if w.value() <= 0.0 {
            w = T::constant(0.0);
        } else if w.value() > horizon.value() {
            w = horizon;
        }
        let zero = T::constant(0.0);
        let mut point = PathPoint {
            mino_time: s / scale,
            inverse_radius: w,
            inverse_radius_rate: slope * rate,
            direction: [zero; 3],
            velocity: [zero; 3],
            azimuth: zero,
            delay: zero,
        };
        let (u, v) = self.polynomial(k, 1).both(x);
        let v = v * rate * scale;
        let leg = T::constant(segment.leg);
        if self.has_azimuth {
            let [px, py] = [2, 3].map(|row| self.polynomial(k, row));
            let ((x1, v1), (y1, v2)) = (px.both(x), py.both(x));
            let n = [x1, y1, u];
            let velocity = [v1 * rate * scale, v2 * rate * scale, v];
            let regular = self.polynomial(k, 4).value(x);
            let dragged = regular + segment.constants[0] + leg * self.hole.azimuth_closed_form(w);
            let (sin, cos) = dragged.sin_cos();
            point.direction = rotate(n, sin, cos);
            point.velocity = rotate(velocity, sin, cos);
            let start = [px.0, py.0].map(|c| [c[0], c[1]]);
            point.azimuth =
                segment.turned + turn(self.rotation_sign, start, [n[0], n[1]]) + dragged;
        } else {
            let unknown = T::constant(f64::NAN);
            point.direction = [unknown, unknown, u];
            point.velocity = [unknown, unknown, v];
        }
        if self.has_time {
            let regular = self.polynomial(k, self.rows - 1).value(x) * scale;
            point.delay = regular + segment.constants[1] - leg * self.hole.tortoise(w);
        }
        point
    }

    /// The pieces of the path with lo ≤ r ≤ hi (M) as intervals of Mino time (M⁻¹), in order; none
    /// unless 0 ≤ lo ≤ hi.
    pub fn intervals_within(&self, lo: f64, hi: f64, intervals: &mut Vec<[T; 2]>) {
        intervals.clear();
        if !(0.0 <= lo && lo <= hi && hi > 0.0) {
            return;
        }
        let band = [self.scale / hi, self.scale / lo];
        for (k, segment) in self.segments.iter().enumerate() {
            let end = T::constant(1.0);
            let whole = self.end - segment.s;
            if whole.value() <= 0.0 {
                continue;
            }
            let h = T::constant(segment.h);
            let stop = if whole.value() < segment.h { whole / h } else { end };
            let start = T::constant(0.0);
            let inside = |t: &T| (0.0..stop.value()).contains(&t.value());
            match self.turning.map(|t| (t - segment.s) / h).filter(inside) {
                Some(turning) => {
                    self.clip(k, [start, turning], band, intervals);
                    self.clip(k, [turning, stop], band, intervals);
                }
                None => self.clip(k, [start, stop], band, intervals),
            }
        }
    }

    /// Adds the part of a monotonic piece of step `k` that lies between two (scaled)
    /// inverse radii.
    fn clip(&self, k: usize, x: [T; 2], band: [f64; 2], intervals: &mut Vec<[T; 2]>) {
        let segment = &self.segments[k];
        let radial = self.polynomial(k, 0);
        let w = x.map(|x| radial.value(x).value());
        let (least, most) = (w[0].min(w[1]), w[0].max(w[1]));
        if most < band[0] || least > band[1] {
            return;
        }
        let bound = |end: usize| {
            let limit = w[end].clamp(band[0], band[1]);
            let outside = limit != w[end];
            let root = || radial.solve(T::constant(limit), x[0].value(), x[1].value());
            let x = if outside { root() } else { x[end] };
            (segment.s + T::constant(segment.h) * x) / T::constant(self.scale)
        };
        let piece = [bound(0), bound(1)];
        if piece[1].value() <= piece[0].value() {
            return;
        }
        match intervals.last_mut() {
            Some(last) if piece[0].value() <= last[1].value() * (1.0 + 1e-14) => last[1] = piece[1],
            _ => intervals.push(piece),
        }
    }
}

fn rotate<T: Elementary>(v: [T; 3], sin: T, cos: T) -> [T; 3] {
    [v[0] * cos - v[1] * sin, v[0] * sin + v[1] * cos, v[2]]
}

/// The angle by which a point turns about the axis in one step from `start` (x and y, each
/// with its rate) to `to`, in the sense of `sign`: a step past a pole turns by up to π and a
/// little, any other by little.
pub(crate) fn turn<T: Elementary>(sign: f64, start: [[T; 2]; 2], to: [T; 2]) -> T {
    use core::f64::consts::FRAC_PI_2;
    let mut from = start.map(|[x, _]| x);
    if from.map(T::value) == [0.0, 0.0] {
        // From the axis itself the direction of departure is the starting angle. Only the
        // derivatives of the angle to it do not vanish: the axis may be left aside.
        from = start.map(|[_, rate]| rate);
        if T::IS_PLAIN || [from, to].iter().any(|v| v.map(T::value) == [0.0, 0.0]) {
            return T::constant(0.0);
        }
    }
    if to.map(T::value) == [0.0, 0.0] {
        // On the axis itself an azimuth has no derivative.
        return T::constant(0.0);
    }
    let cross = from[0] * to[1] - from[1] * to[0];
    let dot = from[0] * to[0] + from[1] * to[1];
    let angle = T::constant(sign) * cross.atan2(dot);
    let full = T::pi() + T::pi();
    T::constant(sign) * if angle.value() < -FRAC_PI_2 { angle + full } else { angle }
}
