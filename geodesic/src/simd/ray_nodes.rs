//! Values at the nodes of one ray.

/// The nodes of one ray.
#[derive(Clone, Copy, Debug)]
pub struct RayNodes<'a> {
    /// Boyer–Lindquist radius, in M.
    pub radius: &'a [f64],
    /// cos θ.
    pub cos_theta: &'a [f64],
    /// Σ dτ: what an integral over the affine parameter gives to each node, in M.
    pub weight: &'a [f64],
    /// Mino time since the observer, M⁻¹.
    pub mino_time: &'a [f64],
    /// Azimuth in radians, but for whole turns; empty unless requested.
    pub azimuth: &'a [f64],
    /// Delay t_o − t in M (its finite part for an observer at infinity); empty unless requested.
    pub delay: &'a [f64],
    /// d(1/r)/dτ, dimensionless, positive on the way in; empty unless requested.
    pub radial_velocity: &'a [f64],
    /// d cos θ/dτ; empty unless requested.
    pub polar_velocity: &'a [f64],
    /// An estimate of the relative error of positions by rounding; it grows in inverse
    /// proportion to the distance from the critical curve.
    pub error: f64,
}

impl<'a> RayNodes<'a> {
    /// The nodes of columns in the order of the fields.
    pub(crate) fn of(columns: [&'a [f64]; 8], error: f64) -> Self {
        let [radius, cos_theta, weight, mino_time, azimuth, delay, radial, polar] = columns;
        RayNodes {
            radius,
            cos_theta,
            weight,
            mino_time,
            azimuth,
            delay,
            radial_velocity: radial,
            polar_velocity: polar,
            error,
        }
    }
}
