//! Error estimates of a path.
//!
//! The radial motion obeys dw/dτ = ±√W, and every step is put back on it, so that an error of
//! w is an error of phase: the ray is where it should have been a little earlier or later.
//! Phase errors add up step by step and are carried on unchanged, through the turning point
//! and past a photon orbit, where √W is small and a given error of w is a large one of phase.
//! The direction on the sphere oscillates about the plane of the orbit; its errors add up as
//! they are. Azimuth and time are quadratures: their own errors add up, and they follow the
//! radial phase.

use crate::numbers::scalar::Elementary;
use crate::spacetime::kerr::Kerr;
use crate::spacetime::point::PathPoint;
use core::f64::consts::SQRT_2;

/// Estimated errors of a position: each bounds the true one for at least 99 % of rays, and is
/// usually a few times larger (docs/measurements/geodesics.md of the repository has the figures).
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Uncertainty {
    /// Error of the radius, relative.
    pub radius: f64,
    /// Error of the polar angle θ, in radians.
    pub theta: f64,
    /// Error of the azimuth, in radians.
    pub azimuth: f64,
    /// Error of the delay, in units of M.
    pub delay: f64,
}

impl Uncertainty {
    /// Nothing is known.
    pub(crate) const UNKNOWN: Uncertainty = Uncertainty {
        radius: f64::INFINITY,
        theta: f64::INFINITY,
        azimuth: f64::INFINITY,
        delay: f64::INFINITY,
    };

    /// `factor` times as large, and no larger than what knowing nothing means: an azimuth is
    /// within half a turn; a relative error of 1/r of 1 or more leaves r and the delay unknown.
    #[cfg(feature = "affine")]
    pub(crate) fn rescaled(self, factor: f64) -> Self {
        let relative = factor * self.radius;
        let lost = if relative < 1.0 { factor / (1.0 - relative) } else { f64::INFINITY };
        let turn = core::f64::consts::PI;
        Uncertainty {
            radius: self.radius * lost,
            theta: (factor * self.theta).min(turn),
            azimuth: if factor * self.azimuth < 1.0 { factor * self.azimuth } else { turn },
            delay: self.delay * lost,
        }
    }

    /// The larger of both in every component; NaN where one of them is.
    pub fn max(self, o: Self) -> Self {
        Uncertainty {
            radius: larger(self.radius, o.radius),
            theta: larger(self.theta, o.theta),
            azimuth: larger(self.azimuth, o.azimuth),
            delay: larger(self.delay, o.delay),
        }
    }
}

/// The larger of two errors; NaN where one of them is: `f64::max` would take the other, and an error that nobody could compute is
/// not a small one.
pub(crate) fn larger(a: f64, b: f64) -> f64 {
    if a > b || a.is_nan() { a } else { b }
}

/// The errors that the steps of a path have made so far, in scaled units.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct Budget {
    /// Error of the radial phase, a scaled time, from what the steps leave out.
    pub phase: f64,
    /// Square of its rounding errors: of random signs, they add up like a random walk.
    pub rounding: f64,
    /// Error of W in the step: all since the last time that dw/dτ was put on ±√W.
    pub energy: f64,
    /// Relative error of b·w that a step's interpolation makes.
    pub local: f64,
    /// d²(b·w)/ds² at the end of the step.
    pub pull: f64,
    /// Error of the direction on the sphere.
    pub direction: f64,
    /// Error of cos θ alone: all of it scales with how far the ray goes from the equator.
    pub polar: f64,
    /// Error of I_φ.
    pub azimuth: f64,
    /// Error of I_t/b.
    pub delay: f64,
}

/// Standard deviations that rounding is allowed.
const ROUNDINGS: f64 = 6.0;

impl Budget {
    /// Part of the way from this budget to the next one.
    pub fn towards(&self, next: &Self, part: f64) -> Self {
        let between = |a: f64, b: f64| a + (b - a) * part;
        Budget {
            phase: between(self.phase, next.phase),
            rounding: between(self.rounding, next.rounding),
            energy: next.energy,
            local: next.local,
            pull: next.pull,
            direction: between(self.direction, next.direction),
            polar: between(self.polar, next.polar),
            azimuth: between(self.azimuth, next.azimuth),
            delay: between(self.delay, next.delay),
        }
    }

