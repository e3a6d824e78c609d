//! The answers that traced rays are held against.

use super::rays::Draw;
use kerrlight_geodesic::{Double, Error, Kerr, Outcome, Path, PathPoint, Quantities, trace_series};
use std::f64::consts::TAU;

/// Tolerance of the oracle: far below what a double can hold.
const TOLERANCE: f64 = 1e-22;

/// Rays in numbers of twice the precision. Reuse one for many: its memory stays.
#[derive(Debug, Default)]
pub struct Oracle {
    path: Path<Double>,
}

/// True errors of a position.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct TrueError {
    /// Error of the radius, relative.
    pub radius: f64,
    /// Error of the polar angle, in radians.
    pub theta: f64,
    /// Error of the azimuth, in radians; whole turns do not count.
    pub azimuth: f64,
    /// Error of the delay, in M.
    pub delay: f64,
}

impl TrueError {
    /// The larger of both in every component.
    pub fn max(self, o: Self) -> Self {
        TrueError {
            radius: self.radius.max(o.radius),
            theta: self.theta.max(o.theta),
            azimuth: self.azimuth.max(o.azimuth),
            delay: self.delay.max(o.delay),
        }
    }

    /// The largest of the errors of r (relative), θ and φ.
    pub fn position(&self) -> f64 {
        self.radius.max(self.theta).max(self.azimuth)
    }
}

impl Oracle {
    /// Traces the ray; the doubles of the draw count as exact.
    ///
    /// # Errors
    /// If a value is out of its range.
    pub fn trace(&mut self, ray: &Draw) -> Result<(), Error> {
        let hole = Kerr::from_spin(Double::from(ray.spin))?;
        let observer = ray.observer()?.widen();
        let ray = observer.ray(&hole, Double::from(ray.alpha), Double::from(ray.beta))?;
        trace_series(TOLERANCE, &hole, &ray, Quantities::ALL, &mut self.path)
    }

    /// Returns the outcome of the ray.
    pub fn outcome(&self) -> Outcome {
        self.path.outcome()
    }

    /// Mino times of the crossings of the equatorial plane.
    pub fn crossings(&self) -> Vec<f64> {
        self.path.equatorial_crossings().map(|time| time.hi).collect()
    }

    /// Mino time of the end.
    pub fn mino_total(&self) -> f64 {
        self.path.mino_total().hi
    }

    /// The position at a Mino time.
    pub fn at(&self, mino_time: f64) -> PathPoint<Double> {
        self.path.at(Double::from(mino_time))
    }

    /// Mino times of the crossings of the equatorial plane, with all digits.
    pub fn exact_crossings(&self) -> Vec<Double> {
        self.path.equatorial_crossings().collect()
    }

    /// The position at a Mino time with all its digits.
    pub fn at_exactly(&self, mino_time: Double) -> PathPoint<Double> {
        self.path.at(mino_time)
    }

    /// The errors of a position (r, θ, φ, delay) at a Mino time.
    pub fn judge(&self, mino_time: f64, position: [f64; 4]) -> TrueError {
        self.compare(&self.at(mino_time), position)
    }

    /// The errors of a position (r, θ, φ, delay) that should be `truth`.
    pub fn compare(
        &self,
        truth: &PathPoint<Double>,
        [r, theta, azimuth, delay]: [f64; 4],
    ) -> TrueError {
        let miss = |x: f64, truth: Double| (Double::from(x) - truth).hi;
        let turn = miss(azimuth, truth.azimuth);
        TrueError {
            radius: miss(r, truth.radius()).abs() / r,
            theta: miss(theta, truth.theta()).abs(),
            azimuth: (turn - TAU * (turn / TAU).round()).abs(),
            delay: miss(delay, truth.delay).abs(),
        }
    }
}
