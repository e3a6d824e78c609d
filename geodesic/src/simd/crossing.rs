//! Equatorial crossings of a block of rays.
//!
//! With `S` of the polar step, `u(τ) = 0` where `S'/S = −u₀'/u₀ = −c`. So `Q = 1/S²` solves
//! `Q² + (A − c²) Q + C = 0`, and `τ = R_F(Q, Q + A/2 ± √(A²/4 − C))`, or that much short of
//! a whole half-oscillation if the ray first moves away from the equator. From one crossing to
//! the next the polar motion repeats itself: it is followed up to the first one and, if more are
//! requested, over one half-oscillation from there.

use super::crossing_polar::{PolarSum, polar_times};

use super::error::{MAX_STEP, estimate};
use super::lanes::{Lanes, MAX_LANES, Task};
use super::math::atan2;
use super::motion::{Camera, Journey, Motion};
use super::polar::unwrap;
use super::radial_sum::{LEAST_STEPS, RadialSum, closed_forms, to_turning_point};

/// The most steps to one crossing: a ray that circles longer than that has no digits left.
const MOST_STEPS: f64 = 1e5;

/// Errors compared with those of samples: there are few steps, and no sum of angles.
const LESS: f64 = 0.4;

/// Destination of the crossings of a block of rays, ray after ray.
pub(super) struct Target<'a> {
    pub delay: &'a mut [f64],
    pub radius: &'a mut [f64],
    pub azimuth: &'a mut [f64],
    pub mino_time: &'a mut [f64],
    pub error: &'a mut [f64],
    pub rays: Whole<'a>,
}

/// Results of each ray as a whole.
pub(super) struct Whole<'a> {
    /// Mino time of the ray.
    pub duration: &'a mut [f64],
    /// True if it returns to the observer's radius (1) or is captured (0).
    pub escapes: &'a mut [f64],
    /// Number of crossings of the plane.
    pub count: &'a mut [f64],
    /// Error of its phase, as an angle.
    pub doubt: &'a mut [f64],
}

impl Whole<'_> {
    /// Stores the lanes of the rays from number `from` to `to`.
    #[inline(always)]
    fn store<V: Lanes<f64>>(
        &mut self,
        from: usize,
        to: usize,
        [time, escapes, count, doubt]: [V; 4],
    ) {
        time.store(&mut self.duration[from..to]);
        escapes.store(&mut self.escapes[from..to]);
        count.store(&mut self.count[from..to]);
        doubt.store(&mut self.doubt[from..to]);
        for count in &mut self.count[from..to] {
            *count = count.floor();
        }
    }
}

/// The work of one block of rays, at any width of lanes.
pub(super) struct Block<'a, 'b> {
    pub camera: Camera,
    pub alpha: &'a [f64],
    pub beta: &'a [f64],
    /// Crossings per ray.
    pub count: usize,
    pub out: &'b mut Target<'a>,
}

impl Task<f64> for Block<'_, '_> {
    type Output = ();

    #[inline(always)]
    fn run<V: Lanes<f64>>(self) {
        let Self { camera, alpha, beta, count, out } = self;
        let start = closed_forms::<V>(&camera, V::splat(camera.w_obs));
        let order = arrange::<V>(&camera, start, alpha, beta, &mut out.rays);
        let Target { delay, radius, azimuth, mino_time, error, .. } = out;
        let mut columns = [&mut **delay, radius, azimuth, mino_time, error];
        for group in order.chunk_by(|a, b| a.key == b.key) {
            for block in group.chunks(V::LANES) {
                let (alpha, beta) = (gather(alpha, block), gather(beta, block));
                let rays = LaneRays::new(&camera, start, alpha, beta).with_steps(group[0].key);
                rays.all(rays.first(), count, block, &mut columns);
            }
        }
    }
}

/// Steps of the quadrature to a ray's first crossing and from one to the next. Rays are taken
/// together with others that need as many, so that no result depends on what is beside it.
#[derive(Clone, Copy, Default, PartialEq, Eq, PartialOrd, Ord)]
struct Key {
    first: u32,
    next: u32,
}

