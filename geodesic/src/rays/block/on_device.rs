//! Rays of a block on a device.

use super::device::{DeviceEnd, DeviceRequest, RayDevice};
use super::request::{BlockRequest, SphereNodes};
use super::traced::TracedRay;
use super::tracer::{BlockTracer, Job, RayBlock};
use super::visitor::{PathUse, RayVisitor, Work, first_opaque};
use crate::error::Error;
use crate::integrate::outcome::Outcome;
use crate::rays::blocks::check_columns;
use crate::rays::nodes::{Node, NodeColumns};
use crate::simd::{PanelRule, ScreenRays};

/// The estimated error of a ray beyond which it is traced on this processor instead.
const ROUGH: f64 = 1e-3;

impl BlockTracer {
    /// Outcomes, crossings, directions of escape and nodes of the rays that `device` vouches for.
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
            end: self.end_on_device(),
            sphere: None,
        };
        let points = (job.alpha, job.beta);
        device.trace(&self.hole, &self.view, points, &request, &mut block.device)?;
        for k in 0..job.alpha.len() {
            let ray = self.judge(k, job, block, visitor)?;
            block.rays.push(ray);
        }
        self.add_nodes(device, job, block, visitor)
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

    /// Whether nothing of the request can be had of a device: where samples are wanted, or probes have no closed form.
    fn needs_steps(&self, request: &BlockRequest) -> bool {
        request.samples > 0 || request.probes.is_some() && self.closed_form().is_none()
    }

    /// Probes in closed form, and nodes of all rays on the device.
    fn add_nodes<V: RayVisitor>(
        &self,
        device: &dyn RayDevice,
        job: Job<'_>,
        block: &mut RayBlock,
        visitor: &mut V,
    ) -> Result<(), Error> {
        if let (Some(observer), Some(probes)) = (self.closed_form(), &job.request.probes) {
            let screen = ScreenRays::new(&self.hole, observer, job.alpha, job.beta)?;
            self.probe(screen, probes, job, block, visitor)?;
        }
        for (number, sphere) in job.request.nodes.iter().enumerate() {
            visitor.works_on(Work::Nodes(number));
            self.refine_on_device(device, (number, sphere), job, block, visitor)?;
        }
        Ok(())
    }

    /// Hands the nodes of all rays inside a sphere to the visitor, and finer ones of those rays that need them.
    fn refine_on_device<V: RayVisitor>(
        &self,
        device: &dyn RayDevice,
        (number, sphere): (usize, &SphereNodes),
        job: Job<'_>,
        block: &mut RayBlock,
        visitor: &mut V,
    ) -> Result<(), Error> {
        let end = self.end_on_device();
        let sought =
            DeviceRequest { sphere: Some(sphere.request.radius), end, ..DeviceRequest::default() };
        device.trace(&self.hole, &self.view, (job.alpha, job.beta), &sought, &mut block.device)?;
        let RayBlock { rays, plane, device: found, columns, .. } = block;
        let mut pending: Vec<usize> = (0..rays.len()).filter(|k| !rays[*k].stepped).collect();
        let mut split = sphere.request.split;
        while !pending.is_empty() {
            let mut spans = Vec::with_capacity(pending.len());
            columns.clear();
            for k in &pending {
                let first = columns.len();
                let (end, until) = (&found.ends()[*k], rays[*k].last_time());
                plan(end, until, (&sphere.request.rule, split), columns);
                spans.push(first..columns.len());
            }
            let [alpha, beta] = job.pick(&pending);
            device.place(&self.hole, &self.view, (&alpha, &beta), &spans, columns)?;
            let mut more = Vec::new();
            for (k, span) in pending.into_iter().zip(spans) {
                let crossings = &plane[rays[k].crossings.clone()];
                let nodes = columns.view(span);
                let done = visitor.take_nodes(number, k, &rays[k], crossings, &nodes);
                if !done && split < sphere.finest {
                    more.push(k);
                }
            }
            pending = more;
            split *= 2;
        }
        Ok(())
    }

    /// 1/r at which rays that escape end: at the observer's radius in closed form, else at infinity.
    fn end_on_device(&self) -> f64 {
        self.closed_form().map_or(0.0, |observer| observer.inverse_radius())
    }
}

/// Appends the Mino times of a ray's nodes, with steps of Mino time as weights.
fn plan(end: &DeviceEnd, until: f64, (rule, split): (&PanelRule, u32), columns: &mut NodeColumns) {
    let rate = (end.eta + end.lambda * end.lambda).max(1.0).sqrt();
    let node = |mino_time, weight| Node { mino_time, weight, ..Node::default() };
    for leg in end.legs(until) {
        leg.place(rule, leg.panels(rate, split), node, columns);
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
