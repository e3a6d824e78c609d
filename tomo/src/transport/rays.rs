//! Rays of one observer, however they are traced, as the sources want them.

use super::spots::SpotTree;
use super::surface::Hit;
use super::tree::enters;
use super::{PreparedScene, Scratch};
use crate::emission::disc::DiscModel;
use crate::transport::result::Place;
use kerrlight_geodesic::analytic::ClosedForm;
use kerrlight_geodesic::simd::{Crossing, RayEnds, Samples};
use kerrlight_geodesic::{Observer, OutOfRange, Outcome, Quantities, Ray};
use std::sync::Arc;

/// A ray without its points.
#[derive(Debug, Clone, Default)]
pub(super) struct TracedRay {
    pub lambda: f64,
    /// Of matter that plunges, or of rays traced by steps; else NaN.
    pub eta: f64,
    pub end: End,
    /// Equatorial crossings of the whole ray.
    pub crossings: u32,
    /// Its crossings in [`Scratch::hits`]: as many as the sources need.
    pub hits: core::ops::Range<usize>,
    /// Mino time of the whole ray.
    pub total: f64,
    /// Mino time at which light stops to be taken.
    pub until: f64,
    /// Mino time of the first opaque surface.
    pub surface: Option<f64>,
    /// Direction in which it leaves, if it does and there is a sky.
    pub exit: Option<[f64; 3]>,
    /// Whether it is left to be traced by steps.
    pub by_steps: bool,
}

impl TracedRay {
    /// Mino time of the last light.
    pub fn last_time(&self) -> f64 {
        self.surface.unwrap_or(f64::INFINITY).min(self.until)
    }
}

/// What becomes of a ray that meets no surface.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(super) enum End {
    Captured,
    Escaped,
    #[default]
    Unresolved,
}

/// Crossings that the SIMD kernel is asked for; rays with more go step by step.
pub(super) const MOST_HITS: usize = 4;

impl PreparedScene {
    /// Traces a block of rays in closed form.
    pub(super) fn trace_block(
        &self,
        observer: &Observer,
        (alpha, beta): (&[f64], &[f64]),
        (times, trees): (&[f64], &[Option<Arc<SpotTree>>]),
        scratch: &mut Scratch,
    ) -> Result<(), OutOfRange> {
        let sighted = self.sights_spots(times);
        let trees = if sighted { &[] } else { trees };
        let wanted = if self.disc.is_some() { MOST_HITS } else { 1 };
        let crossings = &mut scratch.crossings;
        crossings.trace(&self.hole, observer, alpha, beta, wanted)?;
        let plunges = self.disc.as_ref().is_some_and(DiscModel::plunges);
        let asked = self.polarization.is_some()
            || plunges
            || self.half_orbits.is_some()
            || self.meshes.is_some()
            || self.media.iter().any(|medium| medium.cell_size().is_some())
            || !trees.is_empty() && !self.spots.is_empty();
        for k in 0..alpha.len() {
            let ends = scratch.crossings.ends(k);
            // Its radial potential takes as long as all the rest.
            let ray = asked.then(|| observer.ray(&self.hole, alpha[k], beta[k])).transpose()?;
            let first = scratch.hits.len();
            if self.disc.is_some() {
                let moved = ray.as_ref().filter(|_| self.polarization.is_some() || plunges);
                let motion = moved.map(|ray| PlaneMotion::new(ray, &ends));
                let rates = |number: usize, crossing: &Crossing| {
                    motion.as_ref().map_or([0.0; 2], |motion| motion.rates(number, crossing))
                };
                let found = scratch.crossings.ray(k).enumerate();
                scratch.hits.extend(found.map(|(number, crossing)| Hit {
                    rates: rates(number, &crossing),
                    ..Hit::new(&crossing)
                }));
            }
            let found = scratch.hits.len() - first;
            let until = ray.as_ref().map_or(f64::INFINITY, |ray| self.until(ray));
            let surface = self.surface(scratch.hits[first..].iter().copied(), until);
            let missing = self.disc.is_some()
                && surface.is_none()
                && found < (ends.crossings as usize).min(self.most_hits());
            scratch.traced.push(TracedRay {
                lambda: -alpha[k] * observer.inclination().sin(),
                eta: ray.as_ref().map_or(f64::NAN, |ray| ray.eta),
                end: if ends.escapes { End::Escaped } else { End::Captured },
                crossings: ends.crossings,
                total: ends.mino_total,
                hits: first..first + found,
                until,
                surface,
                exit: None,
                by_steps: missing
                    || needs_stepping(ends.error, self.tolerance)
                    || ray.as_ref().is_some_and(|ray| self.needs_path(ray, trees)),
            });
        }
        if sighted {
            self.sight_spots(observer, (alpha, beta), times, scratch)?;
        }
        if self.sky.is_none() {
            return Ok(());
        }
        let leaves = |traced: &TracedRay| {
            traced.end == End::Escaped && traced.surface.is_none() && !traced.by_steps
        };
        let Scratch { traced, samples, .. } = scratch;
        let outward: Vec<usize> = (0..traced.len()).filter(|k| leaves(&traced[*k])).collect();
        self.find_exits(observer, (alpha, beta), &outward, samples, |k, exit| {
            traced[k].exit = Some(exit);
        })
    }