#[derive(Clone, Copy)]
struct Item {
    key: Key,
    ray: usize,
}

/// The rays in the order of their keys; what is known of each as a whole goes to `whole`.
#[inline(always)]
fn arrange<V: Lanes<f64>>(
    camera: &Camera,
    start: [V; 2],
    alpha: &[f64],
    beta: &[f64],
    whole: &mut Whole<'_>,
) -> Vec<Item> {
    let mut order = Vec::with_capacity(alpha.len());
    for from in (0..alpha.len()).step_by(V::LANES) {
        let to = alpha.len().min(from + V::LANES);
        let (alpha, beta) = (V::load(&alpha[from..to]), V::load(&beta[from..to]));
        let rays = LaneRays::new(camera, start, alpha, beta);
        whole.store(from, to, rays.whole());
        let rate = rays.motion.stiffness().sqrt() * V::splat(1.0 / MAX_STEP);
        let (mut first, mut next) = ([0.0; MAX_LANES], [0.0; MAX_LANES]);
        (rate * rays.time).store(&mut first);
        (rate * rays.half).store(&mut next);
        for ray in from..to {
            let steps = |x: f64| x.ceil().clamp(LEAST_STEPS as f64, MOST_STEPS) as u32;
            // A ray without a crossing takes what is left anyway.
            let exists = whole.count[ray] > 0.0;
            let key = Key { first: steps(first[ray - from]), next: steps(next[ray - from]) };
            order.push(Item { key: if exists { key } else { Key::default() }, ray });
        }
    }
    order.sort_by_key(|item| item.key);
    order
}

/// Gathers the values of the rays of a block from `source`, the last one repeated.
#[inline(always)]
fn gather<V: Lanes<f64>>(source: &[f64], block: &[Item]) -> V {
    let mut lanes = [0.0; MAX_LANES];
    for (l, lane) in lanes.iter_mut().enumerate().take(V::LANES) {
        let item = block.get(l).or(block.last());
        *lane = item.and_then(|item| source.get(item.ray)).copied().unwrap_or(0.0);
    }
    V::load(&lanes)
}

/// Delay, radius, azimuth, Mino time and error of a crossing.
type Point<V> = [V; 5];

/// Radius, the radial parts of time and azimuth, how much a phase error counts,
/// and the greatest r₊/r on the way.
type Radial<V> = [V; 5];

/// Rays side by side.
struct LaneRays<'a, V> {
    camera: &'a Camera,
    /// The closed forms of time and azimuth at the observer.
    start: [V; 2],
    motion: Motion<V>,
    journey: Journey<V>,
    alpha: V,
    beta: V,
    /// Mino time of the first crossing.
    time: V,
    /// Mino time from one crossing to the next.
    half: V,
    steps: Key,
}

/// Azimuth and `∫ a²(u² − 1) dτ` with λ's part along a piece of the polar motion.
#[derive(Clone, Copy)]
struct Polar<V> {
    azimuth: V,
    time: V,
}

impl<'a, V: Lanes<f64>> LaneRays<'a, V> {
    #[inline(always)]
    fn new(camera: &'a Camera, start: [V; 2], alpha: V, beta: V) -> Self {
        let motion = Motion::new(camera, alpha, beta);
        let journey = Journey::new(camera, &motion);
        let (time, half) = polar_times(camera, &motion, beta);
        Self { camera, start, motion, journey, alpha, beta, time, half, steps: Key::default() }
    }

    #[inline(always)]
    fn with_steps(self, steps: Key) -> Self {
        Self { steps, ..self }
    }

    /// Steps to crossing `number`.
    #[inline(always)]
    fn steps(&self, number: usize) -> usize {
        let Key { first, next } = self.steps;
        (first as usize + number * next as usize).clamp(LEAST_STEPS, MOST_STEPS as usize)
    }

