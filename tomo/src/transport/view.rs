//! Who looks: an observer with Bardeen's screen, or a camera with a lens.

use crate::scene::Scene;
use kerrlight_geodesic::footprint::Number;
use kerrlight_geodesic::{Camera, Inclination, Kerr, Observer, OutOfRange, Ray};

/// What makes rays out of points of the picture.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum View {
    /// Screen coordinates α, β in M; frequencies are those at infinity.
    Screen(Observer),
    /// Points of the picture plane at distance 1; frequencies are those in the camera's frame.
    Camera(Camera),
}

impl View {
    /// The view of a scene.
    ///
    /// # Errors
    /// If a value is outside its range.
    pub fn new(scene: &Scene, hole: &Kerr) -> Result<Self, OutOfRange> {
        if let Some(camera) = &scene.camera {
            return Ok(View::Camera(camera.camera(hole, scene.observer.time)?));
        }
        let observer = &scene.observer;
        let inclination = Inclination::from_degrees(observer.inclination_deg)?;
        let placed = if observer.radius.is_finite() {
            Observer::at_radius(inclination, observer.radius)?
        } else {
            Observer::at_infinity(inclination)
        };
        Ok(View::Screen(placed.with_azimuth(observer.azimuth_deg.to_radians())))
    }

    /// The photon that arrives at a point of the picture.
    ///
    /// # Errors
    /// If no photon arrives there.
    pub fn ray(&self, hole: &Kerr, x: f64, y: f64) -> Result<Ray, OutOfRange> {
        match self {
            View::Screen(observer) => observer.ray(hole, x, y),
            View::Camera(camera) => camera.ray(x, y),
        }
    }

    /// The same with derivatives with respect to x and y.
    pub(super) fn beam(&self, hole: &Kerr, x: f64, y: f64) -> Result<Ray<Number>, OutOfRange> {
        let (x, y) = (Number::parameter(x, 0), Number::parameter(y, 1));
        match self {
            View::Screen(observer) => {
                let place = observer.with_inclination(observer.inclination().lift());
                place.ray(&hole.lift(), x, y)
            }
            View::Camera(camera) => camera.ray(x, y),
        }
    }

    /// Frequency as it is received over that at infinity; `None` where that is the same.
    pub(super) fn blueshift(&self, x: f64, y: f64) -> Option<f64> {
        match self {
            View::Screen(_) => None,
            View::Camera(camera) => Some(camera.blueshift(camera.direction(x, y))),
        }
    }
}