    /// Tells for the rays of `outward`, which escape, where they go.
    pub(super) fn find_exits(
        &self,
        observer: &Observer,
        (alpha, beta): (&[f64], &[f64]),
        outward: &[usize],
        samples: &mut Samples,
        mut tell: impl FnMut(usize, [f64; 3]),
    ) -> Result<(), OutOfRange> {
        if outward.is_empty() {
            return Ok(());
        }
        let pick = |column: &[f64]| outward.iter().map(|k| column[*k]).collect::<Vec<_>>();
        let (alpha, beta) = (pick(alpha), pick(beta));
        samples.trace(&self.hole, observer, &alpha, &beta, 2)?;
        for (j, k) in outward.iter().enumerate() {
            let ray = samples.ray(j);
            let (sin, u) = ray.theta[1].sin_cos();
            let (y, x) = ray.azimuth[1].sin_cos();
            tell(*k, [sin * x, sin * y, u]);
        }
        Ok(())
    }

    /// Whether some source may want the path of a ray.
    fn needs_path(&self, ray: &Ray, trees: &[Option<Arc<SpotTree>>]) -> bool {
        let meets = |tree: &Option<Arc<SpotTree>>| match tree {
            Some(tree) => tree.can_be_met(ray),
            None => !self.spots.is_empty(),
        };
        self.meshes.as_ref().is_some_and(|meshes| self.one_by_one || meshes.can_be_met(ray))
            || self.media.iter().any(|m| m.cell_size().is_some() && enters(ray, m.sphere()))
            || trees.iter().any(meets)
    }

    /// Traces one ray step by step into the path of `scratch`; what is known of it.
    pub(super) fn trace_steps(&self, ray: &Ray, scratch: &mut Scratch) -> TracedRay {
        self.tracer.trace(&self.hole, ray, Quantities::ALL, &mut scratch.path);
        let (first, path, hits) = (scratch.hits.len(), &scratch.path, &mut scratch.hits);
        if self.disc.is_some() {
            hits.extend(path.equatorial_crossings().map(|mino_time| {
                let point = path.at(mino_time);
                let rates = [point.inverse_radius_rate, point.velocity[2]];
                Hit { mino_time, place: Place::of_point(&point), rates, depth: 0.0 }
            }));
        }
        let end = match path.outcome() {
            Outcome::Captured => End::Captured,
            Outcome::Escaped => End::Escaped,
            Outcome::Unresolved(_) => End::Unresolved,
        };
        let exit = self.sky.as_ref().map(|_| path.at(path.mino_total()).direction);
        let (crossings, total) = (path.equatorial_crossings().len() as u32, path.mino_total());
        let hits = first..hits.len();
        let until = self.until(ray);
        let hidden = self.meet_meshes(ray, scratch).filter(|time| *time <= until);
        let disc = self.surface(scratch.hits[hits.clone()].iter().copied(), until);
        let surface = match (disc, hidden) {
            (Some(disc), Some(mesh)) => Some(disc.min(mesh)),
            (one, other) => one.or(other),
        };
        TracedRay {
            lambda: ray.lambda,
            eta: ray.eta,
            end,
            crossings,
            total,
            surface,
            hits,
            until,
            exit: exit.filter(|_| end == End::Escaped),
            by_steps: true,
        }
    }

    /// How many crossings may be seen.
    fn most_hits(&self) -> usize {
        self.half_orbits.map_or(usize::MAX, |n| n as usize + 1)
    }

    /// The Mino time half-way between the last crossing that counts and the next.
    fn until(&self, ray: &Ray) -> f64 {
        let Some(n) = self.half_orbits else { return f64::INFINITY };
        let form = ClosedForm::new(&self.hole, ray);
        let mut times = form.crossings().skip(n as usize).map(|crossing| crossing.mino_time);
        match (times.next(), times.next()) {
            (Some(last), Some(next)) => 0.5 * (last + next),
            _ => f64::INFINITY,
        }
    }
}

/// How a ray goes through the equatorial plane.
struct PlaneMotion<'a> {
    ray: &'a Ray,
    /// Mino time of the turning point.
    turning: f64,
    /// d cos θ/dτ at the first crossing.
    fall: f64,
}

impl<'a> PlaneMotion<'a> {
    fn new(ray: &'a Ray, ends: &RayEnds) -> Self {
        let turning = if ends.escapes { 0.5 * ends.mino_total } else { f64::INFINITY };
        // Towards the plane; from a place in it a ray comes back to it from the side it left to.
        let side = if ray.position[2] == 0.0 { ray.velocity[2] } else { ray.position[2] };
        let eta = ray.eta.max(0.0);
        PlaneMotion { ray, turning, fall: -eta.sqrt().copysign(side) }
    }

    /// dw/dτ and d cos θ/dτ at a crossing.
    fn rates(&self, number: usize, crossing: &Crossing) -> [f64; 2] {
        let speed = self.ray.potential.value(1.0 / crossing.radius).max(0.0).sqrt();
        let w_rate = if crossing.mino_time < self.turning { speed } else { -speed };
        [w_rate, if number.is_multiple_of(2) { self.fall } else { -self.fall }]
    }
}

/// Whether a ray of the closed form has lost digits that the tolerance asks for.
pub(super) fn needs_stepping(error: f64, tolerance: f64) -> bool {
    error.is_nan() || error > tolerance.max(1e-11)
}
