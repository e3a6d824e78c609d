//! The integrator `elliptic`: rays from blocks ([`BlockTracer`]), put into the same columns as those
//! of every other integrator.

use crate::analytic::ClosedForm;
use crate::error::Error;
use crate::integrate::uncertainty::Uncertainty;
use crate::rays::block::{
    BlockRequest, BlockTracer, PathOfRay, PlaneCrossing, RayBlock, RayVisitor, TracedRay,
};
use crate::rays::clock::{Clock, widen};
use crate::rays::columns::RayTable;
use crate::rays::request::{Placement, Request};
use crate::rays::sampling::Sampler;
use crate::rays::trajectory::MinoPath;
use crate::screen::observer::{Observer, Ray};
use crate::simd::RaySamples;
use crate::spacetime::kerr::Kerr;

/// Returns the request of blocks of rays, if the closed form has all that is requested: it has no
/// momenta, and no samples placed otherwise than by Mino time.
pub(crate) fn in_closed_form(request: &Request) -> Option<BlockRequest> {
    let samples = match request.samples {
        Placement::None => Some(0),
        Placement::MinoTime(n) => Some(n),
        Placement::PathLength { .. } | Placement::GaussLegendre { .. } => None,
    };
    let samples = samples.filter(|_| !request.momentum)?;
    Some(BlockRequest { crossings: request.crossings, samples, ..BlockRequest::default() })
}

/// Traces a block of rays.
///
/// # Errors
/// As [`BlockTracer::trace`].
pub(crate) fn trace_block(
    tracer: &BlockTracer,
    observer: &Observer,
    [alpha, beta]: [&[f64]; 2],
    wanted: &BlockRequest,
    request: &Request,
) -> Result<RayTable, Error> {
    let (hole, at_infinity) = (tracer.hole(), [observer.is_at_infinity(); 2]);
    let mut table = RayTable::default();
    table.samples.reserve(request, wanted.samples * alpha.len());
    let mut sampler = Sampler::new(request, hole, at_infinity, &[], table);
    sampler.exit = wanted.exit;
    let worst = Uncertainty::default();
    let mut table = Collector { hole, observer, alpha, beta, request, sampler, worst };
    tracer.trace(alpha, beta, wanted, &mut RayBlock::default(), &mut table)?;
    Ok(table.sampler.sink)
}

/// Puts the rays of a block into columns.
struct Collector<'a> {
    hole: &'a Kerr,
    observer: &'a Observer,
    alpha: &'a [f64],
    beta: &'a [f64],
    request: &'a Request,
    /// Takes what is requested from the paths of rays that were traced step by step.
    sampler: Sampler<'a, f64, RayTable>,
    /// The largest errors of the present ray.
    worst: Uncertainty,
}

impl RayVisitor for Collector<'_> {
    fn take_samples(&mut self, number: usize, ray: &TracedRay, samples: &RaySamples<'_>) {
        if ray.stepped {
            return;
        }
        let (n, falls) = (samples.radius.len(), !samples.escapes);
        // The numbers of the first sample, and of the one at the ray's end, from the observer on.
        let first = usize::from(self.observer.is_at_infinity());
        let last = n - 1 + if falls { first } else { 2 * first };
        let step = samples.mino_total / last.max(1) as f64;
        let points = &mut self.sampler.sink.samples;
        points.mino_time.extend((first..first + n).map(|j| step * j as f64));
        points.radius.extend_from_slice(samples.radius);
        points.theta.extend_from_slice(samples.theta);
        if self.request.azimuth {
            points.azimuth.extend_from_slice(samples.azimuth);
        }
        if self.request.time {
            points.delay.extend_from_slice(samples.delay);
        }
        if self.request.weight {
            let weight = |(j, (r, theta)): (usize, (&f64, &f64))| {
                let end = j + first == 0 || j + first == last;
                let share = if end { 0.5 * step } else { step };
                share * self.hole.sigma(*r, theta.cos())
            };
            let places = samples.radius.iter().zip(samples.theta);
            points.weight.extend(places.enumerate().map(weight));
        }
        if self.request.uncertainty {
            self.doubt_samples(number, samples, step);
        }
    }

    fn take(
        &mut self,
        number: usize,
        ray: &TracedRay,
        crossings: &[PlaneCrossing],
        path: Option<PathOfRay<'_>>,
    ) -> Result<(), Error> {
        if let Some(PathOfRay { ray, path, .. }) = path {
            self.sampler.take(&MinoPath::new(path, ray).timed(), ray.lambda);
            // Steps lose digits of the whole next to the critical curve; on it the closed form has none.
            let total = self.sampler.sink.mino_total.last_mut().filter(|total| !total.is_nan());
            if let (Some(total), Some(whole)) = (total, whole(self.hole, ray)) {
                *total = whole;
            }
            return Ok(());
        }
        let photon = self.photon(number)?;
        let turning = turning_radius(&photon);
        if self.request.uncertainty {
            self.doubt_crossings(&Clock::new(self.hole, &photon), ray, turning, crossings);
        }
        let table = &mut self.sampler.sink;
        table.outcome.push(ray.outcome);
        table.mino_total.push(ray.mino_total);
        table.turning_radius.push(turning);
        table.crossing_count.push(ray.crossing_count);
        let exit = ray.exit.unwrap_or([f64::NAN; 3]);
        table.exit.extend(self.sampler.exit.then_some(exit));
        for crossing in crossings {
            table.crossings.push_crossing(self.request, crossing);
        }
        table.crossings.end_ray();
        table.samples.end_ray();
        let worst = core::mem::take(&mut self.worst);
        table.uncertainty.extend(self.request.uncertainty.then_some(worst));
        Ok(())
    }
}

impl Collector<'_> {
    fn photon(&self, number: usize) -> Result<Ray, Error> {
        self.observer.ray(self.hole, self.alpha[number], self.beta[number])
    }

    fn doubt_samples(&mut self, number: usize, samples: &RaySamples<'_>, step: f64) {
        let Ok(photon) = self.photon(number) else { return };
        let clock = Clock::new(self.hole, &photon);
        let points = [samples.radius, samples.delay];
        let delay = clock.worst(self.hole, points, step, samples.error);
        // A ray that falls is dragged most at its end, which its error knows.
        let dragged = if samples.escapes { clock.dragging(turning_radius(&photon)) } else { 1.0 };
        widen(&mut self.worst, samples.error, samples.error * dragged, delay);
    }

    fn doubt_crossings(
        &mut self,
        clock: &Clock,
        ray: &TracedRay,
        turning: f64,
        crossings: &[PlaneCrossing],
    ) {
        let half = if turning.is_nan() { f64::INFINITY } else { 0.5 * ray.mino_total };
        for PlaneCrossing { mino_time, radius, delay, error, .. } in crossings {
            let delay = clock.rounding(*delay, *radius)
                + clock.quadrature(clock.step_to(*mino_time, half))
                + error * clock.reach(*radius);
            widen(&mut self.worst, *error, *error, delay);
        }
    }
}

/// Returns the radius where a ray turns; NaN if it does not.
fn turning_radius(photon: &Ray) -> f64 {
    photon.potential.outer_turning_point().map_or(f64::NAN, |w| 1.0 / w)
}

/// Mino time of a whole ray, if it is finite.
fn whole(hole: &Kerr, photon: &Ray) -> Option<f64> {
    let form = ClosedForm::new(hole, photon);
    let returns = photon.inverse_radius > 0.0 && photon.potential.outer_turning_point().is_some();
    let total = if returns { form.time_back() } else { form.mino_total() };
    Some(total).filter(|total| total.is_finite())
}
