//! Points of a traced ray, whichever tracer traced it and whatever kind of number it is made of: with dual numbers
//! every place carries its own derivatives.

use crate::integrate::outcome::Outcome;
use crate::integrate::uncertainty::Uncertainty;
use crate::numbers::quadrature::{equidistant, gauss_legendre};
use crate::numbers::scalar::Elementary;
use crate::rays::length::{self, Length};
use crate::rays::request::{Placement, Request};
use crate::spacetime::kerr::Kerr;
use crate::spacetime::point::PathPoint;

/// A traced ray whose position is known at every Mino time up to its end: the horizon,
/// infinity, or back at a finite observer's radius.
pub(crate) trait Trajectory<T> {
    fn outcome(&self) -> Outcome;
    fn total(&self) -> T;
    fn turning_radius(&self) -> Option<T>;
    fn crossings(&self, found: &mut Vec<T>);
    /// The direction in which it escapes, if that is known.
    fn exit(&self) -> Option<[T; 3]>;
    fn at(&self, mino_time: T) -> PathPoint<T>;
    fn uncertainty(&self, mino_time: T) -> Uncertainty;
    /// Returns the error of crossing number `k`, at `mino_time`.
    fn uncertainty_at_crossing(&self, k: usize, mino_time: T) -> Uncertainty;
    /// The pieces with lo ≤ r ≤ hi.
    fn within(&self, lo: f64, hi: f64, pieces: &mut Vec<[T; 2]>);
}

/// Properties of a ray as a whole.
pub(crate) struct Summary<T> {
    pub outcome: Outcome,
    /// `None` where unresolved.
    pub total: Option<T>,
    pub turning_radius: Option<T>,
    pub crossing_count: u32,
    /// The direction in which it escapes, if wanted; NaN if it does not.
    pub exit: Option<[f64; 3]>,
}

/// Takes what a [`Sampler`] finds: of each ray first its summary, then its crossings, then its
/// samples, then its end.
pub(crate) trait Sink<T> {
    fn summary(&mut self, summary: Summary<T>);
    fn crossing(&mut self, request: &Request, hole: &Kerr<T>, lambda: T, point: &PathPoint<T>);
    /// `weight`: Σ dτ, if it was requested.
    fn sample(
        &mut self,
        request: &Request,
        hole: &Kerr<T>,
        lambda: T,
        point: &PathPoint<T>,
        weight: Option<T>,
    );
    fn end(&mut self, worst: Option<Uncertainty>);
}

/// Takes from rays what is requested.
pub(crate) struct Sampler<'a, T, S> {
    request: &'a Request,
    hole: &'a Kerr<T>,
    at_infinity: [bool; 2],
    rule: &'a [(f64, f64)],
    pub sink: S,
    /// True if the direction in which rays escape is wanted.
    pub exit: bool,
    times: Vec<T>,
    pieces: Vec<[T; 2]>,
    worst: Uncertainty,
}

/// The Gauss–Legendre rule that a request needs: its own, or that of the path length.
pub(crate) fn rule(request: &Request) -> Vec<(f64, f64)> {
    match request.samples {
        Placement::GaussLegendre { points, .. } => gauss_legendre(points),
        Placement::PathLength { .. } => gauss_legendre(length::NODES),
        _ => Vec::new(),
    }
}

/// Returns whether a ray has reached the horizon, where azimuth and delay have no limit, and no error.
fn at_horizon<T: Elementary>(ray: &impl Trajectory<T>, mino_time: T) -> bool {
    ray.outcome() == Outcome::Captured && mino_time.value() >= ray.total().value()
}

/// The direction in which a ray escapes; NaN if it does not.
fn direction<T: Elementary>(ray: &impl Trajectory<T>) -> [f64; 3] {
    ray.exit().map_or([f64::NAN; 3], |direction| direction.map(T::value))
}

/// The first and last of `n` samples equidistant in Mino time, in units of the whole ray's. `at_infinity`: whether the
/// ray starts there, and whether it ends there unless it is captured; at infinity itself there is no finite position.
fn mino_ends(n: usize, at_infinity: [bool; 2], captured: bool) -> (f64, f64) {
    match (at_infinity[0], at_infinity[1] && !captured) {
        (true, false) => (1.0 / n as f64, 1.0),
        (true, true) => (1.0 / (n + 1) as f64, n as f64 / (n + 1) as f64),
        (false, false) => (0.0, 1.0),
        (false, true) => (0.0, (n - 1) as f64 / n as f64),
    }
}

/// The Mino times of samples, in units of the whole ray's.
pub(crate) fn mino_times(
    n: usize,
    at_infinity: [bool; 2],
    captured: bool,
) -> impl Iterator<Item = f64> {
    let (from, to) = mino_ends(n, at_infinity, captured);
    equidistant(from, to, n)
}

