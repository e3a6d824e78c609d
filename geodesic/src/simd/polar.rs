//! Equidistant samples of the polar and azimuthal motion.
//!
//! The direction n = (x, y, u) moves as a point on the unit sphere with
//! `n'' = −(K + 2a²u²) n + a² u ẑ`. In a frame that turns by a fixed angle δ
//! about the axis per step h this motion has an exact three-term recurrence
//! (X = x + iy):
//!
//! ```text
//! X₊ + X₋ = c ρ X        u₊ + u₋ = 2S' ρ u        ρ = 1/(1 + a²S²u²)
//! S'² = 1 + A S² + C S⁴,  S(0) = 0               c = 2S'/√(1 + a²S²)
//! δ = −a²λ ∫₀ʰ S²/(1 + a²S²) dτ
//! ```
//!
//! and `∫ a²u² dτ` over a step is `a² S u u₊ + a²η ∫₀ʰ S² dτ`.

use super::lanes::Lanes;
use super::motion::{Camera, Motion};
use core::f64::consts::{FRAC_PI_2, TAU};

/// Terms of the series in h².
const TERMS: usize = 7;

/// Direction, and the step that led there, in the turning frame.
#[derive(Clone, Copy)]
pub struct PolarState<V> {
    /// x in the turning frame.
    pub x: V,
    /// y in the turning frame.
    pub y: V,
    /// cos θ.
    pub u: V,
    dx: V,
    dy: V,
    du: V,
}

/// A direction and its rate of change.
#[derive(Clone, Copy)]
pub struct Direction<V> {
    /// The unit vector.
    pub n: [V; 3],
    /// dn/dτ.
    pub velocity: [V; 3],
}

/// The addition theorem of the polar motion for one fixed step h.
#[derive(Clone, Copy)]
pub struct PolarStep<V> {
    /// `2a²S²`.
    bend: V,
    /// `a²S²`.
    half_bend: V,
    /// `2(1 − S')`.
    rate_u: V,
    /// `2 − c`.
    rate_x: V,
    /// `a²S`.
    cross: V,
    /// Azimuth of the turning frame gained per step.
    pub turn: V,
    /// `a²η ∫₀ʰ S²`.
    pub lift: V,
    s: V,
    root: V,
    twist: V,
}

impl<V: Lanes<f64>> PolarStep<V> {
    /// Coefficients for the step h.
    ///
    /// `Y = S²` obeys `Y'' = 2 + 4A Y + 6C Y²`; all is summed as series in h².
    #[inline(always)]
    pub fn new(cam: &Camera, m: &Motion<V>, h: V) -> Self {
        let k = V::splat;
        let a2 = k(cam.spin * cam.spin);
        let h2 = h * h;
        let (a4, c6) = (m.a * k(4.0) * h2, m.c * k(6.0) * h2);
        let mut y = [h2; TERMS];
        let mut z = [h2; TERMS];
        for n in 1..TERMS {
            let (mut square, mut quotient) = (k(0.0), k(0.0));
            for i in 0..n {
                quotient = y[i].mul_add(z[n - 1 - i], quotient);
                if i + 1 < n {
                    square = y[i].mul_add(y[n - 2 - i], square);
                }
            }
            let nf = n as f64;
            y[n] =
                a4.mul_add(y[n - 1], c6 * square) * k(1.0 / ((2.0 * nf + 2.0) * (2.0 * nf + 1.0)));
            z[n] = a2.neg_mul_add(quotient, y[n]);
        }
        let (mut sum, mut slope, mut area, mut angle) = (k(0.0), k(0.0), k(0.0), k(0.0));
        for n in (0..TERMS).rev() {
            let order = 2.0 * n as f64 + 2.0;
            sum = sum + y[n];
            slope = y[n].mul_add(k(order), slope);
            area = y[n].mul_add(k(1.0 / (order + 1.0)), area);
            angle = z[n].mul_add(k(1.0 / (order + 1.0)), angle);
        }
        let s = sum.sqrt();
        let ds = slope / (s * h * k(2.0));
        let fall = -(m.c.mul_add(sum, m.a) * sum);
        let root = a2.mul_add(sum, k(1.0)).sqrt();
        let inv_root = k(1.0) / root;
        Self {
            bend: a2 * sum * k(2.0),
            half_bend: a2 * sum,
            rate_u: fall * k(2.0) / (ds + k(1.0)),
            rate_x: a2.mul_add(sum, fall) * k(2.0) / (root + ds) * inv_root,
            cross: a2 * s,
            turn: -(a2 * m.lambda * h * angle),
            lift: a2 * m.eta * h * area,
            s,
            root,
            twist: a2 * m.lambda * s * sum * inv_root,
        }
    }

