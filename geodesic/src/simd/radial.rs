//! Equidistant samples of the radial motion and of the radial parts of azimuth and time.
//!
//! `w(τ)` is an elliptic function of order two, so `w(τ ± h)` are the two roots of a quadratic
//! whose coefficients are quadratics in `w(τ)`. With `v = 1/℘(h)`:
//!
//! ```text
//! w₊ − 2w + w₋ = N(w)/D(w)         w' = (w₊ − w₋) D(w)/v'(h)
//! D = 1 − A v/6 + (A²/144 − C/4) v² + w (A B v²/24 − B v/2) + w² ((B²/16 − AC/6) v² − C v)
//! N = B v²/4 + w (A v + (C − A²/12) v²) + w² (3B v/2 − A B v²/8) + w³ (2C v + (AC/3 − B²/8) v²)
//! ```

use super::elliptic::reciprocal_weierstrass;
use super::lanes::Lanes;
use super::math::{SMALL_LOG, ln, small_log};
use super::motion::{Camera, Motion};

/// Points on either side of an interval that its quadrature uses.
pub const REACH: usize = 5;

/// `∫₀¹ f = Σ cₖ (f(−k) + f(1 + k))`, exact for degree `2·REACH − 1`.
pub(super) const INTERVAL: [f64; REACH] = [
    2067169.0 / 3628800.0,
    -40111.0 / 453600.0,
    581.0 / 25920.0,
    -28939.0 / 7257600.0,
    2497.0 / 7257600.0,
];

/// Weights of the trapezoidal rule's end corrections: `∫₀ᴺ f` is the sum of f at the nodes, half
/// of it at the ends, plus `Σ dₖ (f(N + k) − f(N − k) − f(k) + f(−k))`. It is the sum of
/// [`INTERVAL`] over all intervals, `d₁ = ½ − c₀`, `dₖ₊₁ = dₖ − cₖ`.
pub(super) const END: [f64; REACH - 1] = {
    let mut d = [0.5 - INTERVAL[0]; REACH - 1];
    let mut k = 1;
    while k < REACH - 1 {
        d[k] = d[k - 1] - INTERVAL[k];
        k += 1;
    }
    d
};

/// The addition theorem of `w` for one fixed step h.
#[derive(Clone, Copy)]
pub struct RadialStep<V> {
    num: [V; 4],
    den: [V; 3],
    inv_slope: V,
    slope: V,
}

/// Two neighbouring values of `w`: the present one and the step that led to it.
#[derive(Clone, Copy)]
pub struct RadialState<V> {
    /// `w`.
    pub w: V,
    /// `w − w₋`.
    pub dw: V,
}

impl<V: Lanes<f64>> RadialStep<V> {
    /// Coefficients for the step h.
    #[inline(always)]
    pub fn new(m: &Motion<V>, h: V) -> Self {
        let s = V::splat;
        let (g2, g3) = m.radial_invariants();
        let (v, slope) = reciprocal_weierstrass(g2, g3, h);
        let (a, b, c) = (m.a, m.b, m.c);
        let v2 = v * v;
        let (ab, ac, bb, aa) = (a * b, a * c, b * b, a * a);
        Self {
            num: [
                b * v2 * s(0.25),
                a.mul_add(v, aa.neg_mul_add(s(1.0 / 12.0), c) * v2),
                b * v * s(1.5) - ab * v2 * s(0.125),
                c * v * s(2.0) + (ac * s(1.0 / 3.0) - bb * s(0.125)) * v2,
            ],
            den: [
                s(1.0) - a * v * s(1.0 / 6.0) + (aa * s(1.0 / 144.0) - c * s(0.25)) * v2,
                ab * v2 * s(1.0 / 24.0) - b * v * s(0.5),
                (bb * s(1.0 / 16.0) - ac * s(1.0 / 6.0)) * v2 - c * v,
            ],
            inv_slope: s(1.0) / slope,
            slope,
        }
    }

    #[inline(always)]
    fn numerator(&self, w: V) -> V {
        let [n0, n1, n2, n3] = self.num;
        n3.mul_add(w, n2).mul_add(w, n1).mul_add(w, n0)
    }

    #[inline(always)]
    fn denominator(&self, w: V) -> V {
        let [d0, d1, d2] = self.den;
        d2.mul_add(w, d1).mul_add(w, d0)
    }

    /// The states one step after and one step before the point (w, w'), each as seen
    /// when moving away from it.
    #[inline(always)]
    pub fn start(&self, w: V, speed: V) -> (RadialState<V>, RadialState<V>) {
        let half = (self.denominator(w) * V::splat(2.0)).recip();
        let n = self.numerator(w);
        let t = self.slope * speed;
        let (up, down) = ((n + t) * half, (n - t) * half);
        (RadialState { w: w + up, dw: up }, RadialState { w: w + down, dw: down })
    }

    /// `w` one step after the point (w, w').
    #[inline(always)]
    pub fn jump(&self, w: V, speed: V) -> V {
        let up = self.slope.mul_add(speed, self.numerator(w));
        up.mul_add((self.denominator(w) * V::splat(2.0)).recip(), w)
    }

