//! Lensing bands: where on the screen rays cross the equatorial plane how often.

use super::closed_form::ClosedForm;
use super::critical_curve::CriticalCurve;
use super::root::find_root;
use crate::screen::observer::{Inclination, Observer};
use crate::spacetime::kerr::Kerr;

/// The region of the screen whose rays cross the equatorial plane outside the horizon at
/// least n + 1 times: the n-th image of a disc without edges (Gralla, Holz & Wald 2019,
/// arXiv:1906.00873; Gralla & Lupsasca 2020b). Its edges are closed curves around the
/// critical curve's two sides, labelled like [`CriticalCurve::point`] by the angle.
#[derive(Debug, Clone, Copy)]
pub struct LensingBand {
    hole: Kerr,
    curve: CriticalCurve,
    observer: Observer,
    half_orbits: u16,
}

impl LensingBand {
    /// The band n = `half_orbits` of a hole seen from infinity.
    pub fn new(hole: &Kerr, inclination: Inclination, half_orbits: u16) -> Self {
        LensingBand {
            hole: *hole,
            curve: CriticalCurve::new(hole, inclination),
            observer: Observer::at_infinity(inclination),
            half_orbits,
        }
    }

    /// (α, β) of the inner edge in the direction `angle` (radians) of the screen's origin:
    /// here the last of the n + 1 crossings is at the horizon.
    pub fn inner(&self, angle: f64) -> (f64, f64) {
        let critical = self.critical(angle);
        let size = find_root(0.0, critical, |size| self.excess(angle, size, true));
        on_screen(angle, size)
    }

    /// (α, β) of the outer edge in the direction `angle` (radians): here the last of the
    /// n + 1 crossings is at infinity. `None` for n = 0: the direct image has no edge.
    ///
    /// # Examples
    /// The n = 1 band of a hole without spin, seen face-on (Gralla, Holz & Wald 2019):
    /// ```
    /// use kerrlight_geodesic::{Inclination, Kerr, analytic::LensingBand};
    /// let band = LensingBand::new(&Kerr::new(0.0)?, Inclination::from_degrees(0.0)?, 1);
    /// assert!((band.inner(0.0).0 - 5.0151354942).abs() < 1e-10);
    /// assert!((band.outer(0.0).unwrap().0 - 6.1675667648).abs() < 1e-10);
    /// # Ok::<(), kerrlight_geodesic::Error>(())
    /// ```
    pub fn outer(&self, angle: f64) -> Option<(f64, f64)> {
        if self.half_orbits == 0 {
            return None;
        }
        let critical = self.critical(angle);
        let mut far = 2.0 * critical;
        while self.excess(angle, far, false) > 0.0 {
            far *= 2.0;
            if far.is_nan() || far > 1e12 {
                return None;
            }
        }
        let size = find_root(critical, far, |size| self.excess(angle, size, false));
        Some(on_screen(angle, size))
    }

    fn critical(&self, angle: f64) -> f64 {
        let point = self.curve.point(angle);
        point.alpha.hypot(point.beta)
    }

    /// Mino time left to the ray after its last crossing, infinite across the critical curve.
    fn excess(&self, angle: f64, size: f64, captured: bool) -> f64 {
        let (alpha, beta) = on_screen(angle, size);
        match self.observer.ray(&self.hole, alpha, beta) {
            Ok(ray) if ray.potential.captures() == captured => {
                let form = ClosedForm::new(&self.hole, &ray);
                let last = form.crossing_time(u32::from(self.half_orbits) + 1);
                if last.is_finite() { form.mino_total() - last } else { f64::NEG_INFINITY }
            }
            _ => f64::INFINITY,
        }
    }
}

fn on_screen(angle: f64, size: f64) -> (f64, f64) {
    let (sin, cos) = angle.sin_cos();
    (size * cos, size * sin)
}