impl<'a, T: Elementary, S: Sink<T>> Sampler<'a, T, S> {
    /// `rule` is that of the request; `at_infinity` says of both ends of rays that escape whether they are there.
    pub fn new(
        request: &'a Request,
        hole: &'a Kerr<T>,
        at_infinity: [bool; 2],
        rule: &'a [(f64, f64)],
        sink: S,
    ) -> Self {
        let (times, pieces, worst) = (Vec::new(), Vec::new(), Uncertainty::default());
        Sampler { request, hole, at_infinity, rule, sink, exit: false, times, pieces, worst }
    }

    /// Takes a ray with angular momentum `lambda`.
    pub fn take(&mut self, ray: &impl Trajectory<T>, lambda: T) {
        let outcome = ray.outcome();
        let total = (!outcome.is_unresolved()).then(|| ray.total());
        let mut times = core::mem::take(&mut self.times);
        times.clear();
        ray.crossings(&mut times);
        self.sink.summary(Summary {
            outcome,
            total,
            turning_radius: ray.turning_radius(),
            crossing_count: times.len() as u32,
            exit: self.exit.then(|| direction(ray)),
        });
        self.worst = Uncertainty::default();
        for (k, time) in times.iter().enumerate().take(self.request.crossings) {
            self.sink.crossing(self.request, self.hole, lambda, &ray.at(*time));
            if self.request.uncertainty && !at_horizon(ray, *time) {
                self.worst = self.worst.max(ray.uncertainty_at_crossing(k, *time));
            }
        }
        self.times = times;
        if let Some(total) = total {
            self.samples(ray, lambda, total);
        }
        self.sink.end(self.request.uncertainty.then_some(self.worst));
    }

    fn doubt(&mut self, ray: &impl Trajectory<T>, mino_time: T) {
        if self.request.uncertainty && !at_horizon(ray, mino_time) {
            self.worst = self.worst.max(ray.uncertainty(mino_time));
        }
    }

    /// Adds the sample at a Mino time whose path weight is `weight` of Σ there.
    fn sample(
        &mut self,
        ray: &impl Trajectory<T>,
        lambda: T,
        mino_time: T,
        weight: impl Fn(T) -> T,
    ) {
        let point = ray.at(mino_time);
        let sigma = || self.hole.sigma(point.radius(), point.cos_theta());
        let weight = self.request.weight.then(|| weight(sigma()));
        self.sink.sample(self.request, self.hole, lambda, &point, weight);
        self.doubt(ray, mino_time);
    }

    fn samples(&mut self, ray: &impl Trajectory<T>, lambda: T, total: T) {
        match self.request.samples {
            Placement::None => {}
            Placement::MinoTime(n) => self.by_mino_time(ray, lambda, total, n),
            Placement::PathLength { points, radius } => self.by_length(ray, lambda, points, radius),
            Placement::GaussLegendre { from, to, .. } => {
                let mut pieces = core::mem::take(&mut self.pieces);
                ray.within(from, to, &mut pieces);
                for [start, end] in &pieces {
                    let length = *end - *start;
                    for (x, weight) in self.rule {
                        let time = *start + length * T::constant(*x);
                        let step = length * T::constant(*weight);
                        self.sample(ray, lambda, time, |sigma| step * sigma);
                    }
                }
                self.pieces = pieces;
            }
        }
    }

    fn by_mino_time(&mut self, ray: &impl Trajectory<T>, lambda: T, total: T, n: usize) {
        let captured = ray.outcome() == Outcome::Captured;
        // Each end that is not at infinity counts half.
        let (from, to) = mino_ends(n, self.at_infinity, captured);
        let step = match n {
            // The distance to an end of the ray is that to the next sample, if there were one.
            1 => 1.0 / (1 + usize::from(self.at_infinity == [true; 2] && !captured)) as f64,
            _ => (to - from) / (n - 1) as f64,
        };
        for (k, share) in equidistant(from, to, n).enumerate() {
            let first = k == 0 && !self.at_infinity[0];
            let last = k + 1 == n && (captured || !self.at_infinity[1]);
            let part = if first || last { 0.5 * step } else { step };
            let step = total * T::constant(part);
            self.sample(ray, lambda, total * T::constant(share), |sigma| step * sigma);
        }
    }

    fn by_length(&mut self, ray: &impl Trajectory<T>, lambda: T, n: usize, radius: f64) {
        let mut pieces = core::mem::take(&mut self.pieces);
        ray.within(0.5 * self.hole.horizon().value(), radius, &mut pieces);
        if let (Some([start, _]), Some([_, end])) = (pieces.first(), pieces.last()) {
            self.equal_lengths(ray, lambda, [*start, *end], n);
        }
        self.pieces = pieces;
    }

    fn equal_lengths(
        &mut self,
        ray: &impl Trajectory<T>,
        lambda: T,
        [start, end]: [T; 2],
        n: usize,
    ) {
        let hole = self.hole;
        let length = Length::new([start, end], self.rule, |time| {
            let point = ray.at(time);
            hole.sigma(point.radius(), point.cos_theta())
        });
        let piece = length.total() / T::constant(n as f64);
        for k in 0..n {
            let time = length.find(piece * T::constant(k as f64 + 0.5));
            self.sample(ray, lambda, time, |_| piece);
        }
    }
}