    /// The state one step after the observer.
    #[inline(always)]
    pub fn start(&self, cam: &Camera, alpha: V, beta: V) -> (V, V, PolarState<V>) {
        let k = V::splat;
        let (x, u) = (k(cam.sin_i), k(cam.cos_i));
        (x, u, self.leave(x, u, [beta * k(-cam.cos_i), alpha, beta * k(cam.sin_i)]))
    }

    /// The state one step after the point (x, 0, u) that is left with the velocity v.
    #[inline(always)]
    pub fn leave(&self, x: V, u: V, [vx, vy, vu]: [V; 3]) -> PolarState<V> {
        let k = V::splat;
        let e = self.half_bend * u * u;
        let rho = (e + k(1.0)).recip();
        let speed = self.s * self.root;
        let du = (self.s * vu - u * self.rate_u.mul_add(k(0.5), e)) * rho;
        let dx = (speed * vx - x * self.rate_x.mul_add(k(0.5), e)) * rho;
        let dy = (speed * vy + self.twist * x) * rho;
        PolarState { x: x + dx, y: dy, u: u + du, dx, dy, du }
    }

    /// The direction one step after `from`, in the frame that turns by [`turn`](Self::turn)
    /// meanwhile.
    #[inline(always)]
    pub fn jump(&self, from: &Direction<V>) -> [V; 3] {
        let [x, y, u] = from.n;
        let [vx, vy, vu] = from.velocity;
        let e = self.half_bend * u * u;
        let rho = (e + V::splat(1.0)).recip();
        let speed = self.s * self.root;
        let fall = self.rate_x.mul_add(V::splat(0.5), e);
        let dx = speed * vx - self.twist.mul_add(y, fall * x);
        let dy = speed * vy + (self.twist * x - fall * y);
        let du = self.s * vu - self.rate_u.mul_add(V::splat(0.5), e) * u;
        [dx.mul_add(rho, x), dy.mul_add(rho, y), du.mul_add(rho, u)]
    }

    /// Its third component alone.
    #[inline(always)]
    pub fn jump_u(&self, u: V, speed: V) -> V {
        let e = self.half_bend * u * u;
        let du = self.s * speed - self.rate_u.mul_add(V::splat(0.5), e) * u;
        du.mul_add((e + V::splat(1.0)).recip(), u)
    }

    /// du/dτ where a jump from `from` has led to u.
    #[inline(always)]
    pub fn arrive_u(&self, from: V, u: V) -> V {
        let e = self.half_bend * u * u;
        let rise = (u - from) * (e + V::splat(1.0));
        self.rate_u.mul_add(V::splat(0.5), e).neg_mul_add(u, rise) / self.s
    }

    /// The velocity where a jump from `from` has led to `n`.
    #[inline(always)]
    pub fn arrive(&self, from: &Direction<V>, n: [V; 3]) -> [V; 3] {
        let [x, y, u] = n;
        let e = self.half_bend * u * u;
        let weight = e + V::splat(1.0);
        let fall = self.rate_x.mul_add(V::splat(0.5), e);
        let over = (self.s * self.root).recip();
        let vx = (x - from.n[0]) * weight + (self.twist * y - fall * x);
        let vy = (y - from.n[1]) * weight - self.twist.mul_add(x, fall * y);
        [vx * over, vy * over, self.arrive_u(from.n[2], u)]
    }

    /// One step on.
    #[inline(always)]
    pub fn advance(&self, n: PolarState<V>) -> PolarState<V> {
        // ρ is needed last, so that the chain from u to the next u stays short.
        let u2 = n.u * n.u;
        let rho = self.half_bend.mul_add(u2, V::splat(1.0)).recip();
        let fu = self.bend.mul_add(u2, self.rate_u);
        let fx = self.bend.mul_add(u2, self.rate_x);
        let (px, py, pu) = (fx * n.x, fx * n.y, fu * n.u);
        PolarState {
            x: rho.neg_mul_add(px, n.x + n.dx),
            y: rho.neg_mul_add(py, n.y + n.dy),
            u: rho.neg_mul_add(pu, n.u + n.du),
            dx: rho.neg_mul_add(px, n.dx),
            dy: rho.neg_mul_add(py, n.dy),
            du: rho.neg_mul_add(pu, n.du),
        }
    }

    /// `∫ a²u² dτ` over the step between neighbouring u, less [`Self::lift`].
    #[inline(always)]
    pub fn gain(&self, u: V, next: V, sum: V) -> V {
        (self.cross * u).mul_add(next, sum)
    }
}

/// An angle about the axis from atan2, in the sense ±1 in which the ray turns: between two points
/// of a ray at most half a revolution of the sphere apart that is up to half a turn and a little,
/// and never back.
#[inline(always)]
pub fn unwrap<V: Lanes<f64>>(angle: V, sense: V) -> V {
    let angle = angle * sense;
    let low = angle.lt(V::splat(-FRAC_PI_2));
    sense * V::select(low, angle + V::splat(TAU), angle)
}
