//! Samples of whole rays, equidistant in Mino time.

use super::traced::SampleColumns;
use super::tracer::{BlockTracer, Job, RayBlock};
use super::visitor::RayVisitor;
use crate::error::Error;
use crate::integrate::outcome::Outcome;
use crate::rays::sampling::{Trajectory, mino_times};
use crate::rays::trajectory::MinoPath;
use crate::screen::observer::{Observer, Ray};
use crate::simd::{InstructionSet, RaySamples, Samples, ScreenRays};

impl BlockTracer {
    /// Samples the rays in closed form. From infinity, those that fall have one end there and others
    /// two: they are sampled apart.
    pub(super) fn sample_in_closed_form(
        &self,
        screen: ScreenRays<'_>,
        job: Job<'_>,
        block: &mut RayBlock,
    ) -> Result<(), Error> {
        let RayBlock { rays, falling, rising, places, .. } = block;
        let n = job.request.samples;
        places.clear();
        places.resize(rays.len(), 0);
        let mut sample = |samples: &mut Samples, chosen: Vec<usize>, ends: usize| {
            chosen.iter().enumerate().for_each(|(place, k)| places[*k] = place);
            let [alpha, beta] = job.pick(&chosen);
            let part = screen.part(&alpha, &beta);
            samples.trace_rays(InstructionSet::best(), part, (n + ends).max(2))
        };
        let closed = (0..rays.len()).filter(|k| !rays[*k].stepped);
        if !screen.is_at_infinity() {
            return sample(falling, closed.collect(), 0);
        }
        let (down, up) = closed.partition(|k| rays[*k].outcome == Outcome::Captured);
        sample(falling, down, 1)?;
        sample(rising, up, 2)
    }

    /// Hands the samples of ray number `k`, which is in closed form, to the visitor.
    pub(super) fn hand_samples<V: RayVisitor>(
        &self,
        observer: &Observer,
        (k, n): (usize, usize),
        block: &RayBlock,
        visitor: &mut V,
    ) {
        let RayBlock { rays, falling, rising, places, .. } = block;
        let first = usize::from(observer.is_at_infinity());
        let rises = first == 1 && rays[k].outcome == Outcome::Escaped;
        let samples = if rises { rising } else { falling }.ray(places[k]);
        visitor.take_samples(k, &rays[k], &samples.part(first..first + n));
    }

    /// Hands `n` samples of the block's path to the visitor.
    pub(super) fn sample_path<V: RayVisitor>(
        &self,
        k: usize,
        ray: &Ray,
        n: usize,
        RayBlock { rays, path, sampled, .. }: &mut RayBlock,
        visitor: &mut V,
    ) {
        let (trajectory, at_infinity) = MinoPath::seen_by(&self.view, path, ray);
        if path.outcome().is_unresolved() {
            return;
        }
        let (total, escapes) = (trajectory.total(), path.outcome() == Outcome::Escaped);
        let times = mino_times(n, at_infinity, !escapes);
        sampled.fill(times.map(|share| trajectory.at(total * share)));
        let SampleColumns { delay, radius, theta, azimuth } = sampled;
        let error = trajectory.uncertainty(total).theta;
        let samples =
            RaySamples { delay, radius, theta, azimuth, mino_total: total, escapes, error };
        visitor.take_samples(k, &rays[k], &samples);
    }
}
