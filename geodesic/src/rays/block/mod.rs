//! Blocks of rays of one view, traced once for everything that is to be known about them: in closed
//! form on SIMD lanes where that keeps its digits, else step by step.

mod closed_form;
mod device;
mod device_paths;
mod on_device;
mod request;
mod samples;
mod stepped;
mod traced;
mod tracer;
mod visitor;

pub use device::{DeviceEnd, DeviceRays, DeviceRequest, DeviceSample, RayDevice};
pub use device_paths::DevicePaths;
pub use request::{BlockRequest, SphereNodes};
pub use traced::{PathOfRay, PlaneCrossing, TracedRay};
pub use tracer::{BlockTracer, RayBlock};
pub use visitor::{PathUse, RayVisitor, Work};

use crate::error::Error;
use crate::interrupt;
use crate::rays::blocks::check_columns;
use crate::rays::footprint;
use tracer::Job;

impl BlockTracer {
    /// Traces the rays that arrive at the points (`alpha[k]`, `beta[k]`) of the view, on the
    /// caller's thread, and hands them to `visitor` in their order. No ray depends on another.
    ///
    /// # Errors
    /// If the columns differ in length, no ray arrives at one of the points, or a number of the
    /// request is out of its range; the visitor's own errors.
    pub fn trace<V: RayVisitor>(
        &self,
        alpha: &[f64],
        beta: &[f64],
        request: &BlockRequest,
        block: &mut RayBlock,
        visitor: &mut V,
    ) -> Result<(), Error> {
        let job = Job { alpha, beta, request };
        block.rays.clear();
        block.plane.clear();
        block.followed.clear();
        visitor.works_on(Work::Rays);
        interrupt::check();
        match (&self.device, self.closed_form()) {
            (Some(device), _) => self.trace_on_device(&**device, job, block, visitor)?,
            (None, Some(observer)) => self.trace_in_closed_form(observer, job, block, visitor)?,
            (None, None) => {
                check_columns(alpha, beta)?;
                let unknown = TracedRay { stepped: true, ..TracedRay::default() };
                block.rays.resize(alpha.len(), unknown);
            }
        }
        (0..alpha.len()).try_for_each(|k| self.finish(k, job, block, visitor))
    }

    /// Hands a ray to the visitor; first traces it step by step if it has to be.
    #[inline]
    fn finish<V: RayVisitor>(
        &self,
        k: usize,
        job: Job<'_>,
        block: &mut RayBlock,
        visitor: &mut V,
    ) -> Result<(), Error> {
        if block.rays[k].stepped {
            return self.finish_stepped(k, job, block, visitor);
        }
        if let (1.., Some(observer)) = (job.request.samples, self.closed_form()) {
            self.hand_samples(observer, (k, job.request.samples), block, visitor);
        }
        if block.rays[k].with_path {
            return self.finish_with_path(k, job, block, visitor);
        }
        self.hand_beam(k, job, block, visitor)?;
        let ray = &block.rays[k];
        visitor.take(k, ray, &block.plane[ray.crossings.clone()], None)
    }

    /// Hands the beam of a ray to the visitor, if it is requested and reaches the sky.
    #[inline]
    fn hand_beam<V: RayVisitor>(
        &self,
        k: usize,
        job: Job<'_>,
        block: &mut RayBlock,
        visitor: &mut V,
    ) -> Result<(), Error> {
        let ray = &block.rays[k];
        let is_seen = ray.exit.is_some() && ray.surface.is_none() && ray.until >= ray.mino_total;
        if !(job.request.beams && is_seen) {
            return Ok(());
        }
        visitor.works_on(Work::Exits);
        let beam = self.view.beam(&self.hole, job.alpha[k], job.beta[k])?;
        let (hole, tolerance) = (self.hole.lift(), self.tracer.tolerance());
        if let Some(end) = footprint::of_ray(&hole, &beam, tolerance, &mut block.beam)? {
            visitor.take_beam(&end);
        }
        Ok(())
    }
}
