//! Motion of the gas that radiates.

use kerrlight_geodesic::vector::dot;
use kerrlight_geodesic::{Kerr, PathPoint, ZamoFrame, orbits};

/// The four-velocity of gas in the frame of zero angular momentum: γ, and γv along e_r, e_θ,
/// e_φ.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Gas(pub [f64; 4]);

impl Gas {
    /// Gas with the contravariant Boyer–Lindquist four-velocity (uᵗ, uʳ, u^θ, u^φ), the last two in M⁻¹.
    ///
    /// γ follows from the other three, so that its rounding does not become a mass.
    pub fn of_velocity(frame: &ZamoFrame, u: [f64; 4]) -> Self {
        let [_, x, y, z] = frame.contravariant(u);
        Gas([(1.0 + x * x + y * y + z * z).sqrt(), x, y, z])
    }

    /// Gas with the velocity v (in units of c) along e_r, e_θ, e_φ; `None` unless it is slower than
    /// light.
    pub fn with_velocity(v: [f64; 3]) -> Option<Self> {
        let square = dot(v, v);
        (square < 1.0).then(|| {
            let gamma = 1.0 / (1.0 - square).sqrt();
            Gas([gamma, gamma * v[0], gamma * v[1], gamma * v[2]])
        })
    }

    /// Gas that circles the axis with Ω = 1/(r^{3/2} + a), a geodesic in the equatorial plane;
    /// `None` where that would not be slower than light.
    pub fn keplerian(hole: &Kerr, frame: &ZamoFrame) -> Option<Self> {
        let rate = orbits::keplerian_angular_velocity(hole, frame.radius());
        Self::with_velocity([0.0, 0.0, frame.orbital_velocity(rate)])
    }

    /// Gas that turns rigidly at constant r with the angular velocity vector `omega`
    /// (Cartesian, radians per M of coordinate time), as a hot spot about its axis; `None`
    /// where that would not be slower than light. The point must have been traced with its
    /// azimuth.
    pub fn rotating(frame: &ZamoFrame, point: &PathPoint, omega: [f64; 3]) -> Option<Self> {
        Self::with_velocity(on_sphere(frame, point.direction, omega))
    }

    /// The same in the direction `n` (a unit vector) of gas that changes its radius, too, with dr/dt = `fall`.
    pub fn falling(frame: &ZamoFrame, n: [f64; 3], (omega, fall): ([f64; 3], f64)) -> Option<Self> {
        let [_, polar, around] = on_sphere(frame, n, omega);
        // Along e_t and e_r nothing of the angular motion enters: it can be 0 here.
        let [time, radial, ..] = frame.contravariant([1.0, fall, 0.0, 0.0]);
        Self::with_velocity([radial / time, polar, around])
    }

    /// The components along e_r, e_θ, e_φ that the gas measures of a vector of the frame, of which the part along its
    /// four-velocity is left out.
    pub fn measured(&self, vector: [f64; 4]) -> [f64; 3] {
        let Gas([gamma, x, y, z]) = *self;
        let along = x * vector[1] + y * vector[2] + z * vector[3];
        // The boost to rest without rotation: b + u [u·b/(1 + γ) − b⁰].
        let lift = along / (1.0 + gamma) - vector[0];
        [vector[1] + lift * x, vector[2] + lift * y, vector[3] + lift * z]
    }
}

/// The velocity along e_r, e_θ, e_φ at `n` of what turns rigidly.
fn on_sphere(frame: &ZamoFrame, [x, y, u]: [f64; 3], omega: [f64; 3]) -> [f64; 3] {
    let [sin, _] = frame.polar_angle();
    let (cos_phi, sin_phi) = if sin > 0.0 { (x / sin, y / sin) } else { (1.0, 0.0) };
    // dn/dt = ω × n along e_θ and e_φ.
    let along_theta = omega[1] * cos_phi - omega[0] * sin_phi;
    let along_phi = omega[2] * sin - u * (omega[0] * cos_phi + omega[1] * sin_phi);
    frame.sphere_velocity(along_theta, along_phi)
}
