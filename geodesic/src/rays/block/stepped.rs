//! Rays of a block that are traced step by step.

use super::request::BlockRequest;
use super::traced::{PathOfRay, PlaneCrossing, TracedRay};
use super::tracer::{BlockTracer, Job, RayBlock};
use super::visitor::{RayVisitor, Work, first_opaque};
use crate::error::Error;
use crate::integrate::outcome::Outcome;
use crate::rays::nodes;
use crate::screen::observer::Ray;
use crate::simd::NodeRequest;
use crate::spacetime::quantities::Quantities;

impl BlockTracer {
    /// Traces a ray step by step and hands it to the visitor.
    #[inline(never)]
    pub(super) fn finish_stepped<V: RayVisitor>(
        &self,
        k: usize,
        job: Job<'_>,
        block: &mut RayBlock,
        visitor: &mut V,
    ) -> Result<(), Error> {
        visitor.works_on(Work::Rays);
        let ray = self.view.ray(&self.hole, job.alpha[k], job.beta[k])?;
        block.rays[k] = self.step(&ray, job.request, block, visitor);
        if job.request.samples > 0 {
            self.sample_path(k, &ray, job.request.samples, block, visitor);
        }
        for sphere in 0..job.request.nodes.len() {
            visitor.works_on(Work::Nodes(sphere));
            self.refine_on_path((sphere, k), job.request, block, visitor);
        }
        self.hand_beam(k, job, block, visitor)?;
        let (RayBlock { rays, plane, path, .. }, tolerance) = (block, self.tracer.tolerance());
        let crossings = &plane[rays[k].crossings.clone()];
        visitor.take(k, &rays[k], crossings, Some(PathOfRay { ray: &ray, path, tolerance }))
    }

    /// Hands a ray of the closed form to the visitor with its path.
    #[inline(never)]
    pub(super) fn finish_with_path<V: RayVisitor>(
        &self,
        k: usize,
        job: Job<'_>,
        block: &mut RayBlock,
        visitor: &mut V,
    ) -> Result<(), Error> {
        self.hand_beam(k, job, block, visitor)?;
        visitor.works_on(Work::Rays);
        let ray = self.view.ray(&self.hole, job.alpha[k], job.beta[k])?;
        let (RayBlock { rays, plane, path, .. }, tolerance) = (block, self.tracer.tolerance());
        self.tracer.trace(&self.hole, &ray, Quantities::ALL, path);
        let crossings = &plane[rays[k].crossings.clone()];
        visitor.take(k, &rays[k], crossings, Some(PathOfRay { ray: &ray, path, tolerance }))
    }

    /// Hands the nodes of a ray inside a sphere to the visitor, until they are fine enough.
    fn refine_on_path<V: RayVisitor>(
        &self,
        (number, k): (usize, usize),
        request: &BlockRequest,
        block: &mut RayBlock,
        visitor: &mut V,
    ) {
        let RayBlock { rays, plane, path, columns, intervals, .. } = block;
        let (ray, sphere) = (&rays[k], &request.nodes[number]);
        let crossings = &plane[ray.crossings.clone()];
        let NodeRequest { radius, rule, .. } = &sphere.request;
        let mut split = sphere.request.split;
        loop {
            let reach = (*radius, ray.last_time());
            nodes::on_path((&self.hole, path), reach, (rule, split), intervals, columns);
            let done = visitor.take_nodes(number, k, ray, crossings, &columns.all());
            if done || split >= sphere.finest {
                break;
            }
            split *= 2;
        }
    }

    /// Traces one ray step by step into the block's path.
    fn step<V: RayVisitor>(
        &self,
        ray: &Ray,
        request: &BlockRequest,
        block: &mut RayBlock,
        visitor: &mut V,
    ) -> TracedRay {
        let RayBlock { path, plane, .. } = block;
        self.tracer.trace(&self.hole, ray, Quantities::ALL, path);
        let first = plane.len();
        if request.crossings > 0 {
            let found = path.equatorial_crossings();
            plane.extend(found.map(|mino_time| PlaneCrossing {
                mino_time,
                ..PlaneCrossing::from(&path.at(mino_time))
            }));
        }
        let exit = request.exit.then(|| path.at(path.mino_total()).direction);
        let until = self.until(ray, request.half_orbits);
        let off_plane =
            visitor.first_surface(PathOfRay { ray, path, tolerance: self.tracer.tolerance() });
        let off_plane = off_plane.filter(|time| *time <= until);
        let in_plane = first_opaque(&plane[first..], until, visitor);
        TracedRay {
            lambda: ray.lambda,
            eta: ray.eta,
            outcome: path.outcome(),
            crossing_count: path.equatorial_crossings().len() as u32,
            crossings: first..plane.len(),
            mino_total: path.mino_total(),
            until,
            surface: in_plane.into_iter().chain(off_plane).reduce(f64::min),
            exit: exit.filter(|_| path.outcome() == Outcome::Escaped),
            stepped: true,
            with_path: false,
        }
    }
}
