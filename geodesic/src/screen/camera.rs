//! Observers at a finite radius with a local frame and a perspective lens.

use crate::error::{Error, check};
use crate::numbers::scalar::Elementary;
use crate::screen::observer::{FARTHEST, Inclination, Ray};
use crate::spacetime::frame::ZamoFrame;
use crate::spacetime::kerr::Kerr;
use crate::spacetime::orbits;
use crate::spacetime::radial::RadialPotential;

/// Motion of a local observer.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum Motion {
    /// Rest with respect to infinity; outside the ergosphere only.
    Static,
    /// Zero angular momentum (Bardeen 1970): carried along with the rotation of space.
    Zamo,
    /// Turning about +z with Ω = 1/(r^{3/2} + a): a geodesic in the equatorial plane, and in no other place, where
    /// something has to hold the camera up.
    Keplerian,
    /// Falling from rest at infinity without angular momentum: E = 1, L = Q = 0.
    FreeFall,
}

/// Roundings of a photon's energy at infinity, a difference of two terms inside the ergosphere.
const ROUNDINGS: f64 = 16.0;

/// A camera at a finite radius.
///
/// Its frame is the orthonormal tetrad of the zero-angular-momentum observer at its place,
/// e_r, e_θ, e_φ along the Boyer–Lindquist coordinates (Bardeen, Press & Teukolsky 1972,
/// eq. 3.2), boosted without rotation to the camera's velocity. It looks towards the hole,
/// along −e_r; `right` is +e_φ and `up` is −e_θ, as for Bardeen's screen at infinity;
/// [`with_pointing`](Self::with_pointing) turns it. A
/// pinhole lens maps the point (x, y) of the picture plane at distance 1 to the direction
/// forward + x right + y up; a field of view ψ spans |x| ≤ tan(ψ/2).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Camera {
    hole: Kerr,
    inclination: Inclination,
    radius: f64,
    azimuth: f64,
    /// Velocity in the tetrad of the zero-angular-momentum observer, along e_r, e_θ, e_φ.
    velocity: [f64; 3],
    /// Right, up and forward in the camera's frame.
    axes: [[f64; 3]; 3],
    /// Its lapse, angular velocity ω, and √(A/Σ).
    lapse: f64,
    drag: f64,
    girth: f64,
}

impl Camera {
    /// A camera around `hole` at `radius` > r₊ in M, polar angle `inclination` and azimuth 0.
    ///
    /// # Errors
    /// If the radius is not outside the horizon and at most 1e30 M, or if nothing can move as
    /// requested at this place (a static camera in the ergosphere, a Keplerian one inside
    /// the photon orbit).
    pub fn new(
        hole: &Kerr,
        inclination: Inclination,
        radius: f64,
        motion: Motion,
    ) -> Result<Self, Error> {
        let at_rest = Self::at_rest(hole, inclination, radius)?;
        let velocity = match motion {
            Motion::Zamo => [0.0; 3],
            Motion::Static => at_rest.local_velocity([0.0; 3]),
            Motion::Keplerian => {
                let rate = orbits::keplerian_angular_velocity(hole, radius);
                at_rest.local_velocity([0.0, 0.0, rate])
            }
            Motion::FreeFall => [-((1.0 - at_rest.lapse) * (1.0 + at_rest.lapse)).sqrt(), 0.0, 0.0],
        };
        let allowed = "a radius at which this motion is slower than light";
        check("camera radius", radius, square(velocity) < 1.0, allowed)?;
        Ok(Camera { velocity, ..at_rest })
    }

    /// A camera that moves along a given path: `rates` are dr/dt, dθ/dt and dφ/dt, in units of
    /// coordinate time.
    ///
    /// # Errors
    /// As for [`new`](Self::new), or if the motion is not slower than light.
    pub fn moving(
        hole: &Kerr,
        inclination: Inclination,
        radius: f64,
        rates: [f64; 3],
    ) -> Result<Self, Error> {
        let at_rest = Self::at_rest(hole, inclination, radius)?;
        for (field, rate) in ["dr/dt", "dtheta/dt", "dphi/dt"].into_iter().zip(rates) {
            check(field, rate, rate.is_finite(), "a finite number (M⁻¹, that of r without unit)")?;
        }
        let velocity = at_rest.local_velocity(rates);
        let speed = square(velocity).sqrt();
        check("camera speed", speed, speed < 1.0, "slower than light, below 1")?;
        Ok(Camera { velocity, ..at_rest })
    }

    /// The camera of zero angular momentum.
    fn at_rest(hole: &Kerr, inclination: Inclination, radius: f64) -> Result<Self, Error> {
        let near = radius <= FARTHEST;
        let frame = ZamoFrame::at(hole, radius, inclination.sin(), inclination.cos());
        let frame = frame.filter(|_| near).ok_or(Error::out_of_range(
            "camera radius",
            radius,
            "outside the horizon and at most 1e30 (M)",
        ))?;
        let ZamoFrame { lapse, drag, girth, .. } = frame;
        Ok(Camera {
            hole: *hole,
            inclination,
            radius,
            azimuth: 0.0,
            velocity: [0.0; 3],
            axes: [[0.0, 0.0, 1.0], [0.0, -1.0, 0.0], [-1.0, 0.0, 0.0]],
            lapse,
            drag,
            girth,
        })
    }

