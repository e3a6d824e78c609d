//! The polar motion to a ray's equatorial crossings.

use super::elliptic::{agm, rf_from};
use super::lanes::Lanes;
use super::math::atan2;
use super::motion::{Camera, Motion};
use super::polar::{PolarState, PolarStep};
use core::f64::consts::PI;

/// The polar motion along equal steps, but for what is proportional to the number of them.
pub(super) struct PolarSum<V> {
    step: PolarStep<V>,
    ahead: PolarState<V>,
    x: V,
    y: V,
    u: V,
    sum: V,
}

impl<V: Lanes<f64>> PolarSum<V> {
    #[inline(always)]
    pub fn at_observer(cam: &Camera, m: &Motion<V>, h: V, alpha: V, beta: V) -> Self {
        let zero = V::splat(0.0);
        let step = PolarStep::new(cam, m, h);
        let (x, u, ahead) = step.start(cam, alpha, beta);
        Self { step, ahead, x, y: zero, u, sum: zero }
    }

    #[inline(always)]
    pub fn at_equator(cam: &Camera, m: &Motion<V>, h: V) -> Self {
        let (zero, one) = (V::splat(0.0), V::splat(1.0));
        let step = PolarStep::new(cam, m, h);
        let rise = m.eta.max(zero).sqrt();
        let ahead = step.leave(one, zero, [zero, -m.lambda, rise]);
        Self { step, ahead, x: one, y: zero, u: zero, sum: zero }
    }

    #[inline(always)]
    pub fn next(&mut self) {
        let PolarState { x, y, u, .. } = self.ahead;
        self.sum = self.step.gain(self.u, u, self.sum);
        self.ahead = self.step.advance(self.ahead);
        (self.x, self.y, self.u) = (x, y, u);
    }

    /// Angle about the axis since the start, but for whole turns, in the turning frame.
    #[inline(always)]
    pub fn angle(&self) -> V {
        atan2(self.y, self.x)
    }

    /// Returns the angle by which the frame has turned.
    #[inline(always)]
    pub fn turned(&self, steps: usize) -> V {
        self.step.turn * V::splat(steps as f64)
    }

    /// `∫a²u² dτ`.
    #[inline(always)]
    pub fn time(&self, steps: usize) -> V {
        self.step.lift.mul_add(V::splat(steps as f64), self.sum)
    }
}

/// Mino times of the first zero of u after the start, and from there to the next; infinite if
/// there is none. The latter only where it is needed for the former or where `u₀ = 0`.
#[inline(always)]
pub(super) fn polar_times<V: Lanes<f64>>(cam: &Camera, m: &Motion<V>, beta: V) -> (V, V) {
    let s = V::splat;
    let (zero, never) = (s(0.0), s(f64::INFINITY));
    let half_a = m.a * s(0.5);
    let d = half_a.mul_add(half_a, -m.c);
    let rd = d.max(zero).sqrt();
    // u'² = (u₊ − u²)(Q₊ + a²u²), with Q₊ + a²u₊ = 2√d.
    let slow = V::select(zero.lt(half_a), -m.c / (half_a + rd), rd - half_a);
    let oscillates = V::both(zero.lt(m.eta), zero.lt(slow));
    let safe = V::select(oscillates, slow, s(1.0));
    let half = s(PI) / agm(safe.sqrt(), V::select(oscillates, rd + rd, s(1.0)).sqrt());
    let half = V::select(oscillates, half, never);
    if cam.cos_i == 0.0 {
        return (half, half);
    }
    // Twice Q is b + √(b² − 4C), b = c² − A; C < 0 where u has zeros.
    let c = beta * s(cam.sin_i / cam.cos_i);
    let b = c.mul_add(c, -m.a);
    let root = b.mul_add(b, m.c * s(-4.0)).max(zero).sqrt();
    let sum = b.abs() + root;
    let q = V::select(b.lt(zero), m.c * s(-2.0) / sum, sum * s(0.5));
    // The product of the pair is Q² + A Q + C = c² Q, free of cancellation.
    let near = rf_from(q, q + half_a, d, c * c * q);
    let first = V::select(zero.lt(c), half - near, near);
    (V::select(oscillates, first, never), half)
}
