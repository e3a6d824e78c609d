//! The critical curve: rays that end on a spherical photon orbit (Bardeen 1973; Gralla &
//! Lupsasca 2020b, arXiv:1910.12873), and what half an orbit next to it does.
//!
//! The textbook forms of λ(r) and η(r) have a² in their denominators and r − 1 next to it.
//! Here x = r − 1 and y = √(1 − a²)/x, with which
//!
//! λ = \[2√(1 − a²) y + 3 − a² − x²\]/a,  η + λ² = 6 + a² + 8x + 2x² − 4(1 + x)y²,
//!
//! and, for small spins, ρ = (r − 3)/a:  λ = −\[r²ρ + a(r + 1)\]/x. Nothing cancels: on the
//! straight part of an extremal hole's curve x = 0 and y runs from √3/2 to 0, elsewhere on
//! it y = 0; without spin x = 2 and ρ runs from −2/√3 to 2/√3.

use super::elliptic::{agm, cel};
use super::root::find_root;
use crate::screen::observer::Inclination;
use crate::spacetime::kerr::Kerr;
use crate::spacetime::orbits::{equatorial_prograde, equatorial_retrograde};
use core::f64::consts::{FRAC_2_PI, PI, TAU};

/// The critical curve on the screen of a distant observer, parametrised by the angle on the
/// screen: α = R cos(angle), β = R sin(angle) with R > 0. The screen's origin lies
/// inside the curve for every spin and inclination, so that every angle has one point, and
/// no angle sees the curve at a glancing view.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CriticalCurve {
    family: Family,
    inclination: Inclination,
}

/// A point of the critical curve.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CriticalPoint {
    /// Radius of the spherical photon orbit, in M.
    pub radius: f64,
    /// λ = L/E, in M.
    pub lambda: f64,
    /// η = Q/E², in M².
    pub eta: f64,
    /// Horizontal coordinate on the screen, in M.
    pub alpha: f64,
    /// Vertical coordinate on the screen, in M.
    pub beta: f64,
    orbit: Orbit,
    spin: f64,
}

/// Change of a ray over half an orbit (from one polar turning point to the other) on or next to a
/// spherical photon orbit: the distance from the orbit grows by e^γ, the azimuth by δ, and
/// Boyer–Lindquist time by τ.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct HalfOrbit {
    /// Lyapunov exponent γ: successive images are demagnified by e^−γ.
    pub gamma: f64,
    /// Azimuth δ in the sense of +z, in radians, with 2π added where λ < 0: over the poles
    /// the azimuth jumps by ±π, and with this δ is continuous along the curve. π without
    /// spin. Infinite (with the spin's sign) where the orbit lies at the horizon.
    pub delta: f64,
    /// Boyer–Lindquist time τ, in M. Infinite where the orbit lies at the horizon.
    pub tau: f64,
}

impl CriticalCurve {
    /// The critical curve of `hole` seen from infinity at `inclination`.
    pub fn new(hole: &Kerr, inclination: Inclination) -> Self {
        CriticalCurve { family: Family::new(hole), inclination }
    }

    /// The point in the direction `angle` (radians, from +α towards +β) of the screen's
    /// origin.
    ///
    /// # Examples
    /// The shadow of a hole without spin is a disc of radius 3√3:
    /// ```
    /// use kerrlight_geodesic::{Inclination, Kerr, analytic::CriticalCurve};
    /// let hole = Kerr::new(0.0)?;
    /// let point = CriticalCurve::new(&hole, Inclination::from_degrees(17.0)?).point(0.4);
    /// assert!((point.alpha.hypot(point.beta) - 27f64.sqrt()).abs() < 1e-14);
    /// # Ok::<(), kerrlight_geodesic::Error>(())
    /// ```
    pub fn point(&self, angle: f64) -> CriticalPoint {
        let (sin, cos) = angle.sin_cos();
        self.towards(cos, sin)
    }

    /// `count` points at equal steps of the angle, from angle 0; points on the axes of the
    /// screen lie on them exactly.
    pub fn points(&self, count: u32) -> impl Iterator<Item = CriticalPoint> + use<> {
        let curve = *self;
        (0..count).map(move |k| {
            let (sin, cos) = sin_cos_of_turn(k, count);
            curve.towards(cos, sin)
        })
    }

    fn towards(&self, cos: f64, sin: f64) -> CriticalPoint {
        let cos_i = self.inclination.cos();
        let a = self.family.spin;
        let squash = self.inclination.sin() * cos;
        let shift = a * a * cos_i * cos_i;
        let (low, high) = self.family.ends;
        // λ = −α sin i, in terms of the orbit alone.
        let parameter = find_root(low, high, |parameter| {
            let orbit = self.family.orbit(parameter);
            orbit.lambda + squash * (orbit.angular + shift).max(0.0).sqrt()
        });
        let orbit = self.family.orbit(parameter);
        let distance = (orbit.angular + shift).max(0.0).sqrt();
        let (alpha, beta) = (distance * cos, distance * sin);
        CriticalPoint {
            radius: 1.0 + orbit.x,
            lambda: -distance * squash,
            eta: (alpha - a) * (alpha + a) * cos_i * cos_i + beta * beta,
            alpha,
            beta,
            orbit,
            spin: a,
        }
    }
}

impl CriticalPoint {
    /// Names of [`numbers`](Self::numbers), as tables have them.
    pub const NAMES: [&str; 8] = ["r", "lambda", "eta", "alpha", "beta", "gamma", "delta", "tau"];

