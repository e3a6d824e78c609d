//! One block of rays, sampled equidistantly in Mino time.

use super::column::Aligned;
use super::error::{MAX_STEP, estimate, speed_of_samples};
use super::lanes::{CHUNK, Lanes, MAX_LANES, Pair, Task, transpose_plain};
use super::math::{SMALL_ANGLE, atan2, small_asin, small_atan};
use super::motion::{Camera, Journey, Motion};
use super::polar::{PolarState, PolarStep, unwrap};
use super::radial::{RadialRun, Ring};

/// Destination of the samples of a block of rays, ray after ray.
pub(super) struct Target<'a> {
    pub delay: &'a mut [f64],
    pub radius: &'a mut [f64],
    pub theta: &'a mut [f64],
    pub azimuth: &'a mut [f64],
    /// Mino time of each whole ray.
    pub duration: &'a mut [f64],
    /// True if each ray returns to the observer's radius (1) or is captured (0).
    pub escapes: &'a mut [f64],
    /// First the condition of each ray, then an estimate of the error of its positions.
    pub error: &'a mut [f64],
}

/// Rays to be sampled.
#[derive(Clone, Copy, Debug)]
pub(super) struct Rays<'a> {
    pub camera: Camera,
    pub alpha: &'a [f64],
    pub beta: &'a [f64],
    /// Samples per ray, at least 2.
    pub per_ray: usize,
}

/// The work of one block of rays, at any width of lanes.
pub(super) struct Block<'a, 'b> {
    pub rays: Rays<'a>,
    pub out: &'b mut Target<'a>,
}

impl Task<f64> for Block<'_, '_> {
    type Output = ();

    #[inline(always)]
    fn run<V: Lanes<f64>>(self) {
        let Self { rays, out } = self;
        plan::<Pair<V>>(&rays, out);
        let order = arrange(&rays, out);
        let mut radial = vec![[V::splat(0.0); 3]; rays.per_ray];
        for group in order.chunk_by(|a, b| a.key == b.key) {
            for block in group.chunks(V::LANES) {
                let Some(Item { key, .. }) = block.first() else { continue };
                // Worth its own code where the arithmetic is fast.
                let plain = V::LANES > 2 && key.fine == 1;
                match (key.escapes, plain) {
                    (true, true) => sample_block::<V, true, true>(&rays, block, &mut radial, out),
                    (false, true) => sample_block::<V, false, true>(&rays, block, &mut radial, out),
                    (true, false) => sample_block::<V, true, false>(&rays, block, &mut radial, out),
                    _ => sample_block::<V, false, false>(&rays, block, &mut radial, out),
                }
            }
        }
    }
}

/// Durations and fates of all rays.
#[inline(always)]
fn plan<V: Lanes<f64>>(rays: &Rays<'_>, out: &mut Target<'_>) {
    let inputs = rays.alpha.chunks(V::LANES).zip(rays.beta.chunks(V::LANES));
    let outputs = out.duration.chunks_mut(V::LANES).zip(out.escapes.chunks_mut(V::LANES));
    let outputs = outputs.zip(out.error.chunks_mut(V::LANES));
    for ((alpha, beta), ((duration, escapes), error)) in inputs.zip(outputs) {
        let motion = Motion::new(&rays.camera, V::load(alpha), V::load(beta));
        let journey = Journey::new(&rays.camera, &motion);
        journey.duration.store(duration);
        journey.escapes.store(escapes);
        journey.condition.store(error);
    }
}

/// Rays with equal keys share a block.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
struct Key {
    escapes: bool,
    /// Steps per sample.
    fine: u32,
}

#[derive(Clone, Copy)]
struct Item {
    key: Key,
    ray: usize,
}

/// The rays, those of one kind together, otherwise in their own order. Conditions become errors.
fn arrange(rays: &Rays<'_>, out: &mut Target<'_>) -> Vec<Item> {
    let camera = &rays.camera;
    let last = (rays.per_ray - 1) as f64;
    let screen = rays.alpha.iter().zip(rays.beta);
    let fates = out.duration.iter().zip(out.escapes.iter()).zip(out.error.iter_mut());
    let mut order = Vec::with_capacity(out.duration.len());
    for (ray, ((alpha, beta), ((duration, escapes), error))) in screen.zip(fates).enumerate() {
        let motion = Motion::new(camera, *alpha, *beta);
        let b = motion.stiffness().sqrt();
        let (escapes, h) = (*escapes > 0.5, duration / last);
        let fine = (b * h * (1.0 / MAX_STEP)).ceil().clamp(1.0, 1e6);
        let speed = speed_of_samples(camera, &motion, h, escapes);
        *error = estimate(*error, b, speed, b * h / fine, 1.0);
        order.push(Item { key: Key { escapes, fine: fine as u32 }, ray });
    }
    order.sort_by_key(|item| item.key);
    order
}

/// Radius and the radial parts of time and azimuth, at the samples of the inward leg.
type Radial<V> = [V; 3];

/// Distance ahead of the samples being computed at which their places in memory are called up.
const AHEAD: usize = 8;

