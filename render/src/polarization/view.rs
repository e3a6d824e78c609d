//! View of the field in moving gas along a ray.

use super::{Gas, MagneticField};
use kerrlight_geodesic::{Kerr, ScreenPoint, ZamoFrame};

/// View of gas and field at a point along the ray that reaches the screen.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SynchrotronView {
    /// g = ν_obs/ν_em, dimensionless.
    pub redshift: f64,
    /// |B| in the gas frame, in units of the scene's field.
    pub field: f64,
    /// Sine of the angle θ_B between field and photon in the gas frame.
    pub sin_pitch: f64,
    /// Its cosine: positive where the field points along the photon, to the observer.
    pub cos_pitch: f64,
    /// (cos 2χ, sin 2χ) of the electric vector on the screen, χ east of north; (0, 0) where the
    /// photon moves along the field and has no direction of polarisation.
    pub direction: [f64; 2],
    /// kᵗ/|k·e_θ| in the gas frame: the path through a thin layer parallel to the equatorial
    /// plane per its thickness, ℓ_p/H of Narayan et al. 2021, eq. 18. Infinite along the layer.
    pub slant: f64,
}

/// The view of `gas` with the field `field` (along e_r, e_θ, e_φ of the gas) by the photon
/// `photon`, which arrives at `screen` with unit energy at infinity; photon and gas in the
/// components of `frame` ([`ZamoFrame::covariant`], [`Gas`]). `None` where the photon has no
/// positive energy in the gas frame or something is not finite.
///
/// Returns the view. In the gas frame the electric vector is along k × B. On the screen it is
/// normal to the parallel-transported projection of B, h = b + (k·b)/ω u with ω = −k·u, a vector
/// normal to k of length |B| sin θ_B: no cross product is needed.
#[inline]
pub fn view(
    frame: &ZamoFrame,
    screen: &ScreenPoint,
    photon: [f64; 4],
    gas: Gas,
    field: [f64; 3],
) -> Option<SynchrotronView> {
    let (k, Gas(u)) = (photon, gas);
    let energy = u[0] * k[0] - space(u, k);
    let strength = (field[0] * field[0] + field[1] * field[1] + field[2] * field[2]).sqrt();
    // The field's four-vector: a boost by u.
    let time = u[1] * field[0] + u[2] * field[1] + u[3] * field[2];
    let lift = time / (1.0 + u[0]);
    let b = [time, field[0] + lift * u[1], field[1] + lift * u[2], field[2] + lift * u[3]];
    let along = (space(k, b) - k[0] * b[0]) / energy;
    let h = core::array::from_fn(|i| b[i] + along * u[i]);
    let [north, east] = screen.transport(frame, k, h);
    let square = north * north + east * east;
    let inverse = if square > 0.0 { 1.0 / square } else { 0.0 };
    // 2χ = 2χ_h + π.
    let direction = [(east * east - north * north) * inverse, -2.0 * north * east * inverse];
    // e_θ of k boosted to the gas, with γk⁰ − ω for u·k.
    let polar = k[2] - u[2] * (k[0] + energy) / (1.0 + u[0]);
    let inverse = if strength > 0.0 { 1.0 / strength } else { 0.0 };
    // |h| is |B| sin θ_B but for rounding.
    let sin_pitch = (square.sqrt() * inverse).min(1.0);
    let fine = energy > 0.0 && square.is_finite() && energy.is_finite();
    fine.then(|| SynchrotronView {
        redshift: 1.0 / energy,
        field: strength,
        sin_pitch,
        cos_pitch: (along * inverse).clamp(-1.0, 1.0),
        direction,
        slant: energy / polar.abs(),
    })
}

/// [`view`] from Boyer–Lindquist components: the point (`r` in M, `cos_theta`), the photon's
/// covariant `momentum` (p_t = −1; that of the arriving photon, as
/// [`PathPoint::momentum`](kerrlight_geodesic::PathPoint::momentum) has it) and the gas's
/// contravariant four-velocity. `None` also at and inside the horizon.
///
/// Near the axis 1 − cos²θ loses digits of sin θ; [`ZamoFrame::of`] a point does not.
pub fn view_at(
    hole: &Kerr,
    screen: &ScreenPoint,
    [r, cos_theta]: [f64; 2],
    momentum: [f64; 4],
    velocity: [f64; 4],
    field: &MagneticField,
) -> Option<SynchrotronView> {
    let sin = ((1.0 - cos_theta) * (1.0 + cos_theta)).max(0.0).sqrt();
    let frame = ZamoFrame::at(hole, r, sin, cos_theta)?;
    let gas = Gas::of_velocity(&frame, velocity);
    view(&frame, screen, frame.covariant(momentum), gas, field.at(&frame))
}

/// The product of the spatial parts.
#[inline]
fn space(a: [f64; 4], b: [f64; 4]) -> f64 {
    a[1] * b[1] + a[2] * b[2] + a[3] * b[3]
}
