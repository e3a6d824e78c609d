//! Visitors of blocks of rays.

use super::traced::{PathOfRay, PlaneCrossing, TracedRay};
use crate::error::Error;
use crate::rays::footprint::Sky;
use crate::screen::observer::Ray;
use crate::simd::{RayNodes, RaySamples};

/// A consumer of a block of rays: it decides where rays end and takes the results.
pub trait RayVisitor {
    /// Returns whether a surface in the equatorial plane hides what is behind a crossing.
    fn is_opaque_at(&self, crossing: &PlaneCrossing) -> bool {
        let _ = crossing;
        false
    }

    /// Returns whether the path of a ray is needed, and its use.
    fn needs_path(&self, ray: &Ray) -> PathUse {
        let _ = ray;
        PathUse::None
    }

    /// Returns whether the path of a ray is needed, and its use, from coarse nodes along it: see
    /// [`BlockRequest::probes`](crate::BlockRequest::probes).
    fn needs_path_at(&self, ray: &TracedRay, nodes: &RayNodes<'_>) -> PathUse {
        let _ = (ray, nodes);
        PathUse::None
    }

    /// The Mino time at which a surface off the equatorial plane hides what is behind it.
    fn first_surface(&mut self, path: PathOfRay<'_>) -> Option<f64> {
        let _ = path;
        None
    }

    /// Takes the nodes of ray `number` inside sphere `sphere` of the request; whether they are fine
    /// enough. If they are not, it is asked again with panels cut in two.
    fn take_nodes(
        &mut self,
        sphere: usize,
        number: usize,
        ray: &TracedRay,
        crossings: &[PlaneCrossing],
        nodes: &RayNodes<'_>,
    ) -> bool {
        let _ = (sphere, number, ray, crossings, nodes);
        true
    }

    /// Takes the samples of ray `number`, which has an outcome. The last sample of a captured ray lies on the
    /// horizon, or within a relative 1e-8 outside of it in closed form.
    fn take_samples(&mut self, number: usize, ray: &TracedRay, samples: &RaySamples<'_>) {
        let _ = (number, ray, samples);
    }

    /// Takes where the beam of the ray that is taken next ends on the sky. Rays that meet a surface or are cut off
    /// have none.
    fn take_beam(&mut self, end: &Sky) {
        let _ = end;
    }

    /// Takes ray `number`: after its nodes and samples, and after the rays before it.
    ///
    /// # Errors
    /// Ends the block.
    fn take(
        &mut self,
        number: usize,
        ray: &TracedRay,
        crossings: &[PlaneCrossing],
        path: Option<PathOfRay<'_>>,
    ) -> Result<(), Error>;

    /// Told what is worked on from now on.
    fn works_on(&mut self, work: Work) {
        let _ = work;
    }
}

/// Use of the path of a ray.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PathUse {
    /// Nothing.
    None,
    /// The path serves sources of its own: crossings, nodes and the direction of escape stay those of the closed
    /// form.
    Beside,
    /// The path serves everything: the ray is traced step by step.
    Instead,
}

/// Purpose of work on a block.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Work {
    /// Outcomes, crossings, samples and paths.
    Rays,
    /// Nodes inside a sphere.
    Nodes(usize),
    /// Directions of escape.
    Exits,
}

/// The first crossing that hides the rest, unless that is after Mino time `until`.
#[inline(always)]
pub(super) fn first_opaque<V: RayVisitor>(
    plane: &[PlaneCrossing],
    until: f64,
    visitor: &V,
) -> Option<f64> {
    let first = plane.iter().find(|crossing| visitor.is_opaque_at(crossing));
    first.map(|crossing| crossing.mino_time).filter(|time| *time <= until)
}