    /// `w'` at the point w that a step from the point `from` has led to.
    #[inline(always)]
    pub fn arrive(&self, from: V, w: V) -> V {
        let back = (from - w) * V::splat(2.0);
        back.neg_mul_add(self.denominator(w), self.numerator(w)) * self.inv_slope
    }

    /// One step on; also `w'` at the point that is left.
    #[inline(always)]
    pub fn advance(&self, now: RadialState<V>) -> (RadialState<V>, V) {
        let d = self.denominator(now.w);
        let (n, inverse) = (self.numerator(now.w), d.recip());
        let dw = n.mul_add(inverse, now.dw);
        let speed = (dw + now.dw) * (d * self.inv_slope);
        (RadialState { w: n.mul_add(inverse, now.w + now.dw), dw }, speed)
    }
}

/// Length of the ring of nodes, a power of two that holds the reach on both sides.
const RING: usize = (2 * REACH).next_power_of_two();

/// The nodes from `1 − REACH` to `REACH` around the current one. Apart from [`RadialRun`], which
/// the compiler keeps in registers only if nothing in it is reached by a variable index.
pub struct Ring<V> {
    /// The integrands, in a ring that is there twice, so that they always lie in a row.
    nodes: [[V; 2]; 2 * RING],
    /// `w`, in a ring.
    inverse: [V; RING],
}

impl<V: Lanes<f64>> Ring<V> {
    /// Starts without nodes.
    #[inline(always)]
    pub fn new() -> Self {
        let zero = V::splat(0.0);
        Self { nodes: [[zero; 2]; 2 * RING], inverse: [zero; RING] }
    }

    /// Puts node number `at` in.
    #[inline(always)]
    fn put(&mut self, at: usize, Node { w, f0, f2 }: Node<V>) {
        let at = at % RING;
        self.nodes[at] = [f0, f2];
        self.nodes[at + RING] = [f0, f2];
        self.inverse[at] = w;
    }

    /// Integrands at `N` nodes from number `from` on.
    #[inline(always)]
    fn window<const N: usize>(&self, from: usize) -> [[V; 2]; N] {
        // The length is there wherever it starts.
        self.nodes[from % RING..].first_chunk().copied().unwrap_or([[V::splat(0.0); 2]; N])
    }
}

/// `w`, `1/g`, `w²/g` at a node.
#[derive(Clone, Copy)]
pub(super) struct Node<V> {
    pub w: V,
    pub f0: V,
    pub f2: V,
}

impl<V: Lanes<f64>> Node<V> {
    #[inline(always)]
    pub fn new(w: V, speed: V, kappa: V) -> Self {
        let w2 = w * w;
        let f0 = (kappa.mul_add(w2, V::splat(1.0)) + speed).recip();
        Self { w, f0, f2: w2 * f0 }
    }
}

/// The radial motion and its two integrals along a ray, node by node.
///
/// Quadrature yields `G₀ = (B/2) ∫ dτ/g` and `G₂ = (B/2) ∫ w² dτ/g` with `g = 1 + κw² + w'`.
/// The closed-form terms grow by logarithms of ratios of neighbouring nodes, with
/// `p = 1 − r₊w` and `q = 1 − r₋w`:
///
/// ```text
/// F = ln(r − r₋)                           F₁ − F₀ = 2 artanh[−(w₁ − w₀)/(q₁w₀ + q₀w₁)]
/// Λ = ln[(r − r₊)/(r − r₋)]/(r₊ − r₋)      Λ₁ − Λ₀ = 2 artanh[(r₊ − r₋) e]/(r₊ − r₋)
///                                          e = −(w₁ − w₀)/(p₁q₀ + p₀q₁)
/// ```
pub struct RadialRun<V> {
    step: RadialStep<V>,
    ahead: RadialState<V>,
    /// Number of the current node.
    at: usize,
    /// The sums of the trapezoidal rule for ∫dτ/g and ∫w² dτ/g, in units of h, with the end
    /// correction of the start.
    sum: [V; 2],
    /// `h B/2`.
    scale: V,
    w: V,
    r: V,
    p: V,
    q: V,
    /// F, from zero at an observer at finite radius.
    far: V,
    /// Λ, from zero at the observer.
    lambda: V,
    kappa: V,
    r_plus: f64,
    r_minus: f64,
    gap: f64,
    spin: f64,
}