    /// Mino time, fate, number of crossings with a fraction on top, and error of the phase.
    #[inline(always)]
    fn whole(&self) -> [V; 4] {
        let s = V::splat;
        let Journey { duration, escapes, condition, .. } = self.journey;
        let crosses = self.time.lt(duration);
        let safe = V::select(crosses, self.half, s(1.0));
        let count = (duration - self.time) / safe + s(1.0);
        let b = self.motion.stiffness().sqrt();
        let doubt = estimate(condition, b, b, s(MAX_STEP), s(0.0));
        [duration, escapes, V::select(crosses, count, s(0.0)), doubt]
    }

    /// The first crossing and the polar motion up to it; NaN where there is none.
    #[inline(always)]
    fn first(&self) -> (Point<V>, Polar<V>) {
        let s = V::splat;
        let exists = self.time.lt(self.journey.duration);
        if !V::any(exists) {
            let none = s(f64::NAN);
            return ([none; 5], Polar { azimuth: none, time: none });
        }
        // Lanes without a crossing take the shortest of ways.
        let time = V::select(exists, self.time, self.journey.duration * s(1e-3));
        let steps = self.steps(0);
        let h = time * s(1.0 / steps as f64);
        let mut polar = PolarSum::at_observer(self.camera, &self.motion, h, self.alpha, self.beta);
        let radial = self.radial(time, steps, Some(&mut polar));
        let polar = Polar {
            azimuth: self.unwrapped(polar.angle()) + polar.turned(steps),
            time: polar.time(steps),
        };
        (self.point(time, exists, radial, polar), polar)
    }

    /// The first crossing and up to `count − 1` more into the columns, ray after ray.
    #[inline(always)]
    fn all(
        &self,
        (point, first): (Point<V>, Polar<V>),
        count: usize,
        block: &[Item],
        columns: &mut [&mut [f64]; 5],
    ) {
        for item in block {
            for column in columns.iter_mut() {
                column[item.ray * count..(item.ray + 1) * count].fill(f64::NAN);
            }
        }
        scatter(point, 0, count, block, columns);
        let mut time = self.time;
        let mut polar = first;
        let mut period = None;
        for number in 1..count {
            time = time + self.half;
            let exists = time.lt(self.journey.duration);
            if !V::any(exists) {
                break;
            }
            let Polar { azimuth, time: lift } = match period {
                Some(period) => period,
                None => self.period(),
            };
            period = Some(Polar { azimuth, time: lift });
            polar = Polar { azimuth: polar.azimuth + azimuth, time: polar.time + lift };
            let safe = V::select(exists, time, self.journey.duration * V::splat(1e-3));
            let radial = self.radial(safe, self.steps(number), None);
            scatter(self.point(safe, exists, radial, polar), number, count, block, columns);
        }
    }

    /// The polar motion from a crossing to the next.
    #[inline(always)]
    fn period(&self) -> Polar<V> {
        let s = V::splat;
        let half = V::select(self.half.lt(s(f64::MAX)), self.half, s(1e-3));
        let steps = (self.steps.next as usize).clamp(LEAST_STEPS, MOST_STEPS as usize);
        let h = half * s(1.0 / steps as f64);
        let mut polar = PolarSum::at_equator(self.camera, &self.motion, h);
        for _ in 0..steps {
            polar.next();
        }
        let azimuth = unwrap(polar.angle(), self.sense()) + polar.turned(steps);
        Polar { azimuth, time: polar.time(steps) }
    }

    /// The sign of −λ = α sin i; where it vanishes that of α counts.
    #[inline(always)]
    fn sense(&self) -> V {
        V::splat(1.0).copysign(self.alpha)
    }

    /// The azimuth at the end of the polar motion from the observer.
    #[inline(always)]
    fn unwrapped(&self, angle: V) -> V {
        if self.camera.sin_i == 0.0 {
            // From the axis a ray leaves in one direction and keeps it.
            return atan2(self.alpha, self.beta * V::splat(-self.camera.cos_i));
        }
        unwrap(angle, self.sense())
    }

