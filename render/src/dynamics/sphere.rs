//! Unit vectors, and steps on the sphere.

use crate::Error;
use kerrlight_geodesic::vector::{cross, dot, norm};

/// A unit vector.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Axis([f64; 3]);

/// A vector without direction.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[error("axis = {0:?} is not allowed: finite numbers, not all zero")]
pub struct ZeroAxis(pub [f64; 3]);

impl Axis {
    /// The direction of a vector of any length and unit.
    ///
    /// # Errors
    /// If it has none.
    pub fn new(vector: [f64; 3]) -> Result<Self, Error> {
        // Scaled, so that no square over- or underflows.
        let largest = vector.iter().fold(0.0f64, |largest, x| largest.max(x.abs()));
        let scaled = vector.map(|x| x / largest);
        let norm = norm(scaled);
        let axis = scaled.map(|x| x / norm);
        if axis.iter().all(|x| x.is_finite()) {
            Ok(Self(axis))
        } else {
            Err(ZeroAxis(vector).into())
        }
    }

    /// A vector that is a unit vector already, bit for bit.
    ///
    /// # Errors
    /// If its length is not 1 within rounding.
    pub fn exact(vector: [f64; 3]) -> Result<Self, Error> {
        let ok = (dot(vector, vector) - 1.0).abs() < 1e-12;
        if ok { Ok(Self(vector)) } else { Err(ZeroAxis(vector).into()) }
    }

    /// Its components, those of a unit vector.
    pub fn vector(self) -> [f64; 3] {
        self.0
    }

    /// The opposite direction.
    pub fn antipode(self) -> Self {
        Self(self.0.map(|x| -x))
    }

    /// Part of a gradient along the sphere.
    pub fn tangent(self, gradient: [f64; 3]) -> [f64; 3] {
        let along = dot(self.0, gradient);
        core::array::from_fn(|k| gradient[k] - along * self.0[k])
    }

    /// Itself and two unit vectors across it, right-handed.
    pub fn basis(self) -> [[f64; 3]; 3] {
        let n = self.0;
        // Across its least component, where the tangent cannot vanish.
        let least = (0..3).fold(0, |k, c| if n[c].abs() < n[k].abs() { c } else { k });
        let mut unit = [0.0; 3];
        unit[least] = 1.0;
        let east = Self::new(self.tangent(unit)).unwrap_or(self).0;
        [n, east, cross(n, east)]
    }

    /// The direction of self + step: a step on the sphere, in radians to first order. A step that leads to the
    /// centre or is not finite is not taken.
    pub fn moved(self, step: [f64; 3]) -> Self {
        Self::new(core::array::from_fn(|k| self.0[k] + step[k])).unwrap_or(self)
    }

    /// Cosine of the angle between two axes.
    pub fn dot(self, other: Self) -> f64 {
        dot(self.0, other.0)
    }
}