/// Asks for the line of `v[index]` with the intent to write it.
#[inline(always)]
fn prefetch(v: &[f64], index: usize) {
    #[cfg(target_arch = "x86_64")]
    if let Some(x) = v.get(index) {
        use core::arch::x86_64::{_MM_HINT_ET0, _mm_prefetch};
        // SAFETY: prefetching has no effect on memory contents.
        unsafe { _mm_prefetch::<_MM_HINT_ET0>(core::ptr::from_ref(x).cast()) };
    }
    #[cfg(not(target_arch = "x86_64"))]
    let _ = (v, index);
}

/// One lane's worth of `source` for every ray of the block, the last one repeated.
#[inline(always)]
fn gather<V: Lanes<f64>>(source: &[f64], block: &[Item]) -> V {
    let mut lanes = [0.0; 16];
    let mut last = 0.0;
    for (i, slot) in lanes.iter_mut().take(V::LANES).enumerate() {
        if let Some(x) = block.get(i).and_then(|item| source.get(item.ray)) {
            last = *x;
        }
        *slot = last;
    }
    V::load(&lanes)
}

#[inline(always)]
fn sample_block<V: Lanes<f64>, const ESCAPE: bool, const PLAIN: bool>(
    rays: &Rays<'_>,
    block: &[Item],
    radial: &mut [Radial<V>],
    out: &mut Target<'_>,
) {
    let fine = block.first().map_or(1, |item| item.key.fine) as usize;
    let alpha: V = gather(rays.alpha, block);
    let beta: V = gather(rays.beta, block);
    let duration: V = gather(out.duration, block);
    let steps = (rays.per_ray - 1) * fine;
    let h = duration * V::splat(1.0 / steps as f64);
    let motion = Motion::new(&rays.camera, alpha, beta);
    let mirror = radial_leg::<V, ESCAPE, PLAIN>(rays, &motion, h, fine, radial);
    let mut starts = [0; MAX_LANES];
    for (l, start) in starts.iter_mut().enumerate() {
        // Lanes without a ray of their own repeat the last one.
        let item = block.get(l).or(block.last());
        *start = item.map_or(0, |item| item.ray * rays.per_ray);
    }
    let parts = Parts { radial, mirror, outward: ESCAPE };
    let mut run = PolarRun::new(&rays.camera, &motion, (alpha, beta), h, parts.get(0));
    let Aligned(rows) = &mut Aligned([[0.0; CHUNK * MAX_LANES]; 4]);
    for at in (0..rays.per_ray).step_by(CHUNK) {
        let len = CHUNK.min(rays.per_ray - at);
        for start in starts.iter().take(V::LANES) {
            for v in [&*out.delay, &*out.radius, &*out.theta, &*out.azimuth] {
                prefetch(v, start + AHEAD);
            }
        }
        for k in 0..len {
            let [r, t, phi] = parts.get(at + k);
            for (row, x) in rows.iter_mut().zip([run.t + t, r, run.theta, run.phi + phi]) {
                x.store(row.get_mut(k * V::LANES..).unwrap_or(&mut []));
            }
            // One step more than needed at the end does no harm.
            for _ in 0..if PLAIN { 1 } else { fine } {
                run.next();
            }
        }
        for (row, out) in
            rows.iter().zip([&mut *out.delay, &mut *out.radius, &mut *out.theta, &mut *out.azimuth])
        {
            if len == CHUNK {
                V::transpose_into(row, V::LANES, out, &starts);
            } else {
                transpose_plain(row, V::LANES, len, out, &starts);
            }
        }
        for start in &mut starts {
            *start += CHUNK;
        }
    }
}

/// Radial parts at the samples of the inward leg, and the sums of the parts at
/// mirrored samples: the outward leg of a ray mirrors its inward leg.
#[inline(always)]
fn radial_leg<V: Lanes<f64>, const ESCAPE: bool, const PLAIN: bool>(
    rays: &Rays<'_>,
    motion: &Motion<V>,
    h: V,
    fine: usize,
    radial: &mut [Radial<V>],
) -> (V, V) {
    let camera = &rays.camera;
    let steps = (rays.per_ray - 1) * fine;
    let mut ring = Ring::new();
    let mut run = RadialRun::new(camera, motion, h, &mut ring);
    let direct = if ESCAPE { rays.per_ray.div_ceil(2) } else { rays.per_ray - 1 };
    let (first, rest) = radial.split_at_mut(1);
    first[0] = run.parts(&ring);
    for slot in rest.iter_mut().take(direct - 1) {
        for _ in 0..if PLAIN { 1 } else { fine } {
            run.next(&mut ring);
        }
        *slot = run.parts(&ring);
    }
    if ESCAPE {
        // The nodes on either side of the turning point (or twice the one on it).
        for _ in (direct - 1) * fine..steps / 2 {
            run.next(&mut ring);
        }
        let [_, t0, phi0] = run.parts(&ring);
        if steps % 2 == 1 {
            run.next(&mut ring);
        }
        let [_, t1, phi1] = run.parts(&ring);
        (t0 + t1, phi0 + phi1)
    } else {
        for _ in 1..fine {
            run.next(&mut ring);
        }
        run.end_at(&mut ring, camera.w_end(), camera.margin);
        if let Some(slot) = radial.last_mut() {
            *slot = run.parts(&ring);
        }
        (h, h)
    }
}

