//! Every way to trace rays, behind one interface and with one kind of result.

use crate::error::Error;
use crate::integrate::path::Path;
use crate::integrate::trace::Tracer;
use crate::interrupt;
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
use crate::spacetime::quantities::Quantities;

/// Input that all rays have in common.
#[derive(Clone, Copy)]
struct Job<'a> {
    hole: &'a Kerr,
    view: &'a View,
    tolerance: f64,
    request: &'a Request,
    rule: &'a [(f64, f64)],
    /// True if directions of escape are wanted.
    exit: bool,
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
        let view = &View::Screen(*observer);
        self.trace_job(Job { hole, view, tolerance, request, rule: &[], exit: false }, alpha, beta)
    }

    /// The same for the rays that arrive at the points (`x[k]`, `y[k]`) of a view, (α, β) of an observer's screen or (x, y)
    /// of a camera's picture plane, with the direction in which each escapes. Rays of cameras are followed to infinity, and
    /// step by step.
    ///
    /// ```
    /// use kerrlight_geodesic::{Camera, Inclination, Integrator, Kerr, Motion, Outcome, Request, View};
    /// let hole = Kerr::new(0.9)?;
    /// let camera = Camera::new(&hole, Inclination::from_degrees(80.0)?, 12.0, Motion::Static)?;
    /// let (view, request) = (View::Camera(camera), Request::default());
    /// let rays =
    ///     Integrator::TaylorMino.trace_view(&hole, &view, &[0.0, 1.2], &[0.0, 0.3], 1e-10, &request)?;
    /// assert_eq!(rays.outcome, [Outcome::Captured, Outcome::Escaped]);
    /// let [x, y, z] = rays.exit[1]; // where on the sky this light comes from
    /// assert!((x * x + y * y + z * z - 1.0).abs() < 1e-9 && rays.exit[0][0].is_nan());
    /// # Ok::<(), kerrlight_geodesic::Error>(())
    /// ```
    ///
    /// # Errors
    /// As for [`trace`](Self::trace), with [`View::ray`], or if the integrator does not work in Mino time.
    pub fn trace_view(
        self,
        hole: &Kerr,
        view: &View,
        x: &[f64],
        y: &[f64],
        tolerance: f64,
        request: &Request,
    ) -> Result<RayTable, Error> {
        self.trace_job(Job { hole, view, tolerance, request, rule: &[], exit: true }, x, y)
    }

    fn trace_job(self, job: Job<'_>, x: &[f64], y: &[f64]) -> Result<RayTable, Error> {
        let Job { hole, view, request, .. } = job;
        check_columns(x, y)?;
        request.check()?;
        view.check_hole(hole)?;
        let rule = sampling::rule(request);
        let job = Job { rule: &rule, ..job };
        let closed = self.closed_form(job)?;
        let closed = closed.as_ref().and_then(|(tracer, wanted)| {
            tracer.closed_form().map(|observer| (tracer, observer, wanted))
        });
        let pieces = match closed {
            Some((tracer, observer, wanted)) => in_blocks(TOGETHER, x, y, |x, y| {
                elliptic_rays::trace_block(tracer, observer, [x, y], wanted, request)
            }),
            None => in_blocks(BLOCK, x, y, |x, y| self.step_block(job, x, y)),
        };
        let pieces = pieces.into_iter().collect::<Result<Vec<_>, _>>()?;
        Ok(RayTable::joined(pieces, request))
    }

    /// Returns the tracer and the request of rays in closed form, if that is how they are traced.
    fn closed_form(self, job: Job<'_>) -> Result<Option<(BlockTracer, BlockRequest)>, Error> {
        if self != Integrator::Elliptic {
            return Ok(None);
        }
        let tracer = BlockTracer::new(*job.hole, *job.view, self, job.tolerance)?;
        let wanted = elliptic_rays::in_closed_form(job.request);
        Ok(wanted.map(|wanted| (tracer, BlockRequest { exit: job.exit, ..wanted })))
    }

    fn step_block(self, job: Job<'_>, x: &[f64], y: &[f64]) -> Result<RayTable, Error> {
        let Job { hole, view, tolerance, request, rule, exit } = job;
        let at_infinity = match view {
            View::Screen(observer) => [observer.is_at_infinity(); 2],
            View::Camera(_) => [false, true],
        };
        let mut sampler = Sampler::new(request, hole, at_infinity, rule, RayTable::default());
        sampler.exit = exit;
        let points = x.iter().zip(y);
        let Some(method) = self.method() else {
            #[cfg(feature = "affine")]
            {
                let allowed = "an integrator in Mino time, for cameras and directions of escape";
                let observer = view.observer().filter(|_| !exit);
                let observer =
                    observer.ok_or(Error::out_of_range("integrator", f64::NAN, allowed))?;
                for (x, y) in points {
                    interrupt::check();
                    let ray = observer.ray(hole, *x, *y)?;
                    let pair = AffinePair::trace(hole, observer, [*x, *y], tolerance, request)?;
                    sampler.take(&pair, ray.lambda);
                }
            }
            return Ok(sampler.sink);
        };
        let tracer = Tracer::with_method(method, tolerance)?;
        let mut path = Path::new();
        let own = request.quantities();
        let quantities = Quantities { azimuth: own.azimuth || exit, ..own };
        for (x, y) in points {
            interrupt::check();
            let ray = view.ray(hole, *x, *y)?;
            tracer.trace(hole, &ray, quantities, &mut path);
            sampler.take(&MinoPath::seen_by(view, &path, &ray).0.timed(), ray.lambda);
        }
        Ok(sampler.sink)
    }
}
