//! A point of a ray: position, direction, and what follows from them.

use crate::numbers::scalar::Elementary;
use crate::spacetime::kerr::Kerr;

/// A point of a path.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PathPoint<T = f64> {
    /// Mino time since the observer, growing backward in time.
    pub mino_time: T,
    /// w = 1/r.
    pub inverse_radius: T,
    /// dw/dτ of the backward ray: positive on the way in.
    pub inverse_radius_rate: T,
    /// n = (sin θ cos φ, sin θ sin φ, cos θ). Without azimuth: (NaN, NaN, cos θ), and NaN is what follows from it:
    /// places in space, momenta, redshifts.
    pub direction: [T; 3],
    /// dn/dτ of the backward ray less its frame dragging, so that the photon's covariant
    /// momentum on the sphere is p·v = −velocity·v. Without azimuth: (NaN, NaN, d cos θ/dτ).
    pub velocity: [T; 3],
    /// Azimuth, unwrapped from the observer on; 0 unless requested.
    pub azimuth: T,
    /// Delay of the photon: t_o − t for an observer at finite radius, lim \[(t_o − t) − r_o − 2 ln r_o\] for one at
    /// infinity; 0 unless requested.
    pub delay: T,
}

impl<T: Elementary> PathPoint<T> {
    /// Boyer–Lindquist radius.
    pub fn radius(&self) -> T {
        T::constant(1.0) / self.inverse_radius
    }

    /// cos θ.
    pub fn cos_theta(&self) -> T {
        self.direction[2]
    }

    /// Polar angle θ; with azimuth accurate at the poles.
    pub fn theta(&self) -> T {
        self.sin_theta().atan2(self.direction[2])
    }

    /// sin θ.
    pub(crate) fn sin_theta(&self) -> T {
        let [x, y, u] = self.direction;
        let across = x * x + y * y;
        let square = if x.value().is_nan() { T::constant(1.0) - u * u } else { across };
        // On the axis itself the square root has no derivative.
        if square.value() > 0.0 { square.sqrt() } else { T::constant(0.0) }
    }

    /// Covariant Boyer–Lindquist momentum (p_t, p_r, p_θ, p_φ) of the photon on its way to
    /// the observer, for unit energy at infinity; `lambda` is its angular momentum. p_r
    /// diverges at the horizon.
    pub fn momentum(&self, hole: &Kerr<T>, lambda: T) -> [T; 4] {
        let (w, one) = (self.inverse_radius, T::constant(1.0));
        // Δ/r², and p_r = (dr/dτ)/Δ.
        let mut gap = one - w * (one + one - hole.spin() * hole.spin() * w);
        if gap.value() <= 0.0 {
            // At the last float outside of a horizon: (1 − r₊w)(1 − r₋w).
            gap = (one - hole.horizon() * w) * (one - hole.inner_horizon() * w);
        }
        let p_r = self.inverse_radius_rate / gap;
        let [x, y, u] = self.direction;
        let sin = (x * x + y * y).sqrt();
        let [vx, vy, vz] = self.velocity;
        let polar = if sin.value() > 0.0 {
            // −v·ê_θ, with the horizontal part along the meridian.
            vz * sin - u * (vx * x + vy * y) / sin
        } else {
            -((vx * vx + vy * vy).sqrt() * T::constant(u.value().signum()))
        };
        [-one, p_r, polar, lambda]
    }

    /// d(r, θ, φ, delay)/dτ of the backward ray with angular momentum `lambda`, from the
    /// equations of motion (Carter 1968), for unit energy at infinity. Infinite at the
    /// horizon and at infinity; dφ/dτ diverges on the axis. Needs the azimuth's direction for
    /// the sign of dθ/dτ at the poles only.
    pub fn rates(&self, hole: &Kerr<T>, lambda: T) -> [T; 4] {
        let (w, a, one) = (self.inverse_radius, hole.spin(), T::constant(1.0));
        let [_, _, p_theta, _] = self.momentum(hole, lambda);
        let gap = one - w * (one + one - a * a * w);
        // (r² + a² − aλ)/Δ.
        let lift = (one + a * (a - lambda) * w * w) / gap;
        let u = self.direction[2];
        let sin2 = (one - u) * (one + u);
        let orbital = if lambda.value() == 0.0 { T::constant(0.0) } else { lambda / sin2 };
        let around = a * lift - a + orbital;
        let time = (one + a * a * w * w) * lift / (w * w) + a * (lambda - a * sin2);
        [-(self.inverse_radius_rate / (w * w)), -p_theta, -around, time]
    }

    /// Returns the point of a path without a step.
    pub(crate) fn nowhere() -> Self {
        let nan = T::constant(f64::NAN);
        PathPoint {
            mino_time: nan,
            inverse_radius: nan,
            inverse_radius_rate: nan,
            direction: [nan; 3],
            velocity: [nan; 3],
            azimuth: nan,
            delay: nan,
        }
    }

    /// r n, in M: the point in the coordinates in which a = 0 is flat-looking. Infinite at infinity, so that a line to be
    /// drawn begins where [`Path::intervals_within`](crate::Path::intervals_within) says that the ray enters a sphere.
    pub fn cartesian(&self) -> [T; 3] {
        let w = self.inverse_radius;
        let at_infinity = |x: T| if x.value() == 0.0 { x } else { x / w };
        self.direction.map(|x| if w.value() > 0.0 { x / w } else { at_infinity(x) })
    }
}
