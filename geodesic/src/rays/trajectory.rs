//! A path in Mino time, as samples are taken from it.

use crate::integrate::outcome::Outcome;
use crate::integrate::path::Path;
use crate::integrate::uncertainty::Uncertainty;
use crate::numbers::scalar::Elementary;
use crate::rays::sampling::Trajectory;
use crate::screen::observer::Ray;
use crate::spacetime::point::PathPoint;

/// A path in Mino time, ended at the radius of a finite observer.
pub(crate) struct MinoPath<'a, T> {
    pub path: &'a Path<T>,
    pub ray: &'a Ray<T>,
}

impl<T: Elementary> Trajectory<T> for MinoPath<'_, T> {
    fn outcome(&self) -> Outcome {
        self.path.outcome()
    }

    fn total(&self) -> T {
        match self.path.turning_point() {
            // A ray that starts inwards is back where it started after twice the time.
            Some((turning, _)) if self.ray.inverse_radius > 0.0 && self.ray.inward => {
                turning + turning
            }
            _ => self.path.mino_total(),
        }
    }

    fn turning_radius(&self) -> Option<T> {
        self.path.turning_point().map(|(_, r)| r)
    }

    fn crossings(&self, found: &mut Vec<T>) {
        let total = self.total();
        found.extend(self.path.equatorial_crossings().filter(|time| time.value() <= total.value()));
    }

    fn at(&self, mino_time: T) -> PathPoint<T> {
        self.path.at(mino_time)
    }

    fn uncertainty(&self, mino_time: T) -> Uncertainty {
        self.path.uncertainty_at(mino_time)
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
