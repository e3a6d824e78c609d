//! The answers that traced rays are held against.

use super::rays::Draw;
use kerrlight_geodesic::{
    Double, Error, Kerr, Outcome, Path, PathPoint, Points, Quantities, Uncertainty, trace_series,
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
    pub fn at(&self, mino_time: impl Into<Double>) -> PathPoint<Double> {
        self.path.at(mino_time.into())
    }

    /// Mino times of the crossings of the equatorial plane, with all digits.
    pub fn crossings(&self) -> Vec<Double> {
        self.path.equatorial_crossings().collect()
    }

    /// The errors of the k-th point at its Mino time.
    pub fn judge(&self, points: &Points, k: usize) -> Uncertainty {
        self.compare(points.mino_time[k], points, k)
    }

    /// The errors of the k-th point, which should be that at a Mino time; whole turns of φ do not count.
    pub fn compare(&self, mino_time: impl Into<Double>, points: &Points, k: usize) -> Uncertainty {
        let truth = self.at(mino_time);
        let miss = |x: f64, truth: Double| (Double::from(x) - truth).hi;
        let turn = miss(points.azimuth[k], truth.azimuth);
        Uncertainty {
            radius: miss(points.radius[k], truth.radius()).abs() / points.radius[k],
            theta: miss(points.theta[k], truth.theta()).abs(),
            azimuth: (turn - TAU * (turn / TAU).round()).abs(),
            delay: miss(points.delay[k], truth.delay).abs(),
        }
    }
}
