//! The integrator `elliptic`: rays in closed form, many a SIMD register ([`crate::bundle`]), put
//! into the same columns as those of every other integrator.

use crate::analytic::ClosedForm;
use crate::bundle::{Crossings, Samples};
use crate::columns::{Bundle, Points};
use crate::error::{OutOfRange, check};
use crate::kerr::Kerr;
use crate::observer::{Observer, Ray};
use crate::path::Outcome;
use crate::request::{Placement, Request};
use crate::uncertainty::Uncertainty;

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
) -> Result<Bundle, OutOfRange> {
    let placed = matches!(request.samples, Placement::None | Placement::MinoTime(_));
    let allowed = "equidistant in Mino time with the integrator elliptic";
    check("placement of samples", 0.0, placed, allowed)?;
    check("momentum", 1.0, !request.momentum, "not with the integrator elliptic")?;
    let rays = alpha.iter().zip(beta).map(|(alpha, beta)| observer.ray(hole, *alpha, *beta));
    let rays = rays.collect::<Result<Vec<_>, _>>()?;
    let mut bundle = Bundle::default();
    fates(hole, &rays, &mut bundle);
    bundle.uncertainty = vec![Uncertainty::default(); rays.len()];
    crossings(hole, observer, alpha, beta, request, &mut bundle)?;
    if let Placement::MinoTime(n) = request.samples {
        samples(hole, observer, alpha, beta, request, n, &mut bundle)?;
    } else {
        rays.iter().for_each(|_| bundle.samples.end_ray());
    }
    if !request.uncertainty {
        bundle.uncertainty.clear();
    }
    Ok(bundle)
}

/// Outcomes, lengths, turning points and numbers of crossings.
fn fates(hole: &Kerr, rays: &[Ray], bundle: &mut Bundle) {
    for ray in rays {
        let form = ClosedForm::new(hole, ray);
        let turning = ray.potential.outer_turning_point();
        let total = match turning {
            Some(_) if ray.inverse_radius > 0.0 => form.time_back(),
            _ => form.mino_total(),
        };
        let captured = ray.potential.captures();
        bundle.outcome.push(if captured { Outcome::Captured } else { Outcome::Escaped });
        bundle.mino_total.push(total);
        bundle.turning_radius.push(turning.map_or(f64::NAN, |w| 1.0 / w));
        // A ray that lies in the plane does not cross it.
        let in_plane = ray.position[2] == 0.0 && ray.velocity[2] == 0.0;
        let before_end = form.crossings().take_while(|crossing| crossing.mino_time <= total);
        let count = if in_plane { 0 } else { before_end.count() };
        bundle.crossing_count.push(count as u32);
    }
}

fn crossings(
    hole: &Kerr,
    observer: &Observer,
    alpha: &[f64],
    beta: &[f64],
    request: &Request,
    bundle: &mut Bundle,
) -> Result<(), OutOfRange> {
    let mut found = Crossings::default();
    if request.crossings > 0 {
        found.trace(hole, observer, alpha, beta, request.crossings)?;
    }
    for k in 0..alpha.len() {
        for crossing in found.ray(k) {
            let points = &mut bundle.crossings;
            points.mino_time.push(crossing.mino_time);
            points.radius.push(crossing.radius);
            points.theta.push(core::f64::consts::FRAC_PI_2);
            angles(points, request, crossing.azimuth, crossing.delay);
            widen(&mut bundle.uncertainty[k], crossing.error, crossing.radius);
        }
        bundle.crossings.end_ray();
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

/// Takes the error of a position at radius `r` into the estimate of a ray: what is late by as
/// much moves in time as in space, or r times as much.
fn widen(worst: &mut Uncertainty, error: f64, r: f64) {
    let each = Uncertainty { radius: error, theta: error, azimuth: error, delay: error * r };
    *worst = worst.max(each);
}

/// Samples equidistant in Mino time, without those at infinity: rays that fall have one of
/// these, others two.
fn samples(
    hole: &Kerr,
    observer: &Observer,
    alpha: &[f64],
    beta: &[f64],
    request: &Request,
    n: usize,
    bundle: &mut Bundle,
) -> Result<(), OutOfRange> {
    let captured = |k: &usize| bundle.outcome[*k] == Outcome::Captured;
    let all = 0..alpha.len();
    let (falling, rising): (Vec<usize>, Vec<usize>) = all.partition(captured);
    let at_infinity = observer.is_at_infinity();
    let trace = |rays: &[usize], ends: usize| -> Result<Samples, OutOfRange> {
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
        let falls = bundle.outcome[k] == Outcome::Captured;
        let (source, next) = if falls { (&down, &mut next_down) } else { (&up, &mut next_up) };
        let ray = source.ray(*next);
        *next += 1;
        let first = usize::from(at_infinity);
        let step = ray.mino_total / (source.per_ray() - 1) as f64;
        let span = first..first + n;
        let points = &mut bundle.samples;
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
        let farthest = ray.radius[span].iter().fold(0.0, |far: f64, r| far.max(*r));
        widen(&mut bundle.uncertainty[k], ray.error, farthest);
        bundle.samples.end_ray();
    }
    Ok(())
}
