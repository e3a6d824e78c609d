//! Stokes parameters.

use core::ops::{AddAssign, Mul};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// One of the four.
#[derive(
    Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize, JsonSchema,
)]
pub enum StokesParameter {
    /// Intensity.
    I,
    /// P cos 2χ.
    Q,
    /// P sin 2χ.
    U,
    /// Right-handed less left-handed.
    V,
}

impl StokesParameter {
    /// All four, in their order.
    pub const ALL: [Self; 4] = [Self::I, Self::Q, Self::U, Self::V];

    /// Its place in that order.
    pub fn index(self) -> usize {
        self as usize
    }

    /// Its letter.
    pub fn name(self) -> &'static str {
        ["I", "Q", "U", "V"][self.index()]
    }
}

/// Stokes parameters I, Q, U, V, in the unit of the intensity.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Stokes {
    /// Intensity, scene units.
    pub i: f64,
    /// P cos 2χ.
    pub q: f64,
    /// P sin 2χ.
    pub u: f64,
    /// Right-handed less left-handed circular polarisation (IAU 1973), scene units.
    pub v: f64,
}

impl Stokes {
    /// The position angle χ of the electric vector in radians, east of north, in (−π/2, π/2]; 0 without
    /// linear polarisation.
    pub fn evpa(&self) -> f64 {
        0.5 * self.u.atan2(self.q)
    }

    /// One of them, in the unit of the intensity.
    pub fn get(&self, parameter: StokesParameter) -> f64 {
        [self.i, self.q, self.u, self.v][parameter.index()]
    }

    /// The same with position angles that are larger by `angle` (radians, east of north): Q + iU times e^{2i angle}.
    #[must_use]
    pub fn turned(self, angle: f64) -> Self {
        let (sin, cos) = (2.0 * angle).sin_cos();
        Stokes { q: self.q * cos - self.u * sin, u: self.q * sin + self.u * cos, ..self }
    }

    /// The intensity of the linearly polarised part, in units of I, P = √(Q² + U²).
    pub fn linear(&self) -> f64 {
        self.q.hypot(self.u)
    }
}

impl AddAssign for Stokes {
    fn add_assign(&mut self, other: Self) {
        self.i += other.i;
        self.q += other.q;
        self.u += other.u;
        self.v += other.v;
    }
}

impl Mul<f64> for Stokes {
    type Output = Self;
    fn mul(self, factor: f64) -> Self {
        let Stokes { i, q, u, v } = self;
        Stokes { i: i * factor, q: q * factor, u: u * factor, v: v * factor }
    }
}