    /// Velocity in the frame of zero angular momentum of what moves with dr/dt, dθ/dt, dφ/dt:
    /// (√(Σ/Δ) ṙ, √Σ θ̇, √(A/Σ) sin θ (φ̇ − ω))/lapse (Bardeen, Press & Teukolsky 1972, eq. 3.6).
    fn local_velocity(&self, [radial, polar, around]: [f64; 3]) -> [f64; 3] {
        let sigma = self.hole.sigma(self.radius, self.inclination.cos());
        [
            (sigma / self.hole.delta(self.radius)).sqrt() * radial / self.lapse,
            sigma.sqrt() * polar / self.lapse,
            self.girth * self.inclination.sin() * (around - self.drag) / self.lapse,
        ]
    }

    /// The same camera turned away from the hole: by `yaw` to the right about its upward axis,
    /// then by `pitch` upwards about the axis to its right, then by `roll` clockwise about its line
    /// of sight (what it sees turns counterclockwise), in radians.
    pub fn with_pointing(mut self, yaw: f64, pitch: f64, roll: f64) -> Self {
        let turn = |from: [f64; 3], to: [f64; 3], angle: f64| {
            let (sin, cos) = angle.sin_cos();
            let mix = |p: f64, q: f64, k: usize| p * from[k] + q * to[k];
            [
                core::array::from_fn(|k| mix(cos, sin, k)),
                core::array::from_fn(|k| mix(-sin, cos, k)),
            ]
        };
        let [right, up, forward] = self.axes;
        let [forward, right] = turn(forward, right, yaw);
        let [forward, up] = turn(forward, up, pitch);
        let [up, right] = turn(up, right, roll);
        self.axes = [right, up, forward];
        self
    }

    /// The same camera at azimuth `azimuth` (radians).
    pub fn with_azimuth(mut self, azimuth: f64) -> Self {
        self.azimuth = azimuth;
        self
    }

    /// The hole.
    pub fn hole(&self) -> &Kerr {
        &self.hole
    }

    /// The photon that arrives at the point (x, y) of the picture plane; of
    /// [`Dual`](crate::Dual) numbers, with its derivatives with respect to them. In some directions inside the
    /// ergosphere its energy at infinity is not positive: see [`Ray::is_from_horizon`].
    ///
    /// # Errors
    /// If x or y is not in \[−1e12, 1e12\], or an angle of the camera is not finite.
    pub fn ray<T: Elementary>(&self, x: T, y: T) -> Result<Ray<T>, Error> {
        for (field, value) in [("x", x.value()), ("y", y.value())] {
            check(field, value, value.abs() <= 1e12, "a number in [-1e12, 1e12]")?;
        }
        let [forward, ..] = self.axes[2];
        check("yaw, pitch or roll", forward, forward.is_finite(), "finite angles (radians)")?;
        self.arriving_from(self.direction(x, y))
    }

    /// The unit vector (e_r, e_θ, e_φ) of the camera's frame that is seen at the point (x, y) of
    /// the picture plane.
    pub fn direction<T: Elementary>(&self, x: T, y: T) -> [T; 3] {
        let norm = (T::constant(1.0) + x * x + y * y).sqrt();
        let [right, up, forward] = self.axes.map(|axis| axis.map(T::constant));
        core::array::from_fn(|k| (forward[k] + x * right[k] + y * up[k]) / norm)
    }

    /// Unit vectors (e_r, e_θ, e_φ) to the right, up and forward, in the camera's frame.
    pub fn axes(&self) -> [[f64; 3]; 3] {
        self.axes
    }

    /// Its Boyer–Lindquist radius, in M.
    pub fn radius(&self) -> f64 {
        self.radius
    }