    /// Returns the errors at a point of the path.
    pub fn at<T: Elementary>(
        &self,
        hole: &Kerr<T>,
        lambda: f64,
        scale: f64,
        point: &PathPoint<T>,
    ) -> Uncertainty {
        let eps = T::EPSILON;
        let rates = Rates::at(hole, lambda, point);
        let w = point.inverse_radius.value();
        let sin = point.sin_theta().value();
        // Mino time by which the ray may be early or late, and what the interpolation adds.
        let late = self.late() / scale;
        // An error of W takes w off the true orbit by δW/|∇W| in the plane of w and dw/dτ.
        let steep = rates.w.hypot(self.pull).max(1e-300);
        let off = 0.5 * self.energy * self.pull / (steep * steep * scale);
        let local = self.local * w + off;
        let relative = if w > 0.0 { (rates.w * late + local) / w + 4.0 * eps } else { 0.0 };
        let lost = stretch(relative);
        let radius = relative * lost;
        let theta = self.direction + 4.0 * eps;
        let azimuth = self.direction / sin.max(self.direction).max(1e-300)
            + self.azimuth
            + rates.drag * late
            + hole.spin().value().abs() * local / rates.gap
            + 4.0 * eps * (1.0 + point.azimuth.value().abs());
        let delay = if w > 0.0 {
            self.delay * scale
                + lost * rates.lift * (rates.energy * late + local) / (w * w)
                + 4.0 * eps * (point.delay.value().abs() + 1.0 / w)
        } else {
            0.0
        };
        Uncertainty { radius, theta, azimuth, delay }
    }

    /// Scaled time by which the ray may be early or late.
    fn late(&self) -> f64 {
        self.phase + ROUNDINGS * self.rounding.sqrt()
    }

    /// Returns the errors where the path has a given radius: it is there earlier or later, elsewhere on the
    /// sphere.
    pub fn at_inverse_radius<T: Elementary>(
        &self,
        hole: &Kerr<T>,
        lambda: f64,
        scale: f64,
        point: &PathPoint<T>,
    ) -> Uncertainty {
        // The direction changes by at most √(1 + a²/b²) in a unit of scaled time.
        let direction = self.direction + SQRT_2 * self.late();
        Budget { direction, ..*self }.at(hole, lambda, scale, point)
    }

    /// Returns the errors where the path crosses the equatorial plane: there θ is known, but an error of cos θ
    /// makes the ray cross earlier or later, at another radius, azimuth and time.
    pub fn at_crossing<T: Elementary>(
        &self,
        hole: &Kerr<T>,
        lambda: f64,
        scale: f64,
        point: &PathPoint<T>,
    ) -> Uncertainty {
        let eps = T::EPSILON;
        let fixed = self.at(hole, lambda, scale, point);
        let rates = Rates::at(hole, lambda, point);
        let (w, a) = (point.inverse_radius.value(), hole.spin().value());
        let polar = point.velocity[2].value().abs().max(1e-300);
        let early = self.polar / polar + 2.0 * eps * point.mino_time.value();
        Uncertainty {
            radius: fixed.radius + if w > 0.0 { rates.w * early / w } else { 0.0 },
            theta: 4.0 * eps * (1.0 + point.mino_time.value() * polar),
            azimuth: fixed.azimuth + (rates.drag + lambda.abs()) * early,
            delay: fixed.delay
                + if w > 0.0 {
                    (rates.lift * rates.energy / (w * w) + (a * (lambda - a)).abs()) * early
                } else {
                    0.0
                },
        }
    }
}

/// Returns the ratio of the relative error of r to that of 1/r, whose estimate is `relative`: once several
/// times that may reach 1/r itself, nothing is known about r. Below a thousandth it makes no difference.
fn stretch(relative: f64) -> f64 {
    const SEVERAL: f64 = 8.0;
    if relative < 1e-3 { 1.0 } else { 1.0 / (1.0 - SEVERAL * relative).max(f64::EPSILON) }
}

/// Rates of a ray at a point, per Mino time.
struct Rates {
    /// |dw/dτ|.
    w: f64,
    /// Δ/r².
    gap: f64,
    /// |r² + a² − aλ|/r²: with Δ/r² it makes the radial motion's dφ/dτ and dt/dτ.
    energy: f64,
    /// |a (r² + a² − aλ)/Δ − a|, the frame dragging's part of dφ/dτ.
    drag: f64,
    /// (r² + a²)/Δ.
    lift: f64,
}

impl Rates {
    fn at<T: Elementary>(hole: &Kerr<T>, lambda: f64, point: &PathPoint<T>) -> Self {
        let w = point.inverse_radius.value();
        let a = hole.spin().value();
        let gap = (1.0 - w * (2.0 - a * a * w)).max(T::EPSILON);
        let energy = 1.0 + a * (a - lambda) * w * w;
        Rates {
            w: point.inverse_radius_rate.value().abs(),
            gap,
            energy: energy.abs(),
            drag: (a * (energy / gap - 1.0)).abs(),
            lift: (1.0 + a * a * w * w) / gap,
        }
    }
}
