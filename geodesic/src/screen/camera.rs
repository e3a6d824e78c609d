//! Observers at a finite radius with a local frame and a perspective lens.

use crate::error::{OutOfRange, check};
use crate::numbers::scalar::Elementary;
use crate::screen::observer::{Inclination, Ray};
use crate::spacetime::frame::ZamoFrame;
use crate::spacetime::kerr::Kerr;
use crate::spacetime::orbits;
use crate::spacetime::radial::RadialPotential;

/// How a local observer moves.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Motion {
    /// At rest with respect to infinity; outside the ergosphere only.
    Static,
    /// Zero angular momentum (Bardeen 1970): carried along with the rotation of space.
    Zamo,
    /// Turning about +z with Ω = 1/(r^{3/2} + a), a geodesic in the equatorial plane.
    Keplerian,
    /// Falling from rest at infinity without angular momentum: E = 1, L = Q = 0.
    FreeFall,
}

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
    /// A camera around `hole` at `radius` > r₊, polar angle `inclination` and azimuth 0.
    ///
    /// # Errors
    /// If the radius is not finite or not outside the horizon, or if nothing can move as
    /// asked for at this place (a static camera in the ergosphere, a Keplerian one inside
    /// the photon orbit).
    pub fn new(
        hole: &Kerr,
        inclination: Inclination,
        radius: f64,
        motion: Motion,
    ) -> Result<Self, OutOfRange> {
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
    ) -> Result<Self, OutOfRange> {
        let at_rest = Self::at_rest(hole, inclination, radius)?;
        let velocity = at_rest.local_velocity(rates);
        let speed = square(velocity).sqrt();
        check("camera speed", speed, speed < 1.0, "slower than light, below 1")?;
        Ok(Camera { velocity, ..at_rest })
    }

    /// The camera of zero angular momentum.
    fn at_rest(hole: &Kerr, inclination: Inclination, radius: f64) -> Result<Self, OutOfRange> {
        let frame = ZamoFrame::at(hole, radius, inclination.sin(), inclination.cos());
        let frame = frame.ok_or(OutOfRange {
            field: "camera radius",
            value: radius,
            allowed: "a finite number outside the horizon",
        })?;
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
    /// [`Dual`](crate::Dual) numbers, with its derivatives with respect to them.
    ///
    /// # Errors
    /// If x or y is not in \[−1e12, 1e12\], or if the photon has no positive energy at infinity (some
    /// directions inside the ergosphere).
    pub fn ray<T: Elementary>(&self, x: T, y: T) -> Result<Ray<T>, OutOfRange> {
        for (field, value) in [("x", x.value()), ("y", y.value())] {
            check(field, value, value.abs() <= 1e12, "a number in [-1e12, 1e12]")?;
        }
        self.arriving_from(self.direction(x, y))
    }

    /// The unit vector (e_r, e_θ, e_φ) of the camera's frame that is seen at the point (x, y) of
    /// the picture plane.
    pub fn direction<T: Elementary>(&self, x: T, y: T) -> [T; 3] {
        let norm = (T::constant(1.0) + x * x + y * y).sqrt();
        let [right, up, forward] = self.axes.map(|axis| axis.map(T::constant));
        core::array::from_fn(|k| (forward[k] + x * right[k] + y * up[k]) / norm)
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
    pub fn arriving_from<T: Elementary>(&self, direction: [T; 3]) -> Result<Ray<T>, OutOfRange> {
        let length = direction.iter().map(|d| d.value() * d.value()).sum::<f64>().sqrt();
        let allowed = "1 (the direction is a unit vector)";
        check("length of the direction", length, (length - 1.0).abs() < 1e-6, allowed)?;
        let [k_r, k_theta, k_phi] = self.momentum(direction);
        let of = T::constant;
        let a = of(self.hole.spin());
        let (s, c) = (of(self.inclination.sin()), of(self.inclination.cos()));
        // p_φ/sin θ and p_θ, for unit energy in the frame of zero angular momentum.
        let sigma = self.hole.sigma(self.radius, self.inclination.cos());
        let (around, polar) = (k_phi * of(self.girth), k_theta * of(sigma.sqrt()));
        let energy = of(self.lapse) + of(self.drag) * s * around;
        let allowed = "a direction from which light of positive energy arrives";
        check("energy at infinity", energy.value(), energy.value() > 0.0, allowed)?;
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
            potential: RadialPotential::new(coefficients, horizon).narrow(T::narrow),
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

    /// ν in the camera's frame over ν at infinity, for the photon that arrives from
    /// `direction`: multiplies every redshift factor g that is written for infinity.
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
mod tests {
    use super::*;
    use crate::{Observer, Outcome, Path, Quantities, Tracer};

    fn camera(spin: f64, degrees: f64, radius: f64, motion: Motion) -> Camera {
        let inclination = Inclination::from_degrees(degrees).unwrap();
        Camera::new(&Kerr::new(spin).unwrap(), inclination, radius, motion).unwrap()
    }

    const MOTIONS: [Motion; 4] =
        [Motion::Static, Motion::Zamo, Motion::Keplerian, Motion::FreeFall];

    /// The constants of motion obey both potentials: u'² = U(u) and (dr/dτ)² = R(r) with
    /// dr/dτ from the frame.
    #[test]
    fn exact_constraints_in_every_frame() {
        for motion in MOTIONS {
            for (spin, degrees, radius) in [(0.9, 60.0, 7.0), (0.0, 0.0, 20.0), (-0.5, 90.0, 12.0)]
            {
                let camera = camera(spin, degrees, radius, motion);
                for (x, y) in [(0.0, 0.0), (0.3, -0.2), (-1.5, 2.0)] {
                    let ray = camera.ray(x, y).unwrap();
                    let (u, du, a2) = (ray.position[2], ray.velocity[2], spin * spin);
                    let quad = a2 - ray.eta - ray.lambda.powi(2);
                    let polar = ray.eta + quad * u * u - a2 * u.powi(4);
                    assert!((du * du - polar).abs() < 1e-9 * (1.0 + polar.abs()));
                    let n = (1.0 + x * x + y * y).sqrt();
                    let k = camera.momentum([-1.0 / n, -y / n, x / n]);
                    // dr/dτ = √(ΔΣ) k_r/E.
                    let hole = camera.hole;
                    let scale = (hole.delta(radius) * hole.sigma(radius, u)).sqrt();
                    let around = k[2] * camera.girth;
                    let energy = camera.lapse + camera.drag * ray.position[0] * around;
                    let rate = scale * k[0] / energy / (radius * radius);
                    let value = ray.potential.value(1.0 / radius);
                    assert!((rate * rate / value - 1.0).abs() < 1e-9, "{motion:?} ({x}, {y})");
                }
            }
        }
    }

    /// Synge 1966: a static observer at r sees the shadow of a hole without spin under the
    /// half-angle ψ with sin²ψ = 27 (1 − 2/r)/r² (beyond 90° inside the photon sphere); an
    /// observer in free fall sees it aberrated by v = √(2/r).
    #[test]
    fn paper_angular_size_of_the_shadow() {
        for r in [2.5, 4.0, 10.0, 100.0f64] {
            let sine = (27.0 * (1.0 - 2.0 / r)).sqrt() / r;
            let at_rest = if r < 3.0 { std::f64::consts::PI - sine.asin() } else { sine.asin() };
            // Aberration gathers directions ahead: cos ψ' = (cos ψ + v)/(1 + v cos ψ).
            let v = (2.0 / r).sqrt();
            let falling = ((at_rest.cos() + v) / (1.0 + v * at_rest.cos())).acos();
            for (motion, expected) in [(Motion::Static, at_rest), (Motion::FreeFall, falling)] {
                let camera = camera(0.0, 40.0, r, motion);
                let captured = |psi: f64| {
                    let direction = [-psi.cos(), 0.6 * psi.sin(), 0.8 * psi.sin()];
                    let ray = camera.arriving_from(direction).unwrap();
                    let mut path = Path::new();
                    let tracer = Tracer::new(1e-12).unwrap();
                    tracer.trace(&camera.hole, &ray, Quantities::POLAR, &mut path);
                    path.outcome() == Outcome::Captured
                };
                let (mut lo, mut hi) = (0.0, std::f64::consts::PI - 1e-6);
                for _ in 0..50 {
                    let middle = 0.5 * (lo + hi);
                    if captured(middle) { lo = middle } else { hi = middle }
                }
                assert!((lo - expected).abs() < 1e-10, "{motion:?} at {r}: {lo} {expected}");
            }
        }
    }

    /// Far away a static camera is Bardeen's screen: α = r x, β = r y.
    #[test]
    fn exact_bardeen_limit() {
        let r = 1e7;
        let camera = camera(0.9, 55.0, r, Motion::Static);
        let hole = Kerr::new(0.9).unwrap();
        let far = Observer::at_infinity(Inclination::from_degrees(55.0).unwrap());
        for (alpha, beta) in [(3.0, 4.0), (-6.0, 0.5)] {
            let (near, ideal) =
                (camera.ray(alpha / r, beta / r).unwrap(), far.ray(&hole, alpha, beta).unwrap());
            assert!((near.lambda - ideal.lambda).abs() < 1e-5);
            assert!((near.eta - ideal.eta).abs() < 1e-5);
            assert!(near.inward && near.velocity[2] * ideal.velocity[2] > 0.0);
        }
    }

    /// A static observer sees light from infinity blueshifted by 1/√(−g_tt), whatever its
    /// direction; one in free fall radially from rest, light from straight behind
    /// by 1/(1 + √(2/r)).
    #[test]
    fn exact_blueshifts() {
        let r = 8.0f64;
        let still = camera(0.0, 70.0, r, Motion::Static);
        for d in [[1.0, 0.0, 0.0], [0.0, 0.6, 0.8], [-0.6, 0.0, 0.8]] {
            assert!((still.blueshift(d) - 1.0 / (1.0 - 2.0 / r).sqrt()).abs() < 1e-14);
        }
        let falling = camera(0.0, 70.0, r, Motion::FreeFall);
        let behind = falling.blueshift([1.0, 0.0, 0.0]);
        assert!((behind - 1.0 / (1.0 + (2.0 / r).sqrt())).abs() < 1e-14, "{behind}");
    }

    /// The motions by name are those of their rates.
    #[test]
    fn exact_named_motions_by_their_rates() {
        let (hole, place) = (Kerr::new(0.6).unwrap(), Inclination::from_degrees(90.0).unwrap());
        let r = 9.0f64;
        // Free fall from rest at infinity: dr/dt = −√(2r(r² + a²)) Δ/A, dφ/dt = ω.
        let area = (r * r + 0.36).powi(2) - 0.36 * hole.delta(r);
        let fall = -(2.0 * r * (r * r + 0.36)).sqrt() * hole.delta(r) / area;
        for (motion, rates) in [
            (Motion::Static, [0.0; 3]),
            (Motion::Keplerian, [0.0, 0.0, 1.0 / (27.0 + 0.6)]),
            (Motion::Zamo, [0.0, 0.0, 1.2 * r / area]),
            (Motion::FreeFall, [fall, 0.0, 1.2 * r / area]),
        ] {
            let named = Camera::new(&hole, place, r, motion).unwrap().velocity;
            let moving = Camera::moving(&hole, place, r, rates).unwrap().velocity;
            for (a, b) in named.iter().zip(moving) {
                assert!((a - b).abs() < 1e-14, "{motion:?} {named:?} {moving:?}");
            }
        }
        assert!(Camera::moving(&hole, place, r, [0.0, 0.2, 0.0]).is_err());
    }

    /// Special relativity far from the hole, and a motion in θ as good as one in φ: light from
    /// ahead is shifted by √((1 + v)/(1 − v)).
    #[test]
    fn exact_doppler_shift_of_a_polar_motion() {
        let (hole, place) = (Kerr::new(0.9).unwrap(), Inclination::from_degrees(90.0).unwrap());
        let (r, v) = (1e7, 0.5f64);
        let camera = Camera::moving(&hole, place, r, [0.0, v / r, 0.0]).unwrap();
        let ahead = camera.blueshift([0.0, 1.0, 0.0]);
        assert!((ahead - ((1.0 + v) / (1.0 - v)).sqrt()).abs() < 1e-6, "{ahead}");
        assert!((camera.blueshift([0.0, -1.0, 0.0]) * ahead - 1.0).abs() < 1e-6);
    }

    /// Turned to the right by 90° the camera looks along +e_φ, with the hole on its left; upwards,
    /// along −e_θ; and clockwise by 90°, what was to its right is up.
    #[test]
    fn exact_pointing() {
        use std::f64::consts::FRAC_PI_2;
        let camera = camera(0.5, 80.0, 15.0, Motion::Static);
        let close = |camera: Camera, x: f64, y: f64, expected: [f64; 3]| {
            let d = camera.direction(x, y);
            let off = d.iter().zip(expected).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
            assert!(off < 2e-9, "{d:?} {expected:?}");
        };
        close(camera.with_pointing(FRAC_PI_2, 0.0, 0.0), 0.0, 0.0, [0.0, 0.0, 1.0]);
        close(camera.with_pointing(FRAC_PI_2, 0.0, 0.0), -1e9, 0.0, [-1.0, 0.0, 0.0]);
        close(camera.with_pointing(0.0, FRAC_PI_2, 0.0), 0.0, 0.0, [0.0, -1.0, 0.0]);
        close(camera.with_pointing(0.0, 0.0, FRAC_PI_2), 0.0, 1e9, [0.0, 0.0, 1.0]);
        close(camera.with_pointing(0.3, 0.2, 0.1), 0.0, 0.0, {
            [-0.3f64.cos() * 0.2f64.cos(), -0.2f64.sin(), 0.3f64.sin() * 0.2f64.cos()]
        });
    }

    #[test]
    fn impossible_cameras_are_refused() {
        let hole = Kerr::new(0.9).unwrap();
        let equator = Inclination::from_degrees(90.0).unwrap();
        assert!(Camera::new(&hole, equator, 1.9, Motion::Static).is_err());
        assert!(Camera::new(&hole, equator, 1.9, Motion::Zamo).is_ok());
        assert!(Camera::new(&hole, equator, 1.3, Motion::Zamo).is_err());
        assert!(Camera::new(&hole, equator, 1.5, Motion::Keplerian).is_err());
        assert!(Camera::new(&hole, equator, f64::NAN, Motion::Zamo).is_err());
    }
}