    /// The photon that arrives from the unit vector `direction` = (e_r, e_θ, e_φ) of the
    /// camera's frame.
    ///
    /// # Errors
    /// If the vector's length is not 1 within 1e-6, or as for [`ray`](Self::ray).
    pub fn arriving_from<T: Elementary>(&self, direction: [T; 3]) -> Result<Ray<T>, Error> {
        let length = direction.iter().map(|d| d.value() * d.value()).sum::<f64>().sqrt();
        check(
            "camera azimuth",
            self.azimuth,
            self.azimuth.is_finite(),
            "a finite angle (radians)",
        )?;
        let allowed = "1 (the direction is a unit vector)";
        check("length of the direction", length, (length - 1.0).abs() < 1e-6, allowed)?;
        let [k_r, k_theta, k_phi] = self.momentum(direction);
        let of = T::constant;
        let a = of(self.hole.spin());
        let (s, c) = (of(self.inclination.sin()), of(self.inclination.cos()));
        // p_φ/sin θ and p_θ, for unit energy in the frame of zero angular momentum.
        let sigma = self.hole.sigma(self.radius, self.inclination.cos());
        let (around, polar) = (k_phi * of(self.girth), k_theta * of(sigma.sqrt()));
        let dragged = of(self.drag) * s * around;
        let energy = of(self.lapse) + dragged;
        // Within its rounding it is 0.
        let rounding = ROUNDINGS * T::EPSILON * (self.lapse + dragged.value().abs());
        let is_from_horizon = energy.value() <= rounding;
        let energy = if is_from_horizon { of(1.0) } else { energy };
        let (around, polar) = (around / energy, polar / energy);
        let angular = around * around + polar * polar - a * a * c * c;
        let tilt = around - a * s;
        let carter = polar * polar + tilt * tilt;
        let eta = polar * polar + c * c * (around - a) * (around + a);
        let coefficients = [a * a - angular, of(2.0) * carter, -(a * a * eta)].map(T::widen);
        let horizon = of(1.0 / self.hole.horizon()).widen();
        Ok(Ray {
            lambda: s * around,
            eta,
            angular,
            position: [s, of(0.0), c],
            // Backward: −(p_θ ê_θ + p_φ/sin θ ê_φ).
            velocity: [-(polar * c), -around, polar * s],
            rotation_sign: if around.value() > 0.0 { -1.0 } else { 1.0 },
            azimuth: self.azimuth,
            inverse_radius: 1.0 / self.radius,
            inward: k_r.value() > 0.0,
            is_from_horizon,
            potential: RadialPotential::new(coefficients, horizon).narrow(T::narrow),
            spin: self.hole.spin(),
        })
    }

    /// Spatial momentum of the arriving photon in the frame of zero angular momentum, for
    /// unit energy there.
    fn momentum<T: Elementary>(&self, direction: [T; 3]) -> [T; 3] {
        let [v_r, v_theta, v_phi] = self.velocity;
        let square = square(self.velocity);
        let p = direction.map(|d| -d);
        if square == 0.0 {
            return p;
        }
        let of = T::constant;
        let gamma = 1.0 / (1.0 - square).sqrt();
        let along = of(v_r) * p[0] + of(v_theta) * p[1] + of(v_phi) * p[2];
        let energy = of(gamma) * (of(1.0) + along);
        // p + [(γ − 1)(v·p)/v² + γ] v for unit energy in the camera's frame.
        let factor = of(gamma - 1.0) * along / of(square) + of(gamma);
        let boosted =
            [p[0] + factor * of(v_r), p[1] + factor * of(v_theta), p[2] + factor * of(v_phi)];
        boosted.map(|k| k / energy)
    }

    /// (Energy at infinity, p_r, p_φ/sin θ, p_θ) of the photon from the direction forward + x right + y up as a linear
    /// map of (|direction|, 1, x, y): four rows. Shaders take it in place of the frame.
    pub(crate) fn lens(&self) -> [[f64; 4]; 4] {
        let [right, up, forward] = self.axes;
        let columns = [(1.0, [0.0; 3]), (0.0, forward), (0.0, right), (0.0, up)]
            .map(|(energy, from)| self.unscaled(energy, from.map(|d| -d)));
        core::array::from_fn(|row| columns.map(|column| column[row]))
    }

    /// [`lens`](Self::lens) of a photon of energy `energy` and momentum `p` in the camera's frame.
    fn unscaled(&self, energy: f64, p: [f64; 3]) -> [f64; 4] {
        let speed = square(self.velocity);
        let gamma = 1.0 / (1.0 - speed).sqrt();
        let along: f64 = self.velocity.iter().zip(p).map(|(v, k)| v * k).sum();
        let stretch = if speed > 0.0 { (gamma - 1.0) * along / speed } else { 0.0 };
        let factor = stretch + gamma * energy;
        let k: [f64; 3] = core::array::from_fn(|j| p[j] + factor * self.velocity[j]);
        let sigma = self.hole.sigma(self.radius, self.inclination.cos());
        let (around, polar) = (k[2] * self.girth, k[1] * sigma.sqrt());
        let drag = self.drag * self.inclination.sin() * around;
        [self.lapse * gamma * (energy + along) + drag, k[0], around, polar]
    }

    /// Its inclination.
    pub fn inclination(&self) -> Inclination {
        self.inclination
    }

    /// Its azimuth, in radians.
    pub fn azimuth(&self) -> f64 {
        self.azimuth
    }

    /// ν in the camera's frame over ν at infinity, for the photon that arrives from
    /// `direction`: multiplies every redshift factor g that is written for infinity. Negative or infinite for light
    /// whose energy at infinity is not positive ([`Ray::is_from_horizon`]).
    pub fn blueshift(&self, direction: [f64; 3]) -> f64 {
        let along: f64 = self.velocity.iter().zip(direction).map(|(v, d)| v * d).sum();
        let zamo = (1.0 - along) / (1.0 - square(self.velocity)).sqrt();
        let around = self.momentum(direction)[2] * self.girth;
        1.0 / (zamo * (self.lapse + self.drag * self.inclination.sin() * around))
    }
}

fn square(v: [f64; 3]) -> f64 {
    v.iter().map(|x| x * x).sum()
}

#[cfg(test)]
mod tests;
