//! Rays in the affine parameter, with estimates of their errors.

use crate::error::Error;
use crate::integrate::affine::{AffinePath, AffineTracer};
use crate::integrate::outcome::Outcome;
use crate::integrate::uncertainty::Uncertainty;
use crate::rays::request::Request;
use crate::rays::sampling::Trajectory;
use crate::screen::observer::Observer;
use crate::spacetime::kerr::Kerr;
use crate::spacetime::point::PathPoint;

/// A ray in the affine parameter, and the same ray with ten times the tolerance: their
/// difference is the estimate of its error.
pub(crate) struct AffinePair {
    fine: AffinePath,
    coarse: Option<AffinePath>,
}

impl AffinePair {
    pub fn trace(
        hole: &Kerr,
        observer: &Observer,
        [alpha, beta]: [f64; 2],
        tolerance: f64,
        request: &Request,
    ) -> Result<Self, Error> {
        let with =
            |tolerance: f64| AffineTracer::new(tolerance)?.trace(hole, observer, alpha, beta);
        let coarse = request.uncertainty.then(|| with((10.0 * tolerance).min(1e-2)));
        Ok(AffinePair { fine: with(tolerance)?, coarse: coarse.transpose()? })
    }
}

/// Returns the distance between two positions.
fn difference(a: &PathPoint, b: &PathPoint, observer: f64) -> Uncertainty {
    let turn = (a.azimuth - b.azimuth).rem_euclid(core::f64::consts::TAU);
    // Coordinates are rounded where they are largest, at the observer.
    let floor = 16.0 * f64::EPSILON * (1.0 + observer / a.radius());
    Uncertainty {
        radius: (b.inverse_radius / a.inverse_radius - 1.0).abs() + floor,
        theta: (a.theta() - b.theta()).abs() + floor,
        azimuth: turn.min(core::f64::consts::TAU - turn) + floor,
        delay: (a.delay - b.delay).abs() + floor * (a.delay.abs() + a.radius()),
    }
}

/// Largest ratio of the error to the difference from a run at ten times the tolerance, whose own error has
/// the same sign or vanishes by chance: measured (docs/measurements/geodesics.md of the repository).
const AFFINE_CAUTION: f64 = 3.0;

impl AffinePair {
    /// The coarse run, if it came to the same end.
    fn comparable(&self) -> Option<&AffinePath> {
        self.coarse.as_ref().filter(|coarse| coarse.outcome() == self.fine.outcome())
    }

    /// The estimate without a run to compare with: none was requested, or it ended elsewhere.
    fn unknown(&self) -> Uncertainty {
        if self.coarse.is_some() { Uncertainty::UNKNOWN } else { Uncertainty::default() }
    }

    /// The largest difference at equal Mino time over the last two steps of the coarse run: at
    /// one point alone it may vanish by chance, next to a node above all.
    fn worst_up_to(&self, coarse: &AffinePath, mino_time: f64) -> Uncertainty {
        let from = coarse.step_before(mino_time).min(mino_time);
        let places = [0.25, 0.5, 0.75, 1.0].map(|part| from + (mino_time - from) * part);
        let worst = places.into_iter().map(|time| self.at_equal_time(coarse, time));
        worst.fold(Uncertainty::default(), Uncertainty::max)
    }

    fn at_equal_time(&self, coarse: &AffinePath, mino_time: f64) -> Uncertainty {
        let end = coarse.mino_total();
        let (a, b) = (self.fine.at(mino_time), coarse.at(mino_time.min(end)));
        // Back at the observer, where a ray flies out with dr/dτ = r², the ray that ends
        // earlier is as far behind as its time is short.
        let r = a.radius();
        let overrun = (mino_time - end).max(0.0) * r;
        let mut error = difference(&a, &b, self.fine.start_radius());
        error.radius += overrun;
        error.delay += overrun * r;
        error
    }

    /// Returns the Mino time by which an error of θ moves a crossing.
    fn early(&self, theta: f64, mino_time: f64) -> f64 {
        let step = 1e-4 * self.fine.mino_total();
        let [before, after] = [-step, step].map(|step| self.fine.at(mino_time + step).theta());
        let rate = (after - before).abs() / (2.0 * step);
        (theta / rate.max(1e-300)).min(self.fine.mino_total())
    }
}

impl Trajectory<f64> for AffinePair {
    fn outcome(&self) -> Outcome {
        self.fine.outcome()
    }

    fn total(&self) -> f64 {
        self.fine.mino_total()
    }

    fn turning_radius(&self) -> Option<f64> {
        self.fine.closest_approach()
    }

    fn crossings(&self, found: &mut Vec<f64>) {
        found.extend(self.fine.equatorial_crossings());
    }

    fn exit(&self) -> Option<[f64; 3]> {
        None
    }

    fn at(&self, mino_time: f64) -> PathPoint {
        self.fine.at(mino_time)
    }

    fn uncertainty(&self, mino_time: f64) -> Uncertainty {
        match self.comparable() {
            Some(coarse) => self.worst_up_to(coarse, mino_time).rescaled(AFFINE_CAUTION),
            None => self.unknown(),
        }
    }

    fn uncertainty_at_crossing(&self, k: usize, mino_time: f64) -> Uncertainty {
        let other = self.comparable().map(|coarse| (coarse, coarse.equatorial_crossings()));
        let Some((coarse, Some(other))) = other.map(|(c, times)| (c, times.get(k).copied())) else {
            return self.unknown();
        };
        let at_once = self.worst_up_to(coarse, mino_time);
        let radius = self.fine.start_radius();
        let apart = difference(&self.fine.at(mino_time), &coarse.at(other), radius);
        // An error of θ that the two runs do not share moves the crossing too.
        let early = (other - mino_time).abs().max(self.early(at_once.theta, mino_time));
        let moved = |time: f64| {
            let time = time.clamp(0.0, self.fine.mino_total());
            difference(&self.fine.at(mino_time), &self.fine.at(time), radius)
        };
        let moved = moved(mino_time - early).max(moved(mino_time + early));
        at_once.max(apart).max(moved).rescaled(AFFINE_CAUTION)
    }

    fn within(&self, lo: f64, hi: f64, pieces: &mut Vec<[f64; 2]>) {
        self.fine.intervals_within(lo, hi, pieces);
    }
}