/// The polar motion along a ray.
///
/// Angles grow by those between neighbouring nodes, `sin Δθ = s₁u₀ − u₁s₀` and
/// `tan Δφ = (x₀y₁ − y₀x₁)/(x₀x₁ + y₀y₁)`, which also counts the turns about the axis. The
/// direction is one node ahead of the angles, so that their polynomials find the results of its
/// division and square root ready.
struct PolarRun<V> {
    step: PolarStep<V>,
    ahead: PolarState<V>,
    /// The sign of −λ, in which azimuth grows.
    sense: V,
    x: V,
    y: V,
    u: V,
    /// sin θ.
    s: V,
    turn: Turn<V>,
    lift: V,
    theta: V,
    phi: V,
    phi_rate: V,
    t: V,
    t_rate: V,
}

/// Angles between two nodes.
#[derive(Clone, Copy)]
struct Turn<V> {
    /// The angle in θ, or its sine.
    theta: V,
    /// The angle in φ, or its tangent.
    phi: V,
    /// True if they are sine and tangent, all of them small.
    small: bool,
}

impl<V: Lanes<f64>> PolarRun<V> {
    /// `first` are the radial parts at the observer, where time and azimuth are zero; at infinity
    /// the parts themselves are what is requested.
    #[inline(always)]
    fn new(
        cam: &Camera,
        m: &Motion<V>,
        (alpha, beta): (V, V),
        h: V,
        [_, t, phi]: Radial<V>,
    ) -> Self {
        let s = V::splat;
        let step = PolarStep::new(cam, m, h);
        let (_, u, ahead) = step.start(cam, alpha, beta);
        let (zero, spin) = (s(0.0), s(cam.spin));
        // Any length will do for the azimuth. From the axis a ray leaves in one direction.
        let (mut x, mut y, mut start) = (s(1.0), zero, zero);
        if cam.sin_i == 0.0 {
            (x, y) = (beta * s(-cam.cos_i), alpha);
            start = atan2(y, x);
        }
        let (t, phi) = if cam.w_obs > 0.0 { (-t, start - phi) } else { (zero, start) };
        let mut run = Self {
            step,
            ahead,
            sense: s(1.0).copysign(alpha),
            x,
            y,
            u,
            s: s(cam.sin_i),
            turn: Turn { theta: zero, phi: zero, small: true },
            lift: zero,
            theta: s(cam.sin_i.atan2(cam.cos_i)),
            phi,
            phi_rate: spin.mul_add(h, step.turn),
            t,
            t_rate: (spin * (m.lambda - spin)).mul_add(h, step.lift),
        };
        run.look_ahead();
        run
    }

    /// Goes to the next node.
    #[inline(always)]
    fn next(&mut self) {
        let Turn { theta, phi, small } = self.turn;
        let lift = self.lift;
        self.look_ahead();
        let (d_theta, d_phi) =
            if small { (small_asin(theta), small_atan(phi)) } else { (theta, phi) };
        self.theta = self.theta + d_theta;
        self.phi = self.phi + (d_phi + self.phi_rate);
        self.t = self.t + (lift + self.t_rate);
    }

    /// The direction at the node ahead.
    #[inline(always)]
    fn look_ahead(&mut self) {
        let PolarState { x, y, u, .. } = self.ahead;
        self.lift = self.step.gain(self.u, u, V::splat(0.0));
        self.ahead = self.step.advance(self.ahead);
        let s = x.mul_add(x, y * y).sqrt();
        let rise = u.neg_mul_add(self.s, s * self.u);
        let cross = self.y.neg_mul_add(x, self.x * y);
        let dot = self.y.mul_add(y, self.x * x);
        let limit = V::splat(SMALL_ANGLE);
        let small = V::all(V::both(rise.abs().lt(limit), cross.abs().lt(dot * limit)));
        self.turn = if small {
            Turn { theta: rise, phi: cross * dot.recip(), small }
        } else {
            let theta = atan2(rise, u.mul_add(self.u, s * self.s));
            Turn { theta, phi: unwrap(atan2(cross, dot), self.sense), small }
        };
        (self.x, self.y, self.u, self.s) = (x, y, u, s);
    }
}

/// Radial parts of samples, those of the outward leg by reflection.
#[derive(Clone, Copy)]
struct Parts<'a, V> {
    radial: &'a [Radial<V>],
    /// Sums of the parts at mirrored samples.
    mirror: (V, V),
    /// True if there is an outward leg.
    outward: bool,
}

impl<V: Lanes<f64>> Parts<'_, V> {
    #[inline(always)]
    fn get(&self, j: usize) -> Radial<V> {
        let n = self.radial.len();
        if self.outward && 2 * j >= n {
            let [r, t, phi] = self.radial[n - 1 - j];
            [r, self.mirror.0 - t, self.mirror.1 - phi]
        } else {
            self.radial[j]
        }
    }
}
