//! Quantities at the points of a ray.

/// Quantities computed at the points of a ray besides r, θ and Mino time. Those that are off cost
/// nothing.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Quantities {
    /// Azimuth.
    pub azimuth: bool,
    /// Coordinate time.
    pub time: bool,
    /// Rates of 1/r and cos θ with Mino time. Rays traced step by step always have them.
    pub velocity: bool,
}

impl Quantities {
    /// r and θ alone.
    pub const POLAR: Quantities = Quantities { azimuth: false, time: false, velocity: false };
    /// Everything.
    pub const ALL: Quantities = Quantities { azimuth: true, time: true, velocity: true };

    /// Returns the union of two requests.
    pub fn or(self, other: Self) -> Self {
        Quantities {
            azimuth: self.azimuth || other.azimuth,
            time: self.time || other.time,
            velocity: self.velocity || other.velocity,
        }
    }
}
