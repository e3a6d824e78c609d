//! Stokes parameters.

use core::ops::{AddAssign, Mul};

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
