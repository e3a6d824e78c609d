//! The equations of motion in Mino time, free of coordinate singularities.
//!
//! With dτ = ds/Σ, w = 1/r and n = (x, y, u) the point on the unit sphere, the backward
//! ray obeys (from the separated equations of Gralla & Lupsasca 2020, arXiv:1910.12881,
//! by differentiation)
//!
//! ```text
//! w'' = A w + (3/2) B w² + 2 C w³
//! n'' = −(η + λ² + 2a²u²) n + a² u ẑ
//! ```
//!
//! polynomials everywhere. Azimuth and time have poles at the horizon and at infinity;
//! since P² − R = Δ B/2 for P = r² + a² − aλ and √R = |w'|/w², the part that is singular is
//! dr times a function of r alone and integrates in closed form
//! ([`Kerr::azimuth_closed_form`], [`Kerr::tortoise`]). What is left is smooth:
//!
//! ```text
//! g     = 1 + (a² − aλ) w² + |w'|
//! I_φ'  = a − a (B/2) w²/g
//! I_t'  = (B/2)(1 + a² w²)/g + a(λ − a(1 − u²))
//! φ     = atan2(y, x) + I_φ ± azimuth_closed_form
//! t_o − t = I_t ∓ tortoise
//! ```
//!
//! (upper sign on an inward leg, lower sign on an outward leg).
//!
//! Everything is integrated in the scaled time s = bτ and inverse radius b·w, with
//! b = √max(1, η + λ²), so that all quantities are of order one from the horizon to impact
//! parameters of millions of M.

use crate::numbers::scalar::{Elementary, Scalar};
use crate::screen::observer::Ray;
use crate::spacetime::kerr::Kerr;

/// Place of each variable in the state; the first four are always there.
pub(crate) mod index {
    /// b·w.
    pub const W: usize = 0;
    /// dw/dτ.
    pub const DW: usize = 1;
    /// cos θ.
    pub const U: usize = 2;
    /// d(cos θ)/ds.
    pub const DU: usize = 3;
    /// sin θ cos φ without frame dragging.
    pub const X: usize = 4;
    /// dx/ds.
    pub const DX: usize = 5;
    /// sin θ sin φ without frame dragging.
    pub const Y: usize = 6;
    /// dy/ds.
    pub const DY: usize = 7;
    /// I_φ, the regular part of the azimuth.
    pub const AZIMUTH: usize = 8;
}

/// Returns whether a state of `N` variables holds the azimuth.
pub(crate) const fn has_azimuth(n: usize) -> bool {
    n >= 9
}

/// Returns whether a state of `N` variables holds the time; it is then the last one (I_t/b).
pub(crate) const fn has_time(n: usize) -> bool {
    n == 5 || n == 10
}

/// The coefficients of the scaled equations of one ray.
#[derive(Debug, Clone, Copy)]
pub(crate) struct System<T> {
    /// b.
    pub scale: f64,
    linear: T,
    square: T,
    cubic: T,
    angular: T,
    spin2: T,
    /// (a² − aλ)/b².
    gauge: T,
    /// a/b and a(B/2)/b³: the two terms of I_φ'.
    azimuth: [T; 2],
    /// (B/2)/b², a²/b² and a(λ − a)/b², a²/b²: the terms of (I_t/b)'.
    time: [T; 4],
}

impl<T: Elementary> System<T> {
    /// The equations of `ray` around `hole`.
    pub fn new(hole: &Kerr<T>, ray: &Ray<T>) -> Self {
        let [quad, cubic, quartic] = ray.potential.coefficients;
        let a = hole.spin();
        let b = short(ray.angular.value().max(1.0).sqrt());
        let b2 = b * b;
        let half = T::constant(0.5) * cubic;
        // The scale is a plain number: it may be any, so it carries no derivatives.
        let over = |x: T, scale: f64| x / T::constant(scale);
        System {
            scale: b,
            linear: over(quad, b2),
            square: over(T::constant(1.5) * cubic, b2 * b),
            cubic: over(T::constant(2.0) * quartic, b2 * b2),
            angular: over(ray.angular, b2),
            spin2: over(a * a, b2),
            gauge: over(a * (a - ray.lambda), b2),
            azimuth: [over(a, b), over(a * half, b2 * b)],
            time: [
                over(half, b2),
                over(a * a, b2),
                over(a * (ray.lambda - a), b2),
                over(a * a, b2),
            ],
        }
    }

