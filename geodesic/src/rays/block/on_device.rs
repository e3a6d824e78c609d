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
use crate::simd::{NodeRequest, PanelRule};
use core::ops::Range;

/// The estimated error of a ray beyond which it is traced on this processor instead.
const ROUGH: f64 = 1e-3;

impl BlockTracer {
    /// Outcomes, crossings, directions of escape, paths and nodes of the rays that `device` vouches for.
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
        if let Some(probes) = &job.request.probes {
            self.probe_on_device(device, probes, job, block, visitor)?;
        }
        self.follow_on_device(device, job, block)?;
        for (number, sphere) in job.request.nodes.iter().enumerate() {
            visitor.works_on(Work::Nodes(number));
            self.refine_on_device(device, (number, sphere), job, block, visitor)?;
        }
        Ok(())
    }

    /// Judges ray `k` by the device's results, and whether it has to be traced step by step.
    fn judge<V: RayVisitor>(
        &self,
        k: usize,
        job: Job<'_>,
        block: &mut RayBlock,
        visitor: &V,
    ) -> Result<TracedRay, Error> {
        let RayBlock { plane, device, followed, .. } = block;
        let end = &device.ends()[k];
        // Samples are those of this processor.
        if !(end.is_trusted && end.error <= ROUGH) || job.request.samples > 0 {
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
            until = self.until(&ray, half_orbits, end.crossings as usize);
            path = if paths { visitor.needs_path(&ray) } else { path };
            followed.extend((path != PathUse::None).then_some(k));
        }
        let own = &plane[first..];
        let surface = first_opaque(own, until, visitor);
        let most = half_orbits.map_or(usize::MAX, |n| n as usize + 1);
        let all =
            !all_crossings || surface.is_some() || own.len() >= (end.crossings as usize).min(most);
        let leaves = job.request.exit && end.outcome == Outcome::Escaped && surface.is_none();
        // It is not yet known where a ray goes that a device ends at a finite observer.
        let goes_on = leaves && self.end_on_device() > 0.0;
        let stepped = !all || goes_on || path == PathUse::Instead;
        let with_path = path == PathUse::Beside;
        let crossings = first..plane.len();
        Ok(TracedRay { until, surface, stepped, with_path, ..from_device(end, crossings, leaves) })
    }

    /// Finds the rays whose path is needed, from nodes along them.
    fn probe_on_device<V: RayVisitor>(
        &self,
        device: &dyn RayDevice,
        probes: &NodeRequest,
        job: Job<'_>,
        block: &mut RayBlock,
        visitor: &V,
    ) -> Result<(), Error> {
        let open: Vec<usize> = (0..block.rays.len()).filter(|k| !block.rays[*k].stepped).collect();
        self.find_legs(device, probes.radius, job, block)?;
        let spans = self.place(device, &open, (&probes.rule, probes.split), job, block)?;
        let RayBlock { rays, columns, followed, .. } = block;
        for (k, span) in open.into_iter().zip(spans) {
            let path = visitor.needs_path_at(&rays[k], &columns.view(span));
            rays[k].with_path |= path == PathUse::Beside;
            rays[k].stepped = path == PathUse::Instead;
            followed.extend((path != PathUse::None).then_some(k));
        }
        followed.sort_unstable();
        followed.dedup();
        Ok(())
    }

    /// Follows the rays whose path is needed.
    fn follow_on_device(
        &self,
        device: &dyn RayDevice,
        job: Job<'_>,
        block: &mut RayBlock,
    ) -> Result<(), Error> {
        if block.followed.is_empty() {
            return Ok(());
        }
        let [alpha, beta] = job.pick(&block.followed);
        device.follow(&self.hole, &self.view, (&alpha, &beta), &mut block.paths)
    }

    /// Finds when rays are inside a sphere.
    fn find_legs(
        &self,
        device: &dyn RayDevice,
        radius: f64,
        job: Job<'_>,
        block: &mut RayBlock,
    ) -> Result<(), Error> {
        let end = self.end_on_device();
        let sought = DeviceRequest { sphere: Some(radius), end, ..DeviceRequest::default() };
        device.trace(&self.hole, &self.view, (job.alpha, job.beta), &sought, &mut block.device)
    }

    /// Places nodes on some rays inside the sphere: which of the block's columns are those of each.
    fn place(
        &self,
        device: &dyn RayDevice,
        some: &[usize],
        (rule, split): (&PanelRule, u32),
        job: Job<'_>,
        RayBlock { rays, device: found, columns, .. }: &mut RayBlock,
    ) -> Result<Vec<Range<usize>>, Error> {
        let mut spans = Vec::with_capacity(some.len());
        columns.clear();
        for k in some {
            let first = columns.len();
            plan(&found.ends()[*k], rays[*k].last_time(), (rule, split), columns);
            spans.push(first..columns.len());
        }
        let [alpha, beta] = job.pick(some);
        device.place(&self.hole, &self.view, (&alpha, &beta), &spans, columns)?;
        Ok(spans)
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
        self.find_legs(device, sphere.request.radius, job, block)?;
        let open = |k: &usize| !block.rays[*k].stepped;
        let mut pending: Vec<usize> = (0..block.rays.len()).filter(open).collect();
        let mut split = sphere.request.split;
        while !pending.is_empty() {
            let spans = self.place(device, &pending, (&sphere.request.rule, split), job, block)?;
            let RayBlock { rays, plane, columns, .. } = &*block;
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

    /// 1/r at which rays that escape end: at the radius of an observer, else at infinity.
    fn end_on_device(&self) -> f64 {
        self.view.observer().map_or(0.0, |observer| observer.inverse_radius())
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

fn from_device(end: &DeviceEnd, crossings: Range<usize>, leaves: bool) -> TracedRay {
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
