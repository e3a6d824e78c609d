//! Samples of whole rays, equidistant in Mino time.

use super::traced::SampleColumns;
use super::tracer::{BlockTracer, Job, RayBlock};
use super::visitor::RayVisitor;
use crate::error::Error;
use crate::integrate::path::Outcome;
use crate::rays::integrator::MinoPath;
use crate::rays::sampling::{Trajectory, mino_times};
use crate::screen::observer::{Observer, Ray};
use crate::simd::RaySamples;

impl BlockTracer {
    /// Hands samples of the rays in closed form to the visitor. From infinity, those that fall come
    /// first: they have one end there, others two.
    pub(super) fn sample_in_closed_form<V: RayVisitor>(
        &self,
        observer: &Observer,
        job: Job<'_>,
        block: &mut RayBlock,
        visitor: &mut V,
    ) -> Result<(), Error> {
        let RayBlock { rays, samples, .. } = block;
        let (n, at_infinity) = (job.request.samples, observer.is_at_infinity());
        let mut hand = |chosen: Vec<usize>, [first, last]: [usize; 2]| -> Result<(), Error> {
            let [alpha, beta] = job.pick(&chosen);
            let per_ray = (first + n + last).max(2);
            samples.trace(&self.hole, observer, &alpha, &beta, per_ray)?;
            for (place, k) in chosen.into_iter().enumerate() {
                visitor.take_samples(k, &rays[k], &samples.ray(place).part(first..first + n));
            }
            Ok(())
        };
        let closed = (0..rays.len()).filter(|k| !rays[*k].stepped);
        if !at_infinity {
            return hand(closed.collect(), [0, 0]);
        }
        let (falling, rising) = closed.partition(|k| rays[*k].outcome == Outcome::Captured);
        hand(falling, [1, 0])?;
        hand(rising, [1, 1])
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
        let trajectory = MinoPath { path, ray };
        if matches!(path.outcome(), Outcome::Unresolved(_)) {
            return;
        }
        let (total, escapes) = (trajectory.total(), path.outcome() == Outcome::Escaped);
        let times = mino_times(n, ray.inverse_radius == 0.0, !escapes);
        sampled.fill(path, times.map(|share| total * share));
        let SampleColumns { delay, radius, theta, azimuth } = sampled;
        let error = path.uncertainty_at(total).theta;
        let samples =
            RaySamples { delay, radius, theta, azimuth, mino_total: total, escapes, error };
        visitor.take_samples(k, &rays[k], &samples);
    }
}
