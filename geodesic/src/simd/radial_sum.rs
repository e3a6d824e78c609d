//! Radial integrals from one point of a ray to another.

use super::lanes::Lanes;
use super::math::{SMALL_LOG, ln, small_log};
use super::motion::{Camera, Motion};
use super::radial::{END, Node, REACH, RadialState, RadialStep};

/// The least number of steps of a [`RadialSum`].
pub(crate) const LEAST_STEPS: usize = 2 * REACH - 1;

/// `∫dτ/g` and `∫w² dτ/g` from one point of a ray to another, without what lies between.
#[derive(Clone, Copy)]
pub struct RadialSum<V> {
    step: RadialStep<V>,
    ahead: RadialState<V>,
    kappa: V,
    sum: [V; 2],
    scale: V,
}

/// The end of a [`RadialSum`].
#[derive(Clone, Copy)]
pub struct RadialEnd<V> {
    pub w: V,
    /// `w'`.
    pub speed: V,
    /// `G₀ + a² G₂`, of the time.
    pub time: V,
    /// `G₂`, of the azimuth.
    pub turn: V,
}

impl<V: Lanes<f64>> RadialSum<V> {
    /// Starts from the point (w, w'), in at least [`LEAST_STEPS`] steps h.
    #[inline(always)]
    pub fn new(m: &Motion<V>, h: V, w: V, speed: V) -> Self {
        let step = RadialStep::new(m, h);
        let (mut ahead, mut behind) = step.start(w, speed);
        let first = Node::new(w, speed, m.kappa);
        let half = V::splat(0.5);
        let mut sum = [first.f0 * half, first.f2 * half];
        for d in END {
            let (before, back) = step.advance(behind);
            let near = Node::new(behind.w, -back, m.kappa);
            behind = before;
            let (after, speed) = step.advance(ahead);
            let far = Node::new(ahead.w, speed, m.kappa);
            ahead = after;
            let (d, rest) = (V::splat(d), V::splat(1.0 - d));
            sum[0] = near.f0.mul_add(d, far.f0.mul_add(rest, sum[0]));
            sum[1] = near.f2.mul_add(d, far.f2.mul_add(rest, sum[1]));
        }
        let scale = h * m.b * V::splat(0.5);
        Self { step, ahead, kappa: m.kappa, sum, scale }
    }

    /// One step of all but the last [`LEAST_STEPS`].
    #[inline(always)]
    pub fn next(&mut self) {
        let (next, speed) = self.step.advance(self.ahead);
        let node = Node::new(self.ahead.w, speed, self.kappa);
        self.ahead = next;
        self.sum[0] = self.sum[0] + node.f0;
        self.sum[1] = self.sum[1] + node.f2;
    }

    /// Adds the next node with a weight; its (w, w').
    #[inline(always)]
    fn weigh(&mut self, weight: f64) -> (V, V) {
        let (next, speed) = self.step.advance(self.ahead);
        let node = Node::new(self.ahead.w, speed, self.kappa);
        self.ahead = next;
        self.sum[0] = node.f0.mul_add(V::splat(weight), self.sum[0]);
        self.sum[1] = node.f2.mul_add(V::splat(weight), self.sum[1]);
        (node.w, speed)
    }

    /// The last steps.
    #[inline(always)]
    pub fn finish(mut self, cam: &Camera) -> RadialEnd<V> {
        for d in END.into_iter().rev() {
            self.weigh(1.0 - d);
        }
        let (w, speed) = self.weigh(0.5);
        for d in END {
            self.weigh(d);
        }
        let turn = self.sum[1] * self.scale;
        let time = turn.mul_add(V::splat(cam.spin * cam.spin), self.sum[0] * self.scale);
        RadialEnd { w, speed, time, turn }
    }
}

/// Returns the gain of time and azimuth over the Mino time `rest`, in `steps`, from `from`, where the closed forms are
/// `closed`, to the turning point; and w there.
#[inline(always)]
pub fn to_turning_point<V: Lanes<f64>>(
    (camera, motion): (&Camera, &Motion<V>),
    (rest, steps): (V, usize),
    from: &RadialEnd<V>,
    closed: [V; 2],
) -> [V; 3] {
    let s = V::splat;
    let mut run = RadialSum::new(motion, rest * s(1.0 / steps as f64), from.w, from.speed);
    for _ in LEAST_STEPS..steps {
        run.next();
    }
    let turn = run.finish(camera);
    let at_turn = closed_forms(camera, turn.w);
    let dt = turn.time + (closed[0] - at_turn[0]);
    let dphi = turn.turn.neg_mul_add(s(camera.spin), at_turn[1] - closed[1]);
    [dt, dphi, turn.w]
}

/// The closed-form terms of time and azimuth at w, `r + 2F + 2r₊Λ` and `aΛ`; for w = 0, zero in
/// place of the infinite one.
#[inline(always)]
pub fn closed_forms<V: Lanes<f64>>(cam: &Camera, w: V) -> [V; 2] {
    let s = V::splat;
    let one = s(1.0);
    // At the horizon, what rounding leaves of it.
    let p = w.neg_mul_add(s(cam.r_plus()), one).max(s(f64::EPSILON));
    let q = w.neg_mul_add(s(cam.r_minus()), one);
    let e = -(w * (p + q).recip());
    let x = e * s(cam.horizon_gap());
    let small = x.abs().lt(s(SMALL_LOG));
    let mut lambda = e * small_log(x);
    if !V::all(small) {
        lambda = V::select(small, lambda, ln(p / q) * s(1.0 / cam.horizon_gap()));
    }
    let finite = s(0.0).lt(w);
    let w = V::select(finite, w, one);
    let time = lambda.mul_add(s(2.0 * cam.r_plus()), ln(q / w).mul_add(s(2.0), w.recip()));
    [V::select(finite, time, s(0.0)), lambda * s(cam.spin)]
}