    /// r (M), λ (M), η (M²), α (M), β (M), and γ, δ (radians) and τ (M) of the
    /// [half orbit](Self::half_orbit).
    pub fn numbers(&self) -> [f64; 8] {
        let CriticalPoint { radius, lambda, eta, alpha, beta, .. } = *self;
        let HalfOrbit { gamma, delta, tau } = self.half_orbit();
        [radius, lambda, eta, alpha, beta, gamma, delta, tau]
    }

    /// γ, δ and τ of this orbit (Gralla & Lupsasca 2020b), regular for a → 0
    /// and over the poles: with Z₊ = ½\[η + λ² − a² + √((η + λ² − a²)² + 4a²η)\] the polar
    /// motion is a rotation at the rate √(Z₊ + a²u₊ sin²χ), u = cos θ = √u₊ sin χ,
    /// u₊ = η/Z₊ and 1 − u₊ = λ²/(Z₊ + a²).
    pub fn half_orbit(&self) -> HalfOrbit {
        let (a, a2) = (self.spin, self.spin * self.spin);
        let Orbit { x, y, angular, .. } = self.orbit;
        let r = self.radius;
        let quad = angular - a2;
        let fast2 = (quad * quad + 4.0 * a2 * self.eta).sqrt();
        let slow2 = 0.5 * (quad + fast2);
        let mino = PI / agm(slow2.sqrt(), fast2.sqrt());
        let kc = (fast2 / slow2).sqrt();
        let sin2_turning = self.lambda * self.lambda / (slow2 + a2);
        let cos2_integral = 2.0 * self.eta / slow2 / slow2.sqrt() * cel(kc, 1.0, 0.0, 1.0);
        // ∫ λ dτ/sin²θ → π over the pole; 2π are added where it is negative.
        let swept = ((slow2 + a2) / slow2).sqrt() * azimuth_integral(kc, sin2_turning);
        let polar = if self.lambda < 0.0 { TAU - swept } else { swept };
        let dragging = if a == 0.0 { 0.0 } else { a * (x + 2.0) / x * mino };
        let rate = 2.0 * (r * r + a2) * r / x + a * (self.lambda - a);
        HalfOrbit {
            gamma: 2.0 * (r * (x + y * y)).sqrt() * mino,
            delta: dragging + polar,
            tau: rate * mino + a2 * cos2_integral,
        }
    }
}

/// 2√p ∫₀^{π/2} dχ/\[(cos² + p sin²)√(cos² + k_c² sin²)\], whose limit for p → 0 is π/k_c.
fn azimuth_integral(kc: f64, p: f64) -> f64 {
    if p < 1e-280 { PI / kc } else { 2.0 * p.sqrt() * cel(kc, p, 1.0, 1.0) }
}

/// Sine and cosine of 2π k/n, exact on the axes and symmetric about them.
fn sin_cos_of_turn(k: u32, n: u32) -> (f64, f64) {
    let (k, n) = (u64::from(k), u64::from(n));
    // The nearest axis, and the way from there in units of 1/(4n) of a turn.
    let quarter = (8 * k + n) / (2 * n);
    let rest = (4 * k) as f64 - (quarter * n) as f64;
    let (s, c) = (rest / n as f64 / FRAC_2_PI).sin_cos();
    match quarter % 4 {
        0 => (s, c),
        1 => (c, -s),
        2 => (-s, -c),
        _ => (-c, s),
    }
}

/// A spherical photon orbit.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Orbit {
    /// r − 1.
    x: f64,
    /// √(1 − a²)/x; 0/0 on extremal holes is what continuity says.
    y: f64,
    lambda: f64,
    /// η + λ².
    angular: f64,
}

/// The spherical photon orbits of a hole, by a parameter between `ends`: ρ for
/// small spins, else v = x − y, with x y = √(1 − a²).
#[derive(Debug, Clone, Copy, PartialEq)]
struct Family {
    spin: f64,
    /// √(1 − a²).
    root: f64,
    /// The parameter at the orbits in the equatorial plane, prograde first.
    ends: (f64, f64),
}

impl Family {
    fn new(hole: &Kerr) -> Self {
        let (a, root) = (hole.spin(), 0.5 * hole.horizon_gap());
        let ends = if is_slow(a) {
            let u = 2.0 / 3.0 * a.asin();
            let odd = 3f64.sqrt() * if a == 0.0 { 2.0 / 3.0 } else { u.sin() / a };
            let even = if a == 0.0 { 0.0 } else { 2.0 * (0.5 * u).sin().powi(2) / a };
            (-odd - even, odd - even)
        } else {
            let (x, far) =
                (equatorial_prograde(root, a.abs()), equatorial_retrograde(root, a.abs()));
            (x - 0.5 * (3.0 - x).sqrt(), far - root / far)
        };
        Family { spin: a, root, ends }
    }

    fn orbit(&self, parameter: f64) -> Orbit {
        let a = self.spin;
        let (x, y, lambda) = if is_slow(a) {
            let x = 2.0 + a * parameter;
            let r = 1.0 + x;
            (x, self.root / x, -(r * r * parameter + a * (r + 1.0)) / x)
        } else {
            let (x, y) = self.split(parameter);
            (x, y, (2.0 * self.root * y + 3.0 - a * a - x * x) / a)
        };
        let angular = 6.0 + a * a + x * (8.0 + 2.0 * x) - 4.0 * (1.0 + x) * y * y;
        Orbit { x, y, lambda, angular }
    }

    /// x and y from x − y and x y.
    fn split(&self, v: f64) -> (f64, f64) {
        let larger = 0.5 * (v.abs() + (v * v + 4.0 * self.root).sqrt());
        let smaller = if larger == 0.0 { 0.0 } else { self.root / larger };
        if v > 0.0 { (larger, smaller) } else { (smaller, larger) }
    }
}

/// Returns whether ρ is the better parameter.
fn is_slow(spin: f64) -> bool {
    spin.abs() < 0.5
}
