//! Rays of a block that are traced step by step.

use super::request::BlockRequest;
use super::traced::{PathOfRay, PlaneCrossing, TracedRay};
use super::tracer::{BlockTracer, Job, RayBlock};
use super::visitor::{RayVisitor, Work, first_opaque};
use crate::error::Error;
use crate::integrate::outcome::Outcome;
use crate::rays::nodes;
use crate::rays::sampling::Trajectory;
use crate::rays::trajectory::MinoPath;
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
        crate::interrupt::check();
        visitor.works_on(Work::Rays);
        let ray = self.view.ray(&self.hole, job.alpha[k], job.beta[k])?;
        let tolerance = self.find_path(k, &ray, block);
        block.rays[k] = self.read(&ray, tolerance, job.request, block, visitor);
        if job.request.samples > 0 {
            self.sample_path(k, &ray, job.request.samples, block, visitor);
        }
        for sphere in 0..job.request.nodes.len() {
            visitor.works_on(Work::Nodes(sphere));
            self.refine_on_path((sphere, k), job.request, block, visitor);
        }
        self.hand_beam(k, job, block, visitor)?;
        let RayBlock { rays, plane, path, .. } = block;
        let crossings = &plane[rays[k].crossings.clone()];
        visitor.take(k, &rays[k], crossings, Some(PathOfRay { ray: &ray, path, tolerance }))
    }

    /// Hands a ray of the closed form, or of a device, to the visitor with its path.
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
        let tolerance = self.find_path(k, &ray, block);
        let RayBlock { rays, plane, path, .. } = block;
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

    /// Makes the block's path that of a ray: the one that a device has followed, or else traced step by step here. What
    /// it is known to.
    fn find_path(&self, k: usize, ray: &Ray, block: &mut RayBlock) -> f64 {
        let RayBlock { path, paths, followed, .. } = block;
        let place = followed.binary_search(&k).ok();
        let error = place.and_then(|place| paths.assemble(place, &self.hole, ray, path));
        if error.is_none() {
            self.tracer.trace(&self.hole, ray, Quantities::ALL, path);
        }
        error.unwrap_or(0.0).max(self.tracer.tolerance())
    }

    /// Reads all that is known of a ray from the block's path.
    fn read<V: RayVisitor>(
        &self,
        ray: &Ray,
        tolerance: f64,
        request: &BlockRequest,
        block: &mut RayBlock,
        visitor: &mut V,
    ) -> TracedRay {
        let RayBlock { path, plane, .. } = block;
        let first = plane.len();
        if request.crossings > 0 {
            let found = path.equatorial_crossings();
            plane.extend(found.map(|mino_time| PlaneCrossing {
                mino_time,
                ..PlaneCrossing::from(&path.at(mino_time))
            }));
        }
        let exit = request.exit.then(|| path.at(path.mino_total()).direction);
        let crossing_count = path.equatorial_crossings().len();
        let until = self.until(ray, request.half_orbits, crossing_count);
        let (whole, _) = MinoPath::seen_by(&self.view, path, ray);
        let off_plane = visitor.first_surface(PathOfRay { ray, path, tolerance });
        let off_plane = off_plane.filter(|time| *time <= until);
        let in_plane = first_opaque(&plane[first..], until, visitor);
        TracedRay {
            lambda: ray.lambda,
            eta: ray.eta,
            outcome: path.outcome(),
            crossing_count: crossing_count as u32,
            crossings: first..plane.len(),
            mino_total: whole.total(),
            until,
            surface: in_plane.into_iter().chain(off_plane).reduce(f64::min),
            exit: exit.filter(|_| path.outcome() == Outcome::Escaped),
            stepped: true,
            with_path: false,
        }
    }
}
