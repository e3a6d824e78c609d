//! Every way to trace rays, behind one interface and with one kind of result.

use crate::error::Error;
use crate::integrate::path::Path;
use crate::integrate::trace::Tracer;
#[cfg(feature = "affine")]
use crate::rays::affine_pair::AffinePair;
use crate::rays::block::{BlockRequest, BlockTracer};
use crate::rays::blocks::{BLOCK, check_columns, in_blocks};
use crate::rays::columns::RayTable;
use crate::rays::elliptic_rays;
use crate::rays::integrator::Integrator;
use crate::rays::request::Request;
use crate::rays::sampling::{self, Sampler};
use crate::rays::trajectory::MinoPath;
use crate::screen::observer::Observer;
use crate::screen::view::View;
use crate::spacetime::kerr::Kerr;

/// What all rays have in common.
#[derive(Clone, Copy)]
struct Job<'a> {
    hole: &'a Kerr,
    observer: &'a Observer,
    tolerance: f64,
    request: &'a Request,
    rule: &'a [(f64, f64)],
}

/// Rays in closed form that one task works on: many registers' worth.
const TOGETHER: usize = 512;

impl Integrator {
    /// Traces the rays that arrive at (`alpha[k]`, `beta[k]`) and takes from them what is
    /// requested, on all cores with the feature `rayon`. A ray depends on nothing but itself:
    /// the number of threads does not change a bit of the result.
    ///
    /// ```
    /// use kerrlight_geodesic::{Inclination, Integrator, Kerr, Observer, Outcome, Request};
    /// let hole = Kerr::new(0.94)?;
    /// let observer = Observer::at_infinity(Inclination::from_degrees(60.0)?);
    /// let (alpha, beta) = ([-6.0, 0.5], [2.0, 0.5]);
    /// let request = Request::crossings(1);
    /// let rays = Integrator::TaylorMino.trace(&hole, &observer, &alpha, &beta, 1e-10, &request)?;
    /// assert_eq!(rays.outcome, [Outcome::Escaped, Outcome::Captured]);
    /// println!("meets the disc at r = {}", rays.crossings.radius[rays.crossings.of(0)][0]);
    /// # Ok::<(), kerrlight_geodesic::Error>(())
    /// ```
    ///
    /// # Errors
    /// If the columns differ in length, a number is out of its range (the request's, the
    /// tolerance's, those of [`Observer::ray`]), or the observer is at infinity where the
    /// integrator cannot have it.
    pub fn trace(
        self,
        hole: &Kerr,
        observer: &Observer,
        alpha: &[f64],
        beta: &[f64],
        tolerance: f64,
        request: &Request,
    ) -> Result<RayTable, Error> {
        check_columns(alpha, beta)?;
        request.check()?;
        let rule = sampling::rule(request);
        let job = Job { hole, observer, tolerance, request, rule: &rule };
        let closed = self.closed_form(job)?;
        let pieces = match &closed {
            Some((tracer, wanted)) => in_blocks(TOGETHER, alpha, beta, |alpha, beta| {
                elliptic_rays::trace_block(tracer, observer, [alpha, beta], wanted, request)
            }),
            None => in_blocks(BLOCK, alpha, beta, |alpha, beta| self.step_block(job, alpha, beta)),
        };
        let pieces = pieces.into_iter().collect::<Result<Vec<_>, _>>()?;
        Ok(RayTable::joined(pieces, request))
    }

    /// What traces rays in closed form and what for, if that is how they are traced.
    fn closed_form(self, job: Job<'_>) -> Result<Option<(BlockTracer, BlockRequest)>, Error> {
        if self != Integrator::Elliptic {
            return Ok(None);
        }
        let view = View::Screen(*job.observer);
        let tracer = BlockTracer::new(*job.hole, view, self, job.tolerance)?;
        let wanted = elliptic_rays::in_closed_form(job.request);
        Ok(wanted.filter(|_| tracer.closed_form().is_some()).map(|wanted| (tracer, wanted)))
    }

    fn step_block(self, job: Job<'_>, alpha: &[f64], beta: &[f64]) -> Result<RayTable, Error> {
        let Job { hole, observer, tolerance, request, rule } = job;
        let at_infinity = observer.is_at_infinity();
        let mut sampler = Sampler::new(request, hole, at_infinity, rule, RayTable::default());
        let rays = alpha.iter().zip(beta);
        let Some(method) = self.method() else {
            #[cfg(feature = "affine")]
            for (alpha, beta) in rays {
                let ray = observer.ray(hole, *alpha, *beta)?;
                let pair = AffinePair::trace(hole, observer, [*alpha, *beta], tolerance, request)?;
                sampler.take(&pair, ray.lambda);
            }
            return Ok(sampler.sink);
        };
        let tracer = Tracer::with_method(method, tolerance)?;
        let mut path = Path::new();
        for (alpha, beta) in rays {
            let ray = observer.ray(hole, *alpha, *beta)?;
            tracer.trace(hole, &ray, request.quantities(), &mut path);
            sampler.take(&MinoPath::new(&path, &ray), ray.lambda);
        }
        Ok(sampler.sink)
    }
}
