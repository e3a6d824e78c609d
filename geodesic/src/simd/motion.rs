//! The observer, the constants of a ray's motion, and the Mino time it takes.

use super::elliptic::{isolated_root, rf_pair};
use super::lanes::Lanes;
use crate::screen::observer::Observer;
use crate::spacetime::kerr::Kerr;

/// Captured rays are sampled down to where 1 − r₊/r is this: at the horizon itself azimuth
/// and time are infinite.
pub(super) const HORIZON_MARGIN: f64 = 1e-8;

/// Black hole and observer.
#[derive(Clone, Copy, Debug)]
pub struct Camera {
    /// Spin a, in units of M.
    pub spin: f64,
    /// Sine of the observer's inclination.
    pub sin_i: f64,
    /// Cosine of the observer's inclination.
    pub cos_i: f64,
    /// Inverse radius of the observer.
    pub w_obs: f64,
    /// Captured rays end where `1 − r₊/r` equals this.
    pub margin: f64,
}

impl Camera {
    /// `observer` around `hole`.
    pub fn new(hole: &Kerr, observer: &Observer) -> Self {
        Self {
            spin: hole.spin(),
            sin_i: observer.inclination().sin(),
            cos_i: observer.inclination().cos(),
            w_obs: observer.inverse_radius(),
            margin: HORIZON_MARGIN,
        }
    }

    /// `r₊ − r₋ = 2√((1 − a)(1 + a))`, kept positive so that ratios with it stay finite.
    #[inline(always)]
    pub fn horizon_gap(&self) -> f64 {
        (2.0 * ((1.0 - self.spin) * (1.0 + self.spin)).max(0.0).sqrt()).max(1e-100)
    }

    /// Outer horizon.
    #[inline(always)]
    pub fn r_plus(&self) -> f64 {
        1.0 + 0.5 * self.horizon_gap()
    }

    /// Inner horizon, `a²/r₊`.
    #[inline(always)]
    pub fn r_minus(&self) -> f64 {
        self.spin * self.spin / self.r_plus()
    }

    /// Returns the w at which captured rays end.
    #[inline(always)]
    pub fn w_end(&self) -> f64 {
        (1.0 - self.margin) / self.r_plus()
    }
}

/// Constants of the motion: `W(w) = 1 + A w² + B w³ + C w⁴`.
#[derive(Clone, Copy)]
pub struct Motion<V> {
    /// Axial angular momentum per energy, λ.
    pub lambda: V,
    /// Carter's constant per energy squared, η.
    pub eta: V,
    /// `K = η + λ²`.
    pub k: V,
    /// `A = a² − K`.
    pub a: V,
    /// `B = 2[η + (λ − a)²]`.
    pub b: V,
    /// `C = −a² η`.
    pub c: V,
    /// `κ = a² − aλ`.
    pub kappa: V,
}

impl<V: Lanes<f64>> Motion<V> {
    /// The ray that arrives at (α, β).
    #[inline(always)]
    pub fn new(cam: &Camera, alpha: V, beta: V) -> Self {
        let s = V::splat;
        let a2 = cam.spin * cam.spin;
        let lambda = alpha * s(-cam.sin_i);
        let eta = alpha.mul_add(alpha, s(-a2)).mul_add(s(cam.cos_i * cam.cos_i), beta * beta);
        let k = lambda.mul_add(lambda, eta);
        let l = lambda - s(cam.spin);
        let b = l.mul_add(l, eta);
        Self {
            lambda,
            eta,
            k,
            a: s(a2) - k,
            b: b + b,
            c: eta * s(-a2),
            kappa: s(cam.spin) * (s(cam.spin) - lambda),
        }
    }

    /// `W(w)`.
    #[inline(always)]
    pub fn radial(&self, w: V) -> V {
        let p = self.c.mul_add(w, self.b).mul_add(w, self.a);
        (w * w).mul_add(p, V::splat(1.0))
    }

    /// Weierstrass invariants (g₂, g₃) of the radial motion.
    #[inline(always)]
    pub fn radial_invariants(&self) -> (V, V) {
        let (a, b, c) = (self.a, self.b, self.c);
        let g2 = (a * a).mul_add(V::splat(1.0 / 12.0), c);
        let g3 = a * c * V::splat(1.0 / 6.0)
            - b * b * V::splat(1.0 / 16.0)
            - a * a * a * V::splat(1.0 / 216.0);
        (g2, g3)
    }

    /// The scale of all frequencies, `max(1, K)`.
    #[inline(always)]
    pub fn stiffness(&self) -> V {
        self.k.max(V::splat(1.0))
    }
}

/// Mino time of the radial motion as a function of the radius: with z the time since an observer
/// at infinity, `℘(z) = (1 + w')/(2w²) + A/12`, so that z is one `R_F`.
#[derive(Clone, Copy)]
pub struct Clock<V> {
    /// The isolated root of `4t³ − g₂t − g₃`.
    e: V,
    /// The mean of the others, `−e/2`.
    half: V,
    /// Half their difference, squared.
    gap: V,
    shift: V,
}

