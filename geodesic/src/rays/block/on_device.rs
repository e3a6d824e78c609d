//! Rays of a block on a device.

use super::device::{DeviceEnd, DeviceRequest, RayDevice};
use super::request::BlockRequest;
use super::traced::TracedRay;
use super::tracer::{BlockTracer, Job, RayBlock};
use super::visitor::{PathUse, RayVisitor, Work, first_opaque};
use crate::error::Error;
use crate::integrate::outcome::Outcome;
use crate::rays::blocks::check_columns;
use crate::simd::ScreenRays;

/// The estimated error of a ray beyond which it is traced on this processor instead.
const ROUGH: f64 = 1e-3;

impl BlockTracer {
    /// Outcomes, crossings and directions of escape of the rays that `device` vouches for; nodes in closed form on this
    /// processor.
    pub(super) fn trace_on_device<V: RayVisitor>(
        &self,
        device: &dyn RayDevice,
        job: Job<'_>,
        block: &mut RayBlock,
        visitor: &mut V,
    ) -> Result<(), Error> {
        check_columns(job.alpha, job.beta)?;
        let request = DeviceRequest {
            crossings: job.request.crossings,
            samples: 0,
            quadratures: true,
            end: self.closed_form().map_or(0.0, |observer| observer.inverse_radius()),
        };
        let points = (job.alpha, job.beta);
        device.trace(&self.hole, &self.view, points, &request, &mut block.device)?;
        for k in 0..job.alpha.len() {
            let ray = self.judge(k, job, block, visitor)?;
            block.rays.push(ray);
        }
        self.add_nodes(job, block, visitor)
    }

    /// What is known of ray `k` from the device, and whether it has to be traced step by step.
    fn judge<V: RayVisitor>(
        &self,
        k: usize,
        job: Job<'_>,
        block: &mut RayBlock,
        visitor: &V,
    ) -> Result<TracedRay, Error> {
        let RayBlock { plane, device, .. } = block;
        let end = &device.ends()[k];
        if !(end.is_trusted && end.error <= ROUGH) || self.needs_steps(job.request) {
            return Ok(TracedRay { stepped: true, ..TracedRay::default() });
        }
        let BlockRequest { crossings, all_crossings, half_orbits, paths, .. } = *job.request;
        let first = plane.len();
        if crossings > 0 {
            plane.extend_from_slice(device.crossings_of(k));
        }
        let (mut until, mut path) = (f64::INFINITY, PathUse::None);
        if paths || half_orbits.is_some() {
            let ray = self.view.ray(&self.hole, job.alpha[k], job.beta[k])?;
            until = self.until(&ray, half_orbits);
            path = if paths { visitor.needs_path(&ray) } else { path };
        }
        let own = &plane[first..];
        let surface = first_opaque(own, until, visitor);
        let most = half_orbits.map_or(usize::MAX, |n| n as usize + 1);
        let all =
            !all_crossings || surface.is_some() || own.len() >= (end.crossings as usize).min(most);
        let leaves = job.request.exit && end.outcome == Outcome::Escaped && surface.is_none();
        let stepped = !all || path == PathUse::Instead;
        let with_path = path == PathUse::Beside;
        let crossings = first..plane.len();
        Ok(TracedRay { until, surface, stepped, with_path, ..from_device(end, crossings, leaves) })
    }

    /// Whether nothing of the request can be had of a device: where nodes or samples have no closed form.
    fn needs_steps(&self, request: &BlockRequest) -> bool {
        let along = !request.nodes.is_empty() || request.probes.is_some();
        request.samples > 0 || along && self.closed_form().is_none()
    }

    /// Nodes of all rays, in closed form.
    fn add_nodes<V: RayVisitor>(
        &self,
        job: Job<'_>,
        block: &mut RayBlock,
        visitor: &mut V,
    ) -> Result<(), Error> {
        let Some(observer) = self.closed_form() else { return Ok(()) };
        if job.request.nodes.is_empty() && job.request.probes.is_none() {
            return Ok(());
        }
        let screen = ScreenRays::new(&self.hole, observer, job.alpha, job.beta)?;
        if let Some(probes) = &job.request.probes {
            self.probe(screen, probes, job, block, visitor)?;
        }
        for (number, sphere) in job.request.nodes.iter().enumerate() {
            visitor.works_on(Work::Nodes(number));
            self.refine_in_closed_form(screen, (number, sphere), job, block, visitor)?;
        }
        Ok(())
    }
}

fn from_device(end: &DeviceEnd, crossings: core::ops::Range<usize>, leaves: bool) -> TracedRay {
    TracedRay {
        lambda: end.lambda,
        eta: end.eta,
        outcome: end.outcome,
        crossing_count: end.crossings,
        crossings,
        mino_total: end.mino_time,
        exit: leaves.then_some(end.exit),
        ..TracedRay::default()
    }
}
