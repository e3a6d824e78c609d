//! Rays of a block in closed form, on SIMD lanes.

use super::request::{BlockRequest, SphereNodes};
use super::traced::{PlaneCrossing, TracedRay};
use super::tracer::{BlockTracer, Job, RayBlock};
use super::visitor::{PathUse, RayVisitor, Work, first_opaque};
use crate::error::Error;
use crate::integrate::outcome::Outcome;
use crate::screen::observer::{Observer, Ray};
use crate::simd::{Crossings, InstructionSet, NodeRequest, RayEnds, ScreenRays};

/// Rays whose nodes are in memory at once: few enough for the second-level cache.
const TOGETHER: usize = 128;

/// The finest tolerance against which the closed form's own estimate of its error is held.
const FINEST: f64 = 1e-11;

/// The columns of the crossings that were located in closed form.
struct Located<'a> {
    per_ray: usize,
    mino_time: &'a [f64],
    radius: &'a [f64],
    azimuth: &'a [f64],
    delay: &'a [f64],
    error: &'a [f64],
}

impl<'a> Located<'a> {
    fn of(found: &'a Crossings) -> Self {
        Located {
            per_ray: found.per_ray(),
            mino_time: found.mino_time(),
            radius: found.radius(),
            azimuth: found.azimuth(),
            delay: found.delay(),
            error: found.error(),
        }
    }

    /// Appends those of ray number `k`.
    #[inline(always)]
    fn copy(&self, k: usize, plane: &mut Vec<PlaneCrossing>) {
        for m in k * self.per_ray..(k + 1) * self.per_ray {
            let mino_time = self.mino_time[m];
            if mino_time.is_nan() {
                break;
            }
            let (radius, azimuth, delay) = (self.radius[m], self.azimuth[m], self.delay[m]);
            let (rates, error) = ([0.0; 2], self.error[m]);
            plane.push(PlaneCrossing { mino_time, radius, azimuth, delay, rates, error });
        }
    }
}

/// Cost and result of inspecting a ray's radial potential.
struct Inspected {
    eta: f64,
    until: f64,
    path: PathUse,
}

impl BlockTracer {
    /// Outcomes, crossings, nodes and directions of escape of the rays that the closed form serves.
    pub(super) fn trace_in_closed_form<V: RayVisitor>(
        &self,
        observer: &Observer,
        job: Job<'_>,
        block: &mut RayBlock,
        visitor: &mut V,
    ) -> Result<(), Error> {
        let located = job.request.crossings.max(1);
        let screen = ScreenRays::new(&self.hole, observer, job.alpha, job.beta)?;
        block.crossings.trace_rays(InstructionSet::best(), screen, located)?;
        self.classify(observer, job, block, visitor)?;
        if let Some(probes) = &job.request.probes {
            self.probe(screen, probes, job, block, visitor)?;
        }
        if job.request.exit {
            visitor.works_on(Work::Exits);
            self.find_exits(screen, job, block)?;
        }
        if job.request.samples > 0 {
            self.sample_in_closed_form(screen, job, block)?;
        }
        for (number, sphere) in job.request.nodes.iter().enumerate() {
            visitor.works_on(Work::Nodes(number));
            self.refine_in_closed_form(screen, (number, sphere), job, block, visitor)?;
        }
        Ok(())
    }

    /// Decides for each ray where it ends, and whether it has to be traced step by step.
    fn classify<V: RayVisitor>(
        &self,
        observer: &Observer,
        job: Job<'_>,
        block: &mut RayBlock,
        visitor: &V,
    ) -> Result<(), Error> {
        let BlockRequest { crossings, all_crossings, rates, half_orbits, paths, exit, .. } =
            *job.request;
        let with_ray = rates || paths || half_orbits.is_some();
        let most = half_orbits.map_or(usize::MAX, |n| n as usize + 1);
        let RayBlock { rays, plane, crossings: found, .. } = block;
        let located = Located::of(found);
        rays.reserve(job.alpha.len());
        plane.reserve(job.alpha.len());
        let points = job.alpha.iter().zip(job.beta);
        for (k, ((alpha, beta), ends)) in points.zip(found.all_ends()).enumerate() {
            let first = plane.len();
            if crossings > 0 {
                located.copy(k, plane);
            }
            let own = &mut plane[first..];
            let Inspected { eta, until, path } = if with_ray {
                // Its radial potential takes as long as all the rest.
                let ray = observer.ray(&self.hole, *alpha, *beta)?;
                self.inspect(&ray, &ends, job.request, own, visitor)
            } else {
                Inspected { eta: f64::NAN, until: f64::INFINITY, path: PathUse::None }
            };
            let surface = first_opaque(own, until, visitor);
            // The closed form ends at the observer's radius, where it is not yet known where a ray goes.
            let goes_on = exit && ends.escapes && surface.is_none() && !observer.is_at_infinity();
            let all = !all_crossings
                || surface.is_some()
                || own.len() >= (ends.crossings as usize).min(most);
            rays.push(TracedRay {
                lambda: observer.lambda(*alpha),
                eta,
                outcome: if ends.escapes { Outcome::Escaped } else { Outcome::Captured },
                crossing_count: ends.crossings,
                crossings: first..plane.len(),
                mino_total: ends.mino_total,
                until,
                surface,
                exit: None,
                stepped: !all || goes_on || path == PathUse::Instead || self.loses_digits(&ends),
                with_path: path == PathUse::Beside,
            });
        }
        Ok(())
    }

