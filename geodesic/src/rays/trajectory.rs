//! A path in Mino time, as samples are taken from it.

use crate::analytic::ClosedForm;
use crate::integrate::outcome::Outcome;
use crate::integrate::path::Path;
use crate::integrate::uncertainty::Uncertainty;
use crate::numbers::scalar::Elementary;
use crate::rays::sampling::Trajectory;
use crate::screen::observer::Ray;
use crate::screen::view::View;
use crate::spacetime::point::PathPoint;
use crate::spacetime::radial::Barrier;

/// A path in Mino time; that of a finite observer's ray, ended at its radius.
pub(crate) struct MinoPath<'a, T> {
    path: &'a Path<T>,
    pub ray: &'a Ray<T>,
    total: T,
    /// True if it ends where it is back at the observer's radius.
    returns: bool,
    /// w = 1/r at the end, where the Mino time does not tell.
    end: Option<T>,
}

/// The relative error of w up to which a ray is back at the observer after twice the time to its turning point.
const CLOSE: f64 = 1e-6;

/// The relative distance from a photon orbit, in w, from which on steps lose more of the time than the closed form.
const LOST: f64 = 1e-8;

impl<'a, T: Elementary> MinoPath<'a, T> {
    /// The path of a camera's ray: to infinity, or to the horizon.
    pub fn whole(path: &'a Path<T>, ray: &'a Ray<T>) -> Self {
        MinoPath { path, ray, total: path.mino_total(), returns: false, end: None }
    }

    /// The path of `ray`, which arrives at a point of `view`, and whether its ends are at infinity if it escapes.
    pub fn seen_by(view: &View, path: &'a Path<T>, ray: &'a Ray<T>) -> (Self, [bool; 2]) {
        match view {
            View::Screen(observer) => (Self::new(path, ray), [observer.is_at_infinity(); 2]),
            View::Camera(_) => (Self::whole(path, ray), [false, true]),
        }
    }

    /// The path of an observer's ray.
    pub fn new(path: &'a Path<T>, ray: &'a Ray<T>) -> Self {
        let w = ray.inverse_radius;
        // A ray that starts inwards is back where it started after twice the time to its turning point.
        let turning = path.turning_point().filter(|_| w > 0.0 && ray.inward);
        let Some((turning, _)) = turning else {
            return Self::whole(path, ray);
        };
        let twice = turning + turning;
        if (path.inverse_radius_at(twice) / w - 1.0).abs() <= CLOSE {
            return MinoPath { path, ray, total: twice, returns: true, end: None };
        }
        // Unless that time is lost next to the critical curve, or the way out to a far observer takes less
        // time than the turning point is known to: where the path itself is back.
        MinoPath {
            path,
            ray,
            total: path.time_back_at(w),
            returns: true,
            end: Some(T::constant(w)),
        }
    }

    /// w, if the ray is at its end and that is not known from the time.
    fn end_at(&self, mino_time: T) -> Option<T> {
        self.end.filter(|_| mino_time.value() >= self.total.value())
    }
}

impl MinoPath<'_, f64> {
    /// The same with the whole time from the closed form where steps lose it: at a distance of few roundings from a photon
    /// orbit, as next to the horizon of an extremal hole.
    pub fn timed(mut self) -> Self {
        let is_lost = |barrier: &Barrier| barrier.width() <= LOST * barrier.w;
        let barrier = self.ray.potential.barrier.as_ref();
        if barrier.is_some_and(is_lost) && !self.outcome().is_unresolved() {
            let form = ClosedForm::new(&self.path.hole, self.ray);
            let total = if self.returns { form.time_back() } else { form.mino_total() };
            // Beyond the end of the path there is no position.
            self.total = if total < self.total { total } else { self.total };
            self.end = self.end.or(self.returns.then_some(self.ray.inverse_radius));
        }
        self
    }
}

impl<T: Elementary> Trajectory<T> for MinoPath<'_, T> {
    fn outcome(&self) -> Outcome {
        self.path.outcome()
    }

    fn total(&self) -> T {
        self.total
    }

    fn turning_radius(&self) -> Option<T> {
        self.path.turning_point().map(|(_, r)| r)
    }

    fn crossings(&self, found: &mut Vec<T>) {
        let total = self.total();
        found.extend(self.path.equatorial_crossings().filter(|time| time.value() <= total.value()));
    }

    fn exit(&self) -> Option<[T; 3]> {
        let escapes = self.path.outcome() == Outcome::Escaped;
        escapes.then(|| self.path.at(self.path.mino_total()).direction)
    }

    fn at(&self, mino_time: T) -> PathPoint<T> {
        match self.end_at(mino_time) {
            Some(w) => self.path.at_inverse_radius(mino_time, w).0,
            None => self.path.at(mino_time),
        }
    }

    fn uncertainty(&self, mino_time: T) -> Uncertainty {
        match self.end_at(mino_time) {
            Some(w) => self.path.at_inverse_radius(mino_time, w).1,
            None => self.path.uncertainty_at(mino_time),
        }
    }

    fn uncertainty_at_crossing(&self, _: usize, mino_time: T) -> Uncertainty {
        self.path.uncertainty_at_crossing(mino_time)
    }

    fn within(&self, lo: f64, hi: f64, pieces: &mut Vec<[T; 2]>) {
        self.path.intervals_within(lo, hi, pieces);
        let total = self.total();
        for piece in pieces.iter_mut() {
            if piece[1].value() > total.value() {
                piece[1] = total;
            }
        }
        pieces.retain(|[start, end]| start.value() < end.value());
    }
}
