//! The integrator `elliptic`: rays in closed form, many a SIMD register ([`crate::simd`]), put
//! into the same columns as those of every other integrator.

use crate::analytic::ClosedForm;
use crate::error::{Error, check};
use crate::integrate::path::Outcome;
use crate::integrate::uncertainty::Uncertainty;
use crate::rays::columns::{Points, RayTable};
use crate::rays::request::{Placement, Request};
use crate::screen::observer::{Observer, Ray};
use crate::simd::{Crossings, LEAST_STEPS, MAX_STEP, Samples};
use crate::spacetime::kerr::Kerr;

/// Traces rays and takes from them what is requested.
///
/// # Errors
/// As for the kernels, or if the request is one that they do not serve: momentum, or samples
/// placed otherwise than by Mino time.
pub(crate) fn trace(
    hole: &Kerr,
    observer: &Observer,
    alpha: &[f64],
    beta: &[f64],
    request: &Request,
) -> Result<RayTable, Error> {
    let placed = matches!(request.samples, Placement::None | Placement::MinoTime(_));
    let allowed = "equidistant in Mino time with the integrator elliptic";
    check("placement of samples", 0.0, placed, allowed)?;
    check("momentum", 1.0, !request.momentum, "not with the integrator elliptic")?;
    let rays = alpha.iter().zip(beta).map(|(alpha, beta)| observer.ray(hole, *alpha, *beta));
    let rays = rays.collect::<Result<Vec<_>, _>>()?;
    let mut table = RayTable::default();
    fates(hole, &rays, &mut table);
    table.uncertainty = vec![Uncertainty::default(); rays.len()];
    let clocks: Vec<Clock> = rays.iter().map(|ray| Clock::new(hole, ray)).collect();
    let job = Job { hole, observer, alpha, beta, request, clocks: &clocks };
    crossings(&job, &mut table)?;
    if let Placement::MinoTime(n) = request.samples {
        samples(&job, n, &mut table)?;
    } else {
        rays.iter().for_each(|_| table.samples.end_ray());
    }
    if !request.uncertainty {
        table.uncertainty.clear();
    }
    Ok(table)
}

/// Outcomes, lengths, turning points and numbers of crossings.
fn fates(hole: &Kerr, rays: &[Ray], table: &mut RayTable) {
    for ray in rays {
        let form = ClosedForm::new(hole, ray);
        let turning = ray.potential.outer_turning_point();
        let total = match turning {
            Some(_) if ray.inverse_radius > 0.0 => form.time_back(),
            _ => form.mino_total(),
        };
        let captured = ray.potential.captures();
        table.outcome.push(if captured { Outcome::Captured } else { Outcome::Escaped });
        table.mino_total.push(total);
        table.turning_radius.push(turning.map_or(f64::NAN, |w| 1.0 / w));
        // A ray that lies in the plane does not cross it.
        let in_plane = ray.position[2] == 0.0 && ray.velocity[2] == 0.0;
        let before_end = form.crossings().take_while(|crossing| crossing.mino_time <= total);
        let count = if in_plane { 0 } else { before_end.count() };
        table.crossing_count.push(count as u32);
    }
}

/// Rays of one observer, and what is wanted of them.
struct Job<'a> {
    hole: &'a Kerr,
    observer: &'a Observer,
    alpha: &'a [f64],
    beta: &'a [f64],
    request: &'a Request,
    clocks: &'a [Clock],
}

fn crossings(job: &Job<'_>, table: &mut RayTable) -> Result<(), Error> {
    let Job { hole, observer, alpha, beta, request, clocks } = job;
    let mut found = Crossings::default();
    if request.crossings > 0 {
        found.trace(hole, observer, alpha, beta, request.crossings)?;
    }
    for k in 0..alpha.len() {
        for crossing in found.ray(k) {
            let points = &mut table.crossings;
            points.mino_time.push(crossing.mino_time);
            points.radius.push(crossing.radius);
            points.theta.push(core::f64::consts::FRAC_PI_2);
            angles(points, request, crossing.azimuth, crossing.delay);
            let turning = !table.turning_radius[k].is_nan();
            let half = if turning { 0.5 * table.mino_total[k] } else { f64::INFINITY };
            let (time, r) = (crossing.mino_time, crossing.radius);
            let delay = clocks[k].rounding(crossing.delay, r)
                + clocks[k].quadrature(clocks[k].step_to(time, half))
                + crossing.error * clocks[k].reach(r);
            widen(&mut table.uncertainty[k], crossing.error, crossing.error, delay);
        }
        table.crossings.end_ray();
    }
    Ok(())
}

/// The columns that are there only if they were asked for.
fn angles(points: &mut Points, request: &Request, azimuth: f64, delay: f64) {
    if request.azimuth {
        points.azimuth.push(azimuth);
    }
    if request.time {
        points.delay.push(delay);
    }
}

/// Takes the error of a position and that of its delay into the estimate of a ray. A relative
/// error of 1/r of 1 or more leaves nothing known about r and the delay.
fn widen(worst: &mut Uncertainty, error: f64, azimuth: f64, delay: f64) {
    let lost = if error < 1.0 { 1.0 / (1.0 - error) } else { f64::INFINITY };
    let (radius, delay) = (error * lost, delay * lost);
    *worst = worst.max(Uncertainty { radius, theta: error, azimuth, delay });
}

/// The error of the delay over b, by quadrature at the largest step: of the derivatives of 1/g at
/// both ends, the largest for rays that hardly bend. Measured (docs/measurements/geodesics.md of the
/// repository).
const QUADRATURE: f64 = 2e-10;

