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

use crate::kerr::Kerr;
use crate::observer::Ray;
use crate::scalar::Scalar;

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

/// Number of variables of the largest state.
pub(crate) const FULL: usize = 10;

/// Whether a state of `N` variables holds the azimuth.
pub(crate) const fn has_azimuth(n: usize) -> bool {
    n >= 9
}

/// Whether a state of `N` variables holds the time; it is then the last one (I_t/b).
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

impl System<f64> {
    /// The equations of `ray` around `hole`.
    pub fn new(hole: &Kerr, ray: &Ray) -> Self {
        let [quad, cubic, quartic] = ray.potential.coefficients;
        let (a, b2) = (hole.spin(), ray.angular.max(1.0));
        let b = b2.sqrt();
        let half = 0.5 * cubic;
        System {
            scale: b,
            linear: quad / b2,
            square: 1.5 * cubic / (b2 * b),
            cubic: 2.0 * quartic / (b2 * b2),
            angular: ray.angular / b2,
            spin2: a * a / b2,
            gauge: a * (a - ray.lambda) / b2,
            azimuth: [a / b, a * half / (b2 * b)],
            time: [half / b2, a * a / b2, a * (ray.lambda - a) / b2, a * a / b2],
        }
    }
}

impl<T: Scalar> System<T> {
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

    /// How many roundings the denominator g is blurred by: its largest term over itself.
    #[inline(always)]
    pub fn blur<const N: usize>(&self, y: &[T; N], leg: T) -> T {
        let (w, dw) = (y[index::W], y[index::DW]);
        T::constant(1.0) / (T::constant(1.0) + self.gauge * w * w + leg * dw)
    }

    /// Second derivatives of I_φ and I_t/b, for the dense output; zero where not asked for.
    #[inline(always)]
    pub fn second_derivative<const N: usize>(&self, y: &[T; N], leg: T) -> [T; 2] {
        use index::{DU, DW, U, W};
        let mut second = [T::constant(0.0); 2];
        if has_azimuth(N) || has_time(N) {
            let (w, dw) = (y[W], y[DW]);
            let w2 = w * w;
            let dw2 = (w + w) * dw;
            let ddw = w * (self.linear + w * (self.square + w * self.cubic));
            let g = T::constant(1.0) + self.gauge * w2 + leg * dw;
            let dg = self.gauge * dw2 + leg * ddw;
            let inv2 = T::constant(1.0) / (g * g);
            if has_azimuth(N) {
                second[0] = -(self.azimuth[1] * (dw2 * g - w2 * dg) * inv2);
            }
            if has_time(N) {
                let [half, a2, _, tilt] = self.time;
                let radial = half * (a2 * dw2 * g - (T::constant(1.0) + a2 * w2) * dg) * inv2;
                second[1] = radial + tilt * (y[U] + y[U]) * y[DU];
            }
        }
        second
    }

    /// The state in which `ray` starts; `w_sign` is +1 for an inward start.
    #[inline(always)]
    pub fn start<const N: usize>(&self, ray: &Ray, w_sign: f64) -> [T; N] {
        use index::{DU, DW, DX, DY, U, W, X, Y};
        let mut y = [T::constant(0.0); N];
        let b = self.scale;
        y[W] = T::constant(b * ray.inverse_radius);
        y[DW] = T::constant(w_sign * ray.potential.value(ray.inverse_radius).max(0.0).sqrt());
        y[U] = T::constant(ray.position[2]);
        y[DU] = T::constant(ray.velocity[2] / b);
        if has_azimuth(N) {
            y[X] = T::constant(ray.position[0]);
            y[DX] = T::constant(ray.velocity[0] / b);
            y[Y] = T::constant(ray.position[1]);
            y[DY] = T::constant(ray.velocity[1] / b);
        }
        y
    }
}
