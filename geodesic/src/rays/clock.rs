//! Error estimates of rays in closed form.

use crate::integrate::uncertainty::{Uncertainty, larger};
use crate::screen::observer::Ray;
use crate::simd::{LEAST_STEPS, MAX_STEP};
use crate::spacetime::kerr::Kerr;

/// Takes the error of a position and that of its delay into the estimate of a ray. A relative
/// error of 1/r of 1 or more leaves nothing known about r and the delay.
pub(crate) fn widen(worst: &mut Uncertainty, error: f64, azimuth: f64, delay: f64) {
    let lost = if error < 1.0 { 1.0 / (1.0 - error) } else { f64::INFINITY };
    let (radius, delay) = (error * lost, delay * lost);
    *worst = worst.max(Uncertainty { radius, theta: error, azimuth, delay });
}

/// The error of the delay over b, by quadrature at the largest step: of the derivatives of 1/g at
/// both ends, the largest for rays that hardly bend. Measured (docs/measurements/geodesics.md of the
/// repository).
const QUADRATURE: f64 = 2e-10;

/// Quantities that decide the error of a ray's delay.
pub(crate) struct Clock {
    spin: f64,
    lambda: f64,
    /// The ray's fastest frequency.
    b: f64,
    /// Radius of the observer; 0 for one at infinity, where closed forms start from 0.
    start: f64,
}

impl Clock {
    pub fn new(hole: &Kerr, ray: &Ray) -> Self {
        let w = ray.inverse_radius;
        let start = if w > 0.0 { 1.0 / w } else { 0.0 };
        Clock { spin: hole.spin(), lambda: ray.lambda, b: ray.angular.max(1.0).sqrt(), start }
    }

    /// Returns the error of a quadrature with steps of bτ `step`: of order ten.
    pub fn quadrature(&self, step: f64) -> f64 {
        QUADRATURE * self.b * (step / MAX_STEP).powi(10)
    }

    /// The step, as a bτ, to a crossing at `time` of a ray that turns after `half`.
    pub fn step_to(&self, time: f64, half: f64) -> f64 {
        let steps = (self.b * time / MAX_STEP).ceil().max(LEAST_STEPS as f64);
        // The outward leg mirrors the inward one: two sums, each of as many steps.
        let outward = time > half;
        let (inner, rest) = if outward { (2.0 * half - time, time - half) } else { (time, 0.0) };
        self.b * inner.max(rest) / steps
    }

    /// Returns the worst error of samples a `step` of Mino time apart, whose positions have this
    /// error; without those at the horizon, where the delay has no limit.
    pub fn worst(&self, hole: &Kerr, [radii, delays]: [&[f64]; 2], step: f64, error: f64) -> f64 {
        let horizon = hole.horizon() * (1.0 + 2e-8);
        let fine = (self.b * step / MAX_STEP).ceil().max(1.0);
        let quadrature = self.quadrature(self.b * step / fine);
        let outside = radii.iter().zip(delays).filter(|(r, _)| **r > horizon);
        let each = outside.map(|(r, delay)| self.rounding(*delay, *r) + error * self.reach(*r));
        each.fold(0.0, larger) + quadrature
    }

    /// Returns the rounding error at radius `r`.
    pub fn rounding(&self, delay: f64, r: f64) -> f64 {
        16.0 * f64::EPSILON * (delay.abs() + r + self.start + self.b)
    }

    /// Returns the excess of the azimuth's rate at radius `r` over that of bτ: frame dragging.
    pub fn dragging(&self, r: f64) -> f64 {
        let (a, delta) = (self.spin, (r * (r - 2.0) + self.spin * self.spin).max(f64::EPSILON));
        1.0 + (a * ((r * r + a * (a - self.lambda)) / delta - 1.0)).abs() / self.b
    }

    /// Returns the change of the delay with a relative error of the radius: r dt/dr.
    pub fn reach(&self, r: f64) -> f64 {
        let a2 = self.spin * self.spin;
        r * (r * r + a2) / (r * (r - 2.0) + a2).max(f64::EPSILON)
    }
}