    /// The state in which `ray` starts; `leg` is +1 for an inward start.
    pub fn start<const N: usize>(&self, ray: &Ray<T>, leg: f64) -> [T; N] {
        use index::{DU, DW, DX, DY, U, W, X, Y};
        let mut y = [T::constant(0.0); N];
        let b = T::constant(self.scale);
        let w = T::constant(ray.inverse_radius);
        y[W] = b * w;
        y[DW] = T::constant(leg) * root(ray.potential.value(w));
        y[U] = ray.position[2];
        y[DU] = ray.velocity[2] / b;
        if has_azimuth(N) {
            y[X] = ray.position[0];
            y[DX] = ray.velocity[0] / b;
            y[Y] = ray.position[1];
            y[DY] = ray.velocity[1] / b;
        }
        y
    }
}

/// `b` rounded up to 13 bits: its powers up to the fourth are exact, so that no digit of a wide
/// number is lost in the scaling.
fn short(b: f64) -> f64 {
    const TAIL: u64 = (1 << 40) - 1;
    f64::from_bits((b.to_bits() + TAIL) & !TAIL)
}

/// The square root of a potential that is not negative but for rounding.
fn root<T: Elementary>(value: T) -> T {
    if value.value() > 0.0 { value.sqrt() } else { T::constant(0.0) }
}

impl<T: Scalar> System<T> {
    /// Coefficients of w, w² and w³ in w''.
    pub fn radial(&self) -> [T; 3] {
        [self.linear, self.square, self.cubic]
    }

    /// (η + λ²)/b² and a²/b².
    pub fn polar(&self) -> (T, T) {
        (self.angular, self.spin2)
    }

    /// (a² − aλ)/b².
    pub fn gauge(&self) -> T {
        self.gauge
    }

    /// Constant and factor of w²/g in I_φ'.
    pub fn azimuth(&self) -> [T; 2] {
        self.azimuth
    }

    /// B/2, a², a(λ − a) and a², scaled: the terms of (I_t/b)'.
    pub fn time(&self) -> [T; 4] {
        self.time
    }

    /// dy/ds; `leg` is +1 on an inward leg and −1 on an outward one.
    #[inline(always)]
    pub fn derivative<const N: usize>(&self, y: &[T; N], leg: T) -> [T; N] {
        use index::{AZIMUTH, DU, DW, DX, DY, U, W, X, Y};
        let zero = T::constant(0.0);
        let (w, dw, u) = (y[W], y[DW], y[U]);
        let w2 = w * w;
        let u2 = u * u;
        let mut f = [zero; N];
        f[W] = dw;
        f[DW] = w * (self.linear + w * (self.square + w * self.cubic));
        let pull = self.angular + (self.spin2 + self.spin2) * u2;
        f[U] = y[DU];
        f[DU] = u * (self.spin2 - pull);
        if has_azimuth(N) {
            f[X] = y[DX];
            f[DX] = -(pull * y[X]);
            f[Y] = y[DY];
            f[DY] = -(pull * y[Y]);
        }
        if has_azimuth(N) || has_time(N) {
            let inv = T::constant(1.0) / (T::constant(1.0) + self.gauge * w2 + leg * dw);
            if has_azimuth(N) {
                f[AZIMUTH] = self.azimuth[0] - self.azimuth[1] * w2 * inv;
            }
            if has_time(N) {
                let [half, a2, frame, tilt] = self.time;
                f[N - 1] = half * (T::constant(1.0) + a2 * w2) * inv + frame + tilt * u2;
            }
        }
        f
    }

    /// Returns the number of roundings by which the denominator g is blurred: its largest term over
    /// itself.
    #[inline(always)]
    pub fn blur<const N: usize>(&self, y: &[T; N], leg: T) -> T {
        let (w, dw) = (y[index::W], y[index::DW]);
        T::constant(1.0) / (T::constant(1.0) + self.gauge * w * w + leg * dw)
    }
}
