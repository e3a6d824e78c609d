//! The geometry that looks most like another one: seen from below, with the other spin, and turned by half a circle.
//!
//! At low resolution a flare that orbits on an inclined circle looks the same from above as from below; Doppler shifts, lensing
//! and drag tell the two apart, but a search that is in the wrong valley does not leave it.

use super::problem::GeometryProblem;
use super::{Geometry, Parameter};
use core::f64::consts::PI;
use kerrlight_common::simd::Float;

impl<T: Float> GeometryProblem<'_, T> {
    /// The mirror solution of a geometry; none if its inclination is not free.
    pub fn mirror_solution(&self, geometry: &Geometry) -> Option<Geometry> {
        let other = |parameter: Parameter, value: f64| match parameter {
            Parameter::Inclination => PI - value,
            Parameter::Spin => -value,
            Parameter::PositionAngle => value + PI,
            _ => value,
        };
        self.free.iter().find(|free| free.parameter == Parameter::Inclination)?;
        let one = |mirror: Geometry, free: &super::Free| {
            let value = other(free.parameter, geometry.get(free.parameter));
            mirror.with(free.parameter, free.inside(value))
        };
        Some(self.free.iter().fold(*geometry, one))
    }
}
