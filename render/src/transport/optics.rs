//! Optics: properties of the scene that every source of light needs.

use super::layers::{Numbering, Wanted};
use super::polarized::{Polarization, PolarizedRay};
use crate::emission::medium::Medium;
use kerrlight_geodesic::{Kerr, PathPoint, Quantities, ScreenPoint, View};

/// The hole, the view and the effects that are simulated.
#[derive(Debug, Clone)]
pub(super) struct Optics {
    pub hole: Kerr,
    pub view: View,
    /// Error of a step along a ray, and relative error of the light summed up along it.
    pub tolerance: f64,
    /// Spectral index α, if redshift is simulated.
    pub spectral_index: Option<f64>,
    /// True if light is seen as it was when it passed, not as it is at the time of observation.
    pub slow_light: bool,
    /// True if rays are bent.
    pub lensing: bool,
    /// True if every spot and every triangle is asked along every ray, without a hierarchy.
    pub one_by_one: bool,
    /// Quantities recorded of the brightest contribution to a pixel.
    pub recorded: Quantities,
    pub polarization: Option<Polarization>,
    /// Layers of rays besides their light.
    pub wanted: Wanted,
    pub numbering: Numbering,
}

impl Optics {
    /// Returns the time at which the light that is seen at `time` passed a point.
    pub fn emission_time(&self, time: f64, point: &PathPoint) -> f64 {
        if self.slow_light { time - point.delay } else { time }
    }

    /// Returns the quantities computed at the nodes in a medium besides r and cos θ.
    pub fn quantities_of(&self, medium: &dyn Medium) -> Quantities {
        let velocity = self.polarization.is_some();
        let polarized = Quantities { velocity, ..Quantities::default() };
        medium.quantities().or(self.recorded).or(polarized)
    }

    /// The polarisation of a ray that arrives at (x, y), if light is polarised.
    pub fn polarized(&self, x: f64, y: f64, lambda: f64) -> Option<PolarizedRay<'_>> {
        let (Some(polarization), Some(observer)) = (&self.polarization, self.view.observer())
        else {
            return None;
        };
        let screen = ScreenPoint::new(&self.hole, observer.inclination().sin(), x, y);
        Some(PolarizedRay { hole: &self.hole, polarization, screen, lambda })
    }

    /// Returns the frequency shift by a camera's motion at (x, y), if redshift is simulated.
    #[inline]
    pub fn blueshift(&self, x: f64, y: f64) -> Option<f64> {
        self.spectral_index.and_then(|_| self.view.blueshift(x, y))
    }
}

/// Rates of r, θ and φ at (r, cos θ, φ) as those of the coordinates r n.
pub(super) fn in_cartesian([r, u, azimuth]: [f64; 3], [fall, polar, turn]: [f64; 3]) -> [f64; 3] {
    let ((sin, cos), s) = (azimuth.sin_cos(), ((1.0 - u) * (1.0 + u)).sqrt());
    let outward = fall * s + r * u * polar;
    let around = r * s * turn;
    [outward * cos - around * sin, outward * sin + around * cos, fall * u - r * s * polar]
}