/// What the error of a ray's delay depends on.
struct Clock {
    spin: f64,
    lambda: f64,
    /// The ray's fastest frequency.
    b: f64,
    /// Radius of the observer; 0 for one at infinity, where closed forms start from 0.
    start: f64,
}

impl Clock {
    fn new(hole: &Kerr, ray: &Ray) -> Self {
        let w = ray.inverse_radius;
        let start = if w > 0.0 { 1.0 / w } else { 0.0 };
        Clock { spin: hole.spin(), lambda: ray.lambda, b: ray.angular.max(1.0).sqrt(), start }
    }

    /// By quadrature with steps of bτ `step`: of order ten.
    fn quadrature(&self, step: f64) -> f64 {
        QUADRATURE * self.b * (step / MAX_STEP).powi(10)
    }

    /// The step, as a bτ, to a crossing at `time` of a ray that turns after `half`.
    fn step_to(&self, time: f64, half: f64) -> f64 {
        let steps = (self.b * time / MAX_STEP).ceil().max(LEAST_STEPS as f64);
        // The outward leg mirrors the inward one: two sums, each of as many steps.
        let outward = time > half;
        let (inner, rest) = if outward { (2.0 * half - time, time - half) } else { (time, 0.0) };
        self.b * inner.max(rest) / steps
    }

    /// At worst of samples a `step` of Mino time apart, whose positions have this error; without
    /// those at the horizon, where the delay has no limit.
    fn worst(&self, hole: &Kerr, [radii, delays]: [&[f64]; 2], step: f64, error: f64) -> f64 {
        let horizon = hole.horizon() * (1.0 + 2e-8);
        let fine = (self.b * step / MAX_STEP).ceil().max(1.0);
        let quadrature = self.quadrature(self.b * step / fine);
        let outside = radii.iter().zip(delays).filter(|(r, _)| **r > horizon);
        let each = outside.map(|(r, delay)| self.rounding(*delay, *r) + error * self.reach(*r));
        each.fold(0.0, f64::max) + quadrature
    }

    /// By rounding, at radius `r`.
    fn rounding(&self, delay: f64, r: f64) -> f64 {
        16.0 * f64::EPSILON * (delay.abs() + r + self.start + self.b)
    }

    /// By how much faster the azimuth grows at radius `r` than bτ: frame dragging.
    fn dragging(&self, r: f64) -> f64 {
        let (a, delta) = (self.spin, (r * (r - 2.0) + self.spin * self.spin).max(f64::EPSILON));
        1.0 + (a * ((r * r + a * (a - self.lambda)) / delta - 1.0)).abs() / self.b
    }

    /// By how much the delay moves with a relative error of the radius: r dt/dr.
    fn reach(&self, r: f64) -> f64 {
        let a2 = self.spin * self.spin;
        r * (r * r + a2) / (r * (r - 2.0) + a2).max(f64::EPSILON)
    }
}

/// Samples equidistant in Mino time, without those at infinity: rays that fall have one of
/// these, others two.
fn samples(job: &Job<'_>, n: usize, table: &mut RayTable) -> Result<(), Error> {
    let Job { hole, observer, alpha, beta, request, clocks } = job;
    let captured = |k: &usize| table.outcome[*k] == Outcome::Captured;
    let all = 0..alpha.len();
    let (falling, rising): (Vec<usize>, Vec<usize>) = all.partition(captured);
    let at_infinity = observer.is_at_infinity();
    let trace = |rays: &[usize], ends: usize| -> Result<Samples, Error> {
        let pick = |column: &[f64]| rays.iter().map(|k| column[*k]).collect::<Vec<_>>();
        let mut samples = Samples::default();
        let per_ray = if at_infinity { n + ends } else { n };
        if !rays.is_empty() {
            samples.trace(hole, observer, &pick(alpha), &pick(beta), per_ray.max(2))?;
        }
        Ok(samples)
    };
    let (down, up) = (trace(&falling, 1)?, trace(&rising, 2)?);
    let (mut next_down, mut next_up) = (0, 0);
    for k in 0..alpha.len() {
        let falls = table.outcome[k] == Outcome::Captured;
        let (source, next) = if falls { (&down, &mut next_down) } else { (&up, &mut next_up) };
        let ray = source.ray(*next);
        *next += 1;
        let first = usize::from(at_infinity);
        let step = ray.mino_total / (source.per_ray() - 1) as f64;
        let span = first..first + n;
        let points = &mut table.samples;
        points.mino_time.extend(span.clone().map(|j| step * j as f64));
        points.radius.extend_from_slice(&ray.radius[span.clone()]);
        points.theta.extend_from_slice(&ray.theta[span.clone()]);
        if request.azimuth {
            points.azimuth.extend_from_slice(&ray.azimuth[span.clone()]);
        }
        if request.time {
            points.delay.extend_from_slice(&ray.delay[span.clone()]);
        }
        if request.weight {
            let last = source.per_ray() - 1;
            points.weight.extend(span.clone().map(|j| {
                let ends = (!at_infinity && j == 0) || (j == last && (falls || !at_infinity));
                let share = if ends { 0.5 * step } else { step };
                share * hole.sigma(ray.radius[j], ray.theta[j].cos())
            }));
        }
        let points = [&ray.radius[span.clone()], &ray.delay[span]];
        let delay = clocks[k].worst(hole, points, step, ray.error);
        // A ray that falls is dragged most at its end, which its error knows.
        let dragged = if falls { 1.0 } else { clocks[k].dragging(table.turning_radius[k]) };
        widen(&mut table.uncertainty[k], ray.error, ray.error * dragged, delay);
        table.samples.end_ray();
    }
    Ok(())
}