impl<V: Lanes<f64>> Clock<V> {
    /// Starts the sum of one motion.
    #[inline(always)]
    pub fn new(m: &Motion<V>) -> Self {
        let s = V::splat;
        let (g2, g3) = m.radial_invariants();
        let e = isolated_root(g2, g3, m.stiffness() * s(1.0 / 6.0));
        let gap = (e * e).neg_mul_add(s(0.75), g2 * s(0.25));
        Self { e, half: e * s(-0.5), gap, shift: m.a * s(1.0 / 12.0) }
    }

    /// The time at which ℘ has the value p.
    #[inline(always)]
    fn read(&self, p: V) -> V {
        rf_pair(p - self.e, p - self.half, self.gap)
    }

    /// Returns the time from infinity inwards to the point w > 0 that is passed at the speed w'.
    #[inline(always)]
    pub fn until(&self, w: V, speed: V) -> V {
        self.read((speed + V::splat(1.0)) / (w * w * V::splat(2.0)) + self.shift)
    }
}

/// Duration of a ray, and its outcome.
#[derive(Clone, Copy)]
pub struct Journey<V> {
    /// Mino time from the observer to the end of the ray.
    pub duration: V,
    /// One if the ray turns and returns to the observer's radius, zero if it is captured.
    pub escapes: V,
    /// Amplification of errors by the photon orbit: 1/(distance from the critical curve), up to a factor of order 1; one
    /// for rays that pass it at a distance.
    pub condition: V,
    /// Radius where rays that escape turn.
    pub r_turn: V,
}

impl<V: Lanes<f64>> Journey<V> {
    /// Classifies the ray and measures its Mino time.
    #[inline(always)]
    pub fn new(cam: &Camera, m: &Motion<V>) -> Self {
        Self::by(&Clock::new(m), cam, m)
    }

    /// [`new`](Self::new) with the ray's own clock.
    #[inline(always)]
    pub fn by(clock: &Clock<V>, cam: &Camera, m: &Motion<V>) -> Self {
        let s = V::splat;
        let Clock { e, half, gap, .. } = *clock;
        // Far from the hole the two lesser roots coincide within rounding: their gap is 0 there, not below it.
        let rounding = V::select(s(0.0).lt(e), e * e * s(1e-12), s(0.0));
        let is_alone = (gap + rounding).lt(s(0.0));
        let smallest = V::select(is_alone, e, e.min(half - gap.max(s(0.0)).sqrt()));
        // Ferrari: r = z ± √(−A/2 − z² − B/(4z)), z² = −A/6 − (the smallest root).
        let z2 = m.a.mul_add(s(-1.0 / 6.0), -smallest).max(s(1e-30));
        let z = z2.sqrt();
        let turn = m.a.mul_add(s(-0.5), -z2) - m.b * s(0.25) / z;
        let r_turn = z + turn.max(s(0.0)).sqrt();
        let escapes = V::both(s(0.0).lt(turn), s(cam.r_plus()).lt(r_turn));
        let at_turn = (r_turn * r_turn).mul_add(s(0.5), clock.shift);
        let w_end = s(cam.w_end());
        // W = (1 + κw²)² − (B/2) w² (1 − r₊w)(1 − r₋w): positive terms dominate at the horizon.
        let p = m.kappa.mul_add(w_end * w_end, s(1.0));
        let near =
            s(cam.margin * (1.0 - cam.r_minus() * cam.w_end()) * cam.w_end() * cam.w_end() * 0.5);
        let speed = p.mul_add(p, -(m.b * near)).max(s(0.0)).sqrt();
        let at_end = (speed + s(1.0)) / (w_end * w_end * s(2.0)) + clock.shift;
        let end = clock.read(V::select(escapes, at_turn, at_end));
        let mut inward = end;
        if cam.w_obs > 0.0 {
            let w_obs = s(cam.w_obs);
            inward = end - clock.until(w_obs, m.radial(w_obs).sqrt());
        }
        Self {
            duration: V::select(escapes, inward + inward, inward),
            escapes: V::select(escapes, s(1.0), s(0.0)),
            condition: condition(m.stiffness(), e, gap),
            r_turn,
        }
    }
}

/// [`Journey::condition`] of a ray from the isolated root e of the cubic and the square of half the difference of the two
/// others. With e < 0 these nearly coincide next to the critical curve, and the Mino time is the logarithm of their
/// difference over √(3|e|/2). Scaled to be 1/(distance) for a hole without spin.
///
/// Returns the condition. At the tips of the straight part of an extremal hole's critical curve all three coincide,
/// whatever the sign of e: they then lose as many more digits as they are smaller than η + λ².
#[inline(always)]
fn condition<V: Lanes<f64>>(b2: V, e: V, gap: V) -> V {
    /// The largest root below which a ray passes a tip: no photon orbit of a spin up to 0.9999 has one as small.
    const TIP: f64 = 0.05;
    let s = V::splat;
    let amplified = |rate: V| b2 * b2 / (gap.abs().max(s(1e-300)) * rate.sqrt() * s(36.0));
    let rate = |root: V| (root / b2).max(s(1e-12)) * s(6.0);
    let near_critical = V::select(e.lt(s(0.0)), amplified(rate(e.abs())), s(1.0));
    let largest = rate(e.abs() + gap.abs().sqrt());
    let at_tip = V::both(largest.lt(s(TIP)), s(1.0).lt(b2));
    V::select(at_tip, amplified(largest) / largest, near_critical)
}
