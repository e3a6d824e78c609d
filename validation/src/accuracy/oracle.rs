//! The answers that traced rays are held against.

use super::rays::Draw;
use kerrlight_geodesic::{
    Double, Error, Kerr, Outcome, Path, PathPoint, Quantities, Uncertainty, trace_series,
};
use std::f64::consts::TAU;

/// Tolerance of the oracle: far below what a double can hold.
const TOLERANCE: f64 = 1e-22;

/// Rays in numbers of twice the precision. Reuse one for many: its memory stays.
#[derive(Debug, Default)]
pub struct Oracle {
    path: Path<Double>,
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

    /// The position at a Mino time.
    pub fn at(&self, mino_time: f64) -> PathPoint<Double> {
        self.path.at(Double::from(mino_time))
    }

    /// Mino times of the crossings of the equatorial plane, with all digits.
    pub fn crossings(&self) -> Vec<Double> {
        self.path.equatorial_crossings().collect()
    }

    /// The position at a Mino time with all its digits.
    pub fn at_exactly(&self, mino_time: Double) -> PathPoint<Double> {
        self.path.at(mino_time)
    }

    /// The errors of a position (r, θ, φ, delay) at a Mino time.
    pub fn judge(&self, mino_time: f64, position: [f64; 4]) -> Uncertainty {
        self.compare(&self.at(mino_time), position)
    }

    /// The errors of a position (r, θ, φ, delay) that should be `truth`; whole turns of φ do not count.
    pub fn compare(
        &self,
        truth: &PathPoint<Double>,
        [r, theta, azimuth, delay]: [f64; 4],
    ) -> Uncertainty {
        let miss = |x: f64, truth: Double| (Double::from(x) - truth).hi;
        let turn = miss(azimuth, truth.azimuth);
        Uncertainty {
            radius: miss(r, truth.radius()).abs() / r,
            theta: miss(theta, truth.theta()).abs(),
            azimuth: (turn - TAU * (turn / TAU).round()).abs(),
            delay: miss(delay, truth.delay).abs(),
        }
    }
}