    /// Inspects a ray's radial potential.
    #[inline(never)]
    fn inspect<V: RayVisitor>(
        &self,
        ray: &Ray,
        ends: &RayEnds,
        request: &BlockRequest,
        plane: &mut [PlaneCrossing],
        visitor: &V,
    ) -> Inspected {
        if request.rates {
            add_rates(ray, ends, plane);
        }
        let path = if request.paths { visitor.needs_path(ray) } else { PathUse::None };
        Inspected {
            eta: ray.eta,
            until: self.until(ray, request.half_orbits, ends.crossings as usize),
            path,
        }
    }

    /// Finds the rays whose path is needed beside the closed form, or instead of it.
    fn probe<V: RayVisitor>(
        &self,
        screen: ScreenRays<'_>,
        probes: &NodeRequest,
        job: Job<'_>,
        RayBlock { rays, nodes, .. }: &mut RayBlock,
        visitor: &V,
    ) -> Result<(), Error> {
        let set = InstructionSet::best();
        let open: Vec<usize> = (0..rays.len()).filter(|k| !rays[*k].stepped).collect();
        let [alpha, beta] = job.pick(&open);
        let until: Vec<f64> = open.iter().map(|k| rays[*k].last_time()).collect();
        nodes.trace_rays(set, screen.part(&alpha, &beta), Some(&until), probes)?;
        for (number, k) in open.into_iter().enumerate() {
            let path = visitor.needs_path_at(&rays[k], &nodes.ray(number));
            rays[k].with_path = path == PathUse::Beside;
            rays[k].stepped = path == PathUse::Instead;
        }
        Ok(())
    }

    /// Returns whether the closed form has an error above the tolerance, or no end.
    #[inline]
    fn loses_digits(&self, ends: &RayEnds) -> bool {
        let known = ends.error <= self.tracer.tolerance().max(FINEST);
        !(known && ends.mino_total.is_finite())
    }

    /// Finds where the rays go that meet no surface and escape.
    fn find_exits(
        &self,
        screen: ScreenRays<'_>,
        job: Job<'_>,
        RayBlock { rays, exits, .. }: &mut RayBlock,
    ) -> Result<(), Error> {
        let leaves = |ray: &TracedRay| {
            ray.outcome == Outcome::Escaped && ray.surface.is_none() && !ray.stepped
        };
        let outward: Vec<usize> = (0..rays.len()).filter(|k| leaves(&rays[*k])).collect();
        if outward.is_empty() {
            return Ok(());
        }
        let [alpha, beta] = job.pick(&outward);
        exits.trace_rays(InstructionSet::best(), screen.part(&alpha, &beta), 2)?;
        for (j, k) in outward.into_iter().enumerate() {
            let ray = exits.ray(j);
            let (sin, u) = ray.theta[1].sin_cos();
            let (y, x) = ray.azimuth[1].sin_cos();
            rays[k].exit = Some([sin * x, sin * y, u]);
        }
        Ok(())
    }

    /// Hands the nodes of all rays inside a sphere to the visitor, and finer ones of those rays
    /// that need them.
    fn refine_in_closed_form<V: RayVisitor>(
        &self,
        screen: ScreenRays<'_>,
        (number, sphere): (usize, &SphereNodes),
        job: Job<'_>,
        block: &mut RayBlock,
        visitor: &mut V,
    ) -> Result<(), Error> {
        let RayBlock { rays, plane, nodes, .. } = block;
        let mut pending: Vec<usize> = (0..rays.len()).filter(|k| !rays[*k].stepped).collect();
        let (set, mut request) = (InstructionSet::best(), sphere.request.clone());
        while !pending.is_empty() {
            let mut more = Vec::new();
            for some in pending.chunks(TOGETHER) {
                let [alpha, beta] = job.pick(some);
                let until: Vec<f64> = some.iter().map(|k| rays[*k].last_time()).collect();
                nodes.trace_rays(set, screen.part(&alpha, &beta), Some(&until), &request)?;
                for (place, k) in some.iter().enumerate() {
                    let crossings = &plane[rays[*k].crossings.clone()];
                    let nodes = nodes.ray(place);
                    let done = visitor.take_nodes(number, *k, &rays[*k], crossings, &nodes);
                    if !done && request.split < sphere.finest {
                        more.push(*k);
                    }
                }
            }
            pending = more;
            request.split *= 2;
        }
        Ok(())
    }
}

/// Adds dw/dτ and d cos θ/dτ to the crossings of a ray.
fn add_rates(ray: &Ray, ends: &RayEnds, plane: &mut [PlaneCrossing]) {
    let turning = if ends.escapes { 0.5 * ends.mino_total } else { f64::INFINITY };
    // Towards the plane; from a place in it a ray comes back to it from the side it left to.
    let side = if ray.position[2] == 0.0 { ray.velocity[2] } else { ray.position[2] };
    let mut fall = -ray.eta.max(0.0).sqrt().copysign(side);
    for crossing in plane {
        let speed = ray.potential.value(1.0 / crossing.radius).max(0.0).sqrt();
        crossing.rates = [if crossing.mino_time < turning { speed } else { -speed }, fall];
        fall = -fall;
    }
}