impl<V: Lanes<f64>> RadialRun<V> {
    /// Starts at the observer.
    #[inline(always)]
    pub fn new(cam: &Camera, m: &Motion<V>, h: V, ring: &mut Ring<V>) -> Self {
        let step = RadialStep::new(m, h);
        let w = V::splat(cam.w_obs);
        let speed = m.radial(w).sqrt();
        let (mut ahead, mut behind) = step.start(w, speed);
        let zero = V::splat(0.0);
        ring.put(REACH - 1, Node::new(w, speed, m.kappa));
        for k in 1..REACH {
            let (before, back) = step.advance(behind);
            // Moving backwards, w' of the forward motion has the other sign.
            let node = Node::new(behind.w, -back, m.kappa);
            ring.put(REACH - 1 - k, node);
            behind = before;
            let (after, speed) = step.advance(ahead);
            ring.put(REACH - 1 + k, Node::new(ahead.w, speed, m.kappa));
            ahead = after;
        }
        let mut run = Self {
            step,
            ahead,
            at: 0,
            sum: [zero; 2],
            scale: h * m.b * V::splat(0.5),
            w,
            r: w.recip(),
            p: V::splat(1.0 - cam.r_plus() * cam.w_obs),
            q: V::splat(1.0 - cam.r_minus() * cam.w_obs),
            far: zero,
            lambda: zero,
            kappa: m.kappa,
            r_plus: cam.r_plus(),
            r_minus: cam.r_minus(),
            gap: cam.horizon_gap(),
            spin: cam.spin,
        };
        // Zero at the start.
        let [g0, g2] = run.integrals(ring);
        run.sum = [-g0, -g2];
        run
    }

    /// Goes to the next node.
    #[inline(always)]
    pub fn next(&mut self, ring: &mut Ring<V>) {
        self.integrate(ring);
        let w = ring.inverse[(self.at + REACH - 1) % RING];
        self.grow(w, w.neg_mul_add(V::splat(self.r_plus), V::splat(1.0)));
    }

    /// Goes to the next node, whose `w` and `1 − r₊w` are known otherwise.
    #[inline(always)]
    pub fn end_at(&mut self, ring: &mut Ring<V>, w: f64, outer: f64) {
        self.integrate(ring);
        self.grow(V::splat(w), V::splat(outer));
    }

    /// The integrals.
    #[inline(always)]
    fn integrate(&mut self, ring: &mut Ring<V>) {
        let (next, speed) = self.step.advance(self.ahead);
        let node = Node::new(self.ahead.w, speed, self.kappa);
        self.ahead = next;
        ring.put(self.at + 2 * REACH - 1, node);
        let [here, there] = ring.window(self.at + REACH - 1);
        let half = V::splat(0.5);
        self.sum[0] = (here[0] + there[0]).mul_add(half, self.sum[0]);
        self.sum[1] = (here[1] + there[1]).mul_add(half, self.sum[1]);
        self.at += 1;
    }

    /// The integrals from an end correction to the current node.
    #[inline(always)]
    fn integrals(&self, ring: &Ring<V>) -> [V; 2] {
        let [mut g0, mut g2] = self.sum;
        let nodes = ring.window::<{ 2 * REACH - 1 }>(self.at);
        for (k, d) in END.into_iter().enumerate().rev() {
            let (after, before) = (nodes[REACH + k], nodes[REACH - 2 - k]);
            g0 = V::splat(d).mul_add(after[0] - before[0], g0);
            g2 = V::splat(d).mul_add(after[1] - before[1], g2);
        }
        [g0, g2]
    }

    /// The logarithms.
    #[inline(always)]
    fn grow(&mut self, w: V, p: V) {
        let s = V::splat;
        let q = w.neg_mul_add(s(self.r_minus), s(1.0));
        let fall = self.w - w;
        // Three reciprocals by one division.
        let (outer, inner) = (p.mul_add(self.q, self.p * q), q.mul_add(self.w, self.q * w));
        let near = inner * w;
        let all = (outer * near).recip();
        let e = fall * (all * near);
        let rest = all * outer;
        let y = fall * (rest * w);
        self.r = rest * inner;
        let x = e * s(self.gap);
        let mut lambda = e * small_log(x);
        let mut far = y * small_log(y);
        let small = x.abs().max(y.abs()).lt(s(SMALL_LOG));
        if !V::all(small) {
            let near = x.abs().lt(s(SMALL_LOG));
            if !V::all(near) {
                let large = ln((p * self.q) / (self.p * q)) * s(1.0 / self.gap);
                lambda = V::select(near, lambda, large);
            }
            // At infinity F is infinite and starts from ln(r − r₋) itself.
            let before = V::select(s(0.0).lt(self.w), self.w, s(1.0));
            far = ln((q * before) / (self.q * w));
        }
        self.far = self.far + far;
        self.lambda = self.lambda + lambda;
        (self.w, self.p, self.q) = (w, p, q);
    }

    /// Returns the parts at the current node: `r`, the radial part of time, `G₀ + a² G₂ − r − 2F −
    /// 2r₊Λ`, and that of azimuth, `−a G₂ + a Λ`, up to constants.
    #[inline(always)]
    pub fn parts(&self, ring: &Ring<V>) -> [V; 3] {
        let s = V::splat;
        let [g0, g2] = self.integrals(ring);
        let g2 = g2 * self.scale;
        let t = g0.mul_add(self.scale, g2 * s(self.spin * self.spin)) - self.r;
        let t = self.lambda.mul_add(s(-2.0 * self.r_plus), self.far.mul_add(s(-2.0), t));
        [self.r, t, (self.lambda - g2) * s(self.spin)]
    }
}