    /// r and the radial parts of time and azimuth at `time`. The polar motion goes along in the
    /// same loop: each waits for its own divisions.
    #[inline(always)]
    fn radial(&self, time: V, steps: usize, mut polar: Option<&mut PolarSum<V>>) -> Radial<V> {
        let s = V::splat;
        let (camera, m) = (self.camera, &self.motion);
        let turning = self.journey.duration * s(0.5);
        let outward = V::both(s(0.5).lt(self.journey.escapes), turning.lt(time));
        // The outward leg mirrors the inward one.
        let inner = V::select(outward, self.journey.duration - time, time);
        let w_obs = s(camera.w_obs);
        let h = inner * s(1.0 / steps as f64);
        let mut run = RadialSum::new(m, h, w_obs, m.radial(w_obs).sqrt());
        for _ in LEAST_STEPS..steps {
            run.next();
            if let Some(polar) = &mut polar {
                polar.next();
            }
        }
        if let Some(polar) = polar {
            for _ in 0..LEAST_STEPS {
                polar.next();
            }
        }
        let end = run.finish(camera);
        let closed = closed_forms(camera, end.w);
        let spin = s(camera.spin);
        let t = end.time + (self.start[0] - closed[0]);
        let phi = end.turn.neg_mul_add(spin, closed[1] - self.start[1]);
        let r = end.w.recip();
        // aP/Δ, which is about a(1 + a²w²)/[(1 − r₊w)(1 − r₋w)], is large next to the horizon.
        let delta = end.w.neg_mul_add(s(camera.r_plus()), s(1.0))
            * end.w.neg_mul_add(s(camera.r_minus()), s(1.0));
        let drag = s(2.0 * camera.spin.abs()) / delta.max(s(1e-16));
        let speed = drag.max(s(3.0));
        if !V::any(outward) {
            return [r, t, phi, speed, end.w * s(camera.r_plus())];
        }
        // From there to the turning point, and back.
        let rest = V::select(outward, turning - inner, inner);
        let [dt, dphi, w] = to_turning_point((camera, m), (rest, steps), &end, closed);
        let twice = s(2.0);
        [
            r,
            V::select(outward, dt.mul_add(twice, t), t),
            V::select(outward, dphi.mul_add(twice, phi), phi),
            V::select(outward, r, speed),
            V::select(outward, w, end.w) * s(camera.r_plus()),
        ]
    }

    #[inline(always)]
    fn point(&self, time: V, exists: V::Mask, radial: Radial<V>, polar: Polar<V>) -> Point<V> {
        let [r, t, phi, speed, depth] = radial;
        let s = V::splat;
        let spin = s(self.camera.spin);
        let delay = (spin * (self.motion.lambda - spin)).mul_add(time, t + polar.time);
        let azimuth = spin.mul_add(time, polar.azimuth + phi);
        let b = self.motion.stiffness().sqrt();
        let error = estimate(self.journey.condition, b, speed, s(MAX_STEP), depth) * s(LESS);
        // No closures here: they would be compiled without the instruction set.
        let none = s(f64::NAN);
        [
            V::select(exists, delay, none),
            V::select(exists, r, none),
            V::select(exists, azimuth, none),
            V::select(exists, time, none),
            V::select(exists, error, none),
        ]
    }
}

/// Crossing `number` of each ray of a block, out of `count`.
#[inline(always)]
fn scatter<V: Lanes<f64>>(
    point: Point<V>,
    number: usize,
    count: usize,
    block: &[Item],
    columns: &mut [&mut [f64]; 5],
) {
    let mut lanes = [0.0; MAX_LANES];
    for (x, column) in point.into_iter().zip(columns) {
        x.store(&mut lanes);
        for (x, item) in lanes.iter().zip(block) {
            column[item.ray * count + number] = *x;
        }
    }
}
