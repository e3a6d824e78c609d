//! Traced rays.

use crate::integrate::outcome::Outcome;
use crate::integrate::path::Path;
use crate::screen::observer::Ray;
use crate::spacetime::point::PathPoint;
use core::ops::Range;

/// A crossing of the equatorial plane.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PlaneCrossing {
    /// Mino time since the observer, in 1/M.
    pub mino_time: f64,
    /// Boyer–Lindquist radius, in M.
    pub radius: f64,
    /// Azimuth in radians, continuous along the ray from the observer's on.
    pub azimuth: f64,
    /// t_o − t, in M; lim \[(t_o − t) − r_o − 2 ln r_o\] for an observer at infinity.
    pub delay: f64,
    /// d(1/r)/dτ and d cos θ/dτ; 0 unless requested, or for rays traced step by step.
    pub rates: [f64; 2],
    /// An estimate of its error in closed form, relative in the radius and absolute in the azimuth; 0
    /// for rays traced step by step, whose path knows it.
    pub error: f64,
}

impl From<&PathPoint> for PlaneCrossing {
    fn from(point: &PathPoint) -> Self {
        PlaneCrossing {
            mino_time: point.mino_time,
            radius: point.radius(),
            azimuth: point.azimuth,
            delay: point.delay,
            rates: [point.inverse_radius_rate, point.velocity[2]],
            error: 0.0,
        }
    }
}

/// Properties of a ray as a whole.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct TracedRay {
    /// λ = L/E, in M.
    pub lambda: f64,
    /// η = Q/E², in M²; NaN unless rates are requested or the ray was traced step by step.
    pub eta: f64,
    /// Outcome if no surface ends it.
    pub outcome: Outcome,
    /// Number of crossings of the equatorial plane outside the horizon, along its whole length.
    pub crossing_count: u32,
    /// Range of its own crossings among those of the block.
    pub crossings: Range<usize>,
    /// Mino time of the whole ray, M⁻¹: to the horizon, or back at the radius of an observer; to infinity for one that is
    /// there and for cameras. (A [`Path`] goes on to infinity, and so does its `mino_total`.)
    pub mino_total: f64,
    /// Mino time in M⁻¹ after which no light is taken: see [`BlockRequest::half_orbits`](crate::BlockRequest::half_orbits).
    pub until: f64,
    /// Mino time in M⁻¹ of the first opaque surface, if there is one before `until`.
    pub surface: Option<f64>,
    /// Unit vector of the direction in which it escapes, if it does and that is requested.
    pub exit: Option<[f64; 3]>,
    /// True if it was traced step by step.
    pub stepped: bool,
    /// True if its path is traced beside the closed form.
    pub with_path: bool,
}

impl TracedRay {
    /// Mino time in M⁻¹ of the last light: of the first opaque surface or of the last half-orbit.
    #[inline]
    pub fn last_time(&self) -> f64 {
        self.surface.unwrap_or(f64::INFINITY).min(self.until)
    }
}

/// The path of a ray that was traced step by step, here or on a device.
#[derive(Debug, Clone, Copy)]
pub struct PathOfRay<'a> {
    /// Its constants of motion.
    pub ray: &'a Ray,
    /// Its path, with all quantities.
    pub path: &'a Path,
    /// The tolerance that it was traced with, or the error of the device that traced it if that is larger.
    pub tolerance: f64,
}

/// The samples of one ray that was traced step by step.
#[derive(Debug, Default)]
pub(super) struct SampleColumns {
    pub delay: Vec<f64>,
    pub radius: Vec<f64>,
    pub theta: Vec<f64>,
    pub azimuth: Vec<f64>,
}

impl SampleColumns {
    /// Those of some points.
    pub fn fill(&mut self, points: impl Iterator<Item = PathPoint>) {
        let Self { delay, radius, theta, azimuth } = self;
        [&mut *delay, &mut *radius, &mut *theta, &mut *azimuth].into_iter().for_each(Vec::clear);
        for point in points {
            delay.push(point.delay);
            radius.push(point.radius());
            theta.push(point.theta());
            azimuth.push(point.azimuth);
        }
    }
}
