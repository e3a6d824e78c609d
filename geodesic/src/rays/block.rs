//! Blocks of rays of one view, traced once for everything that is to be known about them: in closed
//! form on SIMD lanes where that keeps its digits, else step by step.

use crate::analytic::ClosedForm;
use crate::error::OutOfRange;
use crate::integrate::path::{Outcome, Path, Unresolved};
use crate::integrate::trace::{Method, Tracer};
use crate::rays::integrator::Integrator;
use crate::rays::nodes::{self, NodeColumns};
use crate::screen::observer::{Observer, Ray};
use crate::screen::view::View;
use crate::simd::{Crossing, Crossings, NEAREST, NodeRequest, Nodes, RayEnds, RayNodes, Samples};
use crate::spacetime::kerr::Kerr;
use crate::spacetime::point::PathPoint;
use crate::spacetime::quantities::Quantities;
use core::ops::Range;

/// Traces the rays of one view of a hole. Made once, it serves any number of blocks and threads.
///
/// ```
/// use kerrlight_geodesic::{
///     BlockRequest, BlockTracer, Inclination, Integrator, Kerr, Observer, OutOfRange, PathOfRay,
///     PlaneCrossing, RayBlock, RayVisitor, TracedRay, View,
/// };
///
/// /// The radii at which rays meet an opaque disc.
/// struct Disc(Vec<Option<f64>>);
///
/// impl RayVisitor for Disc {
///     fn is_opaque_at(&self, crossing: &PlaneCrossing) -> bool {
///         (6.0..=20.0).contains(&crossing.radius)
///     }
///
///     fn take(
///         &mut self,
///         _number: usize,
///         ray: &TracedRay,
///         crossings: &[PlaneCrossing],
///         _path: Option<PathOfRay<'_>>,
///     ) -> Result<(), OutOfRange> {
///         let hit = crossings.iter().find(|crossing| Some(crossing.mino_time) == ray.surface);
///         self.0.push(hit.map(|hit| hit.radius));
///         Ok(())
///     }
/// }
///
/// let hole = Kerr::new(0.9)?;
/// let view = View::Screen(Observer::at_infinity(Inclination::from_degrees(60.0)?));
/// let tracer = BlockTracer::new(hole, view, Integrator::Elliptic, 1e-8)?;
/// let request = BlockRequest { crossings: 4, ..BlockRequest::default() };
/// let mut disc = Disc(Vec::new());
/// tracer.trace(&[-9.0, 0.1], &[3.0, 0.1], &request, &mut RayBlock::default(), &mut disc)?;
/// assert!(disc.0[0].is_some());
/// # Ok::<(), OutOfRange>(())
/// ```
#[derive(Debug, Clone)]
pub struct BlockTracer {
    hole: Kerr,
    view: View,
    tracer: Tracer,
    closed_form: bool,
}

/// What is to be found about the rays of a block.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct BlockRequest {
    /// How many crossings of the equatorial plane are located in closed form. A ray with more of
    /// them, none of which is opaque, is traced step by step and has them all. 0: they are counted,
    /// not located.
    pub crossings: usize,
    /// The rates dw/dτ and d cos θ/dτ at crossings, and η.
    pub rates: bool,
    /// The direction in which rays escape.
    pub exit: bool,
    /// The number of half-orbits after which rays are cut off: half-way between crossing number
    /// `half_orbits` (from 0) and the next.
    pub half_orbits: Option<u32>,
    /// Whether [`RayVisitor::needs_path`] decides which rays are traced step by step.
    pub paths: bool,
    /// Coarse nodes by which [`RayVisitor::needs_path_at`] decides it too.
    pub probes: Option<NodeRequest>,
    /// Nodes inside spheres.
    pub nodes: Vec<SphereNodes>,
}

/// Nodes of a quadrature along rays inside a sphere.
#[derive(Debug, Clone, PartialEq)]
pub struct SphereNodes {
    /// The coarsest nodes.
    pub request: NodeRequest,
    /// How many panels a panel of the coarsest nodes is cut into at most.
    pub finest: u32,
}

/// Where a ray crosses the equatorial plane.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PlaneCrossing {
    /// Mino time since the observer, in 1/M.
    pub mino_time: f64,
    /// Boyer–Lindquist radius, in M.
    pub radius: f64,
    /// Azimuth, continuous along the ray from the observer's on.
    pub azimuth: f64,
    /// t_o − t, in M; lim \[(t_o − t) − r_o − 2 ln r_o\] for an observer at infinity.
    pub delay: f64,
    /// d(1/r)/dτ and d cos θ/dτ; 0 unless requested, or for rays traced step by step.
    pub rates: [f64; 2],
}

impl From<&Crossing> for PlaneCrossing {
    fn from(crossing: &Crossing) -> Self {
        let Crossing { radius, azimuth, delay, mino_time, .. } = *crossing;
        PlaneCrossing { mino_time, radius, azimuth, delay, rates: [0.0; 2] }
    }
}

impl From<&PathPoint> for PlaneCrossing {
    fn from(point: &PathPoint) -> Self {
        PlaneCrossing {
            mino_time: point.mino_time,
            radius: point.radius(),
            azimuth: point.azimuth,
            delay: point.delay,
            rates: [point.inverse_radius_rate, point.velocity[2]],
        }
    }
}

/// What is known of a ray as a whole.
#[derive(Debug, Clone, PartialEq)]
pub struct TracedRay {
    /// λ = L/E, in M.
    pub lambda: f64,
    /// η = Q/E², in M²; NaN unless rates are requested or the ray was traced step by step.
    pub eta: f64,
    /// What becomes of it if no surface ends it.
    pub outcome: Outcome,
    /// How many times it crosses the equatorial plane outside the horizon, along its whole length.
    pub crossing_count: u32,
    /// Which of the block's crossings are its own.
    pub crossings: Range<usize>,
    /// Mino time of the whole ray.
    pub mino_total: f64,
    /// Mino time after which no light is taken: see [`BlockRequest::half_orbits`].
    pub until: f64,
    /// Mino time of the first opaque surface, if there is one before `until`.
    pub surface: Option<f64>,
    /// Direction in which it escapes, if it does and that is requested.
    pub exit: Option<[f64; 3]>,
    /// Whether it was traced step by step.
    pub stepped: bool,
}

impl Default for TracedRay {
    /// A ray of which nothing is known.
    fn default() -> Self {
        TracedRay {
            lambda: 0.0,
            eta: 0.0,
            outcome: Outcome::Unresolved(Unresolved::StepLimit),
            crossing_count: 0,
            crossings: 0..0,
            mino_total: 0.0,
            until: 0.0,
            surface: None,
            exit: None,
            stepped: false,
        }
    }
}

impl TracedRay {
    /// Mino time of the last light: of the first opaque surface or of the last half-orbit.
    pub fn last_time(&self) -> f64 {
        self.surface.unwrap_or(f64::INFINITY).min(self.until)
    }
}

/// The path of a ray that was traced step by step.
#[derive(Debug, Clone, Copy)]
pub struct PathOfRay<'a> {
    /// Its constants of motion.
    pub ray: &'a Ray,
    /// Its path, with all quantities.
    pub path: &'a Path,
    /// The tolerance that it was traced with.
    pub tolerance: f64,
}

/// What a block of rays is traced for: it decides where rays end and takes what is found.
pub trait RayVisitor {
    /// Whether a surface in the equatorial plane hides what is behind a crossing.
    fn is_opaque_at(&self, crossing: &PlaneCrossing) -> bool {
        let _ = crossing;
        false
    }

    /// Whether the path of a ray is needed, so that it has to be traced step by step.
    fn needs_path(&self, ray: &Ray) -> bool {
        let _ = ray;
        false
    }

    /// The same, from coarse nodes along the ray: see [`BlockRequest::probes`].
    fn needs_path_at(&self, ray: &TracedRay, nodes: &RayNodes<'_>) -> bool {
        let _ = (ray, nodes);
        false
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

    /// Takes ray `number`: after its nodes, and after the rays before it.
    ///
    /// # Errors
    /// Ends the block.
    fn take(
        &mut self,
        number: usize,
        ray: &TracedRay,
        crossings: &[PlaneCrossing],
        path: Option<PathOfRay<'_>>,
    ) -> Result<(), OutOfRange>;

    /// Told what is worked on from now on.
    fn works_on(&mut self, work: Work) {
        let _ = work;
    }
}

/// What a block is worked on for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Work {
    /// Outcomes, crossings and paths.
    Rays,
    /// Nodes inside a sphere.
    Nodes(usize),
    /// Directions of escape.
    Exits,
}

/// The rays of a block, in memory that is reused from block to block.
#[derive(Debug, Default)]
pub struct RayBlock {
    rays: Vec<TracedRay>,
    plane: Vec<PlaneCrossing>,
    crossings: Crossings,
    nodes: Nodes,
    samples: Samples,
    path: Path,
    columns: NodeColumns,
    intervals: Vec<[f64; 2]>,
}

impl RayBlock {
    /// The rays of the last block.
    pub fn rays(&self) -> &[TracedRay] {
        &self.rays
    }
}

/// Rays whose nodes are in memory at once: few enough for the second-level cache.
const TOGETHER: usize = 128;

/// The finest tolerance against which the closed form's own estimate of its error is held.
const FINEST: f64 = 1e-11;

/// The rays of a block as they arrive, and what is wanted of them.
#[derive(Clone, Copy)]
struct Job<'a> {
    alpha: &'a [f64],
    beta: &'a [f64],
    request: &'a BlockRequest,
}

impl Job<'_> {
    /// Some of the rays.
    fn pick(&self, rays: &[usize]) -> [Vec<f64>; 2] {
        [self.alpha, self.beta].map(|column| rays.iter().map(|k| column[*k]).collect())
    }
}

/// What takes a ray's radial potential to know.
struct Inspected {
    eta: f64,
    until: f64,
    needs_path: bool,
}

impl BlockTracer {
    /// Traces the rays of `view` around `hole`. With [`Integrator::Elliptic`] rays are traced in
    /// closed form where it keeps the digits of `tolerance` and no path is needed, and by Taylor
    /// series elsewhere: for cameras, for observers nearer than 5 M, and next to the critical curve.
    ///
    /// # Errors
    /// If `tolerance` is not in \[1e-14, 1e-2\], or the integrator does not work in Mino time.
    pub fn new(
        hole: Kerr,
        view: View,
        integrator: Integrator,
        tolerance: f64,
    ) -> Result<Self, OutOfRange> {
        let closed_form = integrator == Integrator::Elliptic;
        let method = if closed_form { Some(Method::Taylor) } else { integrator.method() };
        let allowed = "an integrator in Mino time";
        let method = method.ok_or(OutOfRange { field: "integrator", value: f64::NAN, allowed })?;
        Ok(BlockTracer { hole, view, tracer: Tracer::with_method(method, tolerance)?, closed_form })
    }

    /// The hole.
    pub fn hole(&self) -> &Kerr {
        &self.hole
    }

    /// The view.
    pub fn view(&self) -> &View {
        &self.view
    }

    /// The same rays of another view.
    pub fn with_view(self, view: View) -> Self {
        BlockTracer { view, ..self }
    }

    /// The tracer of rays that are traced step by step.
    pub fn tracer(&self) -> &Tracer {
        &self.tracer
    }

    /// The observer, if its rays are traced in closed form.
    pub fn closed_form(&self) -> Option<&Observer> {
        let within = |observer: &&Observer| NEAREST * observer.inverse_radius() <= 1.0;
        self.view.observer().filter(within).filter(|_| self.closed_form)
    }

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
    ) -> Result<(), OutOfRange> {
        let job = Job { alpha, beta, request };
        block.rays.clear();
        block.plane.clear();
        visitor.works_on(Work::Rays);
        match self.closed_form() {
            Some(observer) => self.trace_in_closed_form(observer, job, block, visitor)?,
            None => {
                crate::rays::integrator::check_columns(alpha, beta)?;
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
    ) -> Result<(), OutOfRange> {
        if block.rays[k].stepped {
            return self.finish_stepped(k, job, block, visitor);
        }
        let ray = &block.rays[k];
        visitor.take(k, ray, &block.plane[ray.crossings.clone()], None)
    }

    #[inline(never)]
    fn finish_stepped<V: RayVisitor>(
        &self,
        k: usize,
        job: Job<'_>,
        block: &mut RayBlock,
        visitor: &mut V,
    ) -> Result<(), OutOfRange> {
        visitor.works_on(Work::Rays);
        let ray = self.view.ray(&self.hole, job.alpha[k], job.beta[k])?;
        block.rays[k] = self.step(&ray, job.request, block, visitor);
        for sphere in 0..job.request.nodes.len() {
            visitor.works_on(Work::Nodes(sphere));
            self.refine_on_path((sphere, k), job.request, block, visitor);
        }
        let (RayBlock { rays, plane, path, .. }, tolerance) = (block, self.tracer.tolerance());
        let crossings = &plane[rays[k].crossings.clone()];
        visitor.take(k, &rays[k], crossings, Some(PathOfRay { ray: &ray, path, tolerance }))
    }

    /// Outcomes, crossings, nodes and directions of escape of the rays that the closed form serves.
    fn trace_in_closed_form<V: RayVisitor>(
        &self,
        observer: &Observer,
        job: Job<'_>,
        block: &mut RayBlock,
        visitor: &mut V,
    ) -> Result<(), OutOfRange> {
        let located = job.request.crossings.max(1);
        block.crossings.trace(&self.hole, observer, job.alpha, job.beta, located)?;
        self.classify(observer, job, block, visitor)?;
        if let Some(probes) = &job.request.probes {
            self.probe(observer, probes, job, block, visitor)?;
        }
        if job.request.exit {
            visitor.works_on(Work::Exits);
            self.find_exits(observer, job, block)?;
        }
        for (number, sphere) in job.request.nodes.iter().enumerate() {
            visitor.works_on(Work::Nodes(number));
            self.refine_in_closed_form(observer, (number, sphere), job, block, visitor)?;
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
    ) -> Result<(), OutOfRange> {
        let BlockRequest { crossings, rates, half_orbits, paths, .. } = *job.request;
        let with_ray = rates || paths || half_orbits.is_some();
        let most = half_orbits.map_or(usize::MAX, |n| n as usize + 1);
        let RayBlock { rays, plane, crossings: found, .. } = block;
        rays.reserve(job.alpha.len());
        for (k, (alpha, beta)) in job.alpha.iter().zip(job.beta).enumerate() {
            let (ends, first) = (found.ends(k), plane.len());
            if crossings > 0 {
                plane.extend(found.ray(k).map(|crossing| PlaneCrossing::from(&crossing)));
            }
            let own = &mut plane[first..];
            let Inspected { eta, until, needs_path } = if with_ray {
                // Its radial potential takes as long as all the rest.
                let ray = observer.ray(&self.hole, *alpha, *beta)?;
                self.inspect(&ray, &ends, job.request, own, visitor)
            } else {
                Inspected { eta: f64::NAN, until: f64::INFINITY, needs_path: false }
            };
            let surface = first_opaque(own, until, visitor);
            let all = crossings == 0
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
                stepped: !all || needs_path || self.loses_digits(ends.error),
            });
        }
        Ok(())
    }

    /// What takes a ray's radial potential.
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
        let needs_path = request.paths && visitor.needs_path(ray);
        Inspected { eta: ray.eta, until: self.until(ray, request.half_orbits), needs_path }
    }

    /// Leaves the rays whose path is needed after all to be traced step by step.
    fn probe<V: RayVisitor>(
        &self,
        observer: &Observer,
        probes: &NodeRequest,
        job: Job<'_>,
        RayBlock { rays, nodes, .. }: &mut RayBlock,
        visitor: &V,
    ) -> Result<(), OutOfRange> {
        let open: Vec<usize> = (0..rays.len()).filter(|k| !rays[*k].stepped).collect();
        let [alpha, beta] = job.pick(&open);
        let until: Vec<f64> = open.iter().map(|k| rays[*k].last_time()).collect();
        nodes.trace(&self.hole, observer, &alpha, &beta, Some(&until), probes)?;
        for (number, k) in open.into_iter().enumerate() {
            rays[k].stepped = visitor.needs_path_at(&rays[k], &nodes.ray(number));
        }
        Ok(())
    }

    /// Whether the closed form has an error above the tolerance.
    fn loses_digits(&self, error: f64) -> bool {
        error.is_nan() || error > self.tracer.tolerance().max(FINEST)
    }

    /// The Mino time half-way between the last crossing that counts and the next.
    fn until(&self, ray: &Ray, half_orbits: Option<u32>) -> f64 {
        let Some(n) = half_orbits else { return f64::INFINITY };
        let form = ClosedForm::new(&self.hole, ray);
        let mut times = form.crossings().skip(n as usize).map(|crossing| crossing.mino_time);
        match (times.next(), times.next()) {
            (Some(last), Some(next)) => 0.5 * (last + next),
            _ => f64::INFINITY,
        }
    }

    /// Finds where the rays go that meet no surface and escape.
    fn find_exits(
        &self,
        observer: &Observer,
        job: Job<'_>,
        RayBlock { rays, samples, .. }: &mut RayBlock,
    ) -> Result<(), OutOfRange> {
        let leaves = |ray: &TracedRay| {
            ray.outcome == Outcome::Escaped && ray.surface.is_none() && !ray.stepped
        };
        let outward: Vec<usize> = (0..rays.len()).filter(|k| leaves(&rays[*k])).collect();
        if outward.is_empty() {
            return Ok(());
        }
        let [alpha, beta] = job.pick(&outward);
        samples.trace(&self.hole, observer, &alpha, &beta, 2)?;
        for (j, k) in outward.into_iter().enumerate() {
            let ray = samples.ray(j);
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
        observer: &Observer,
        (number, sphere): (usize, &SphereNodes),
        job: Job<'_>,
        block: &mut RayBlock,
        visitor: &mut V,
    ) -> Result<(), OutOfRange> {
        let RayBlock { rays, plane, nodes, .. } = block;
        let mut pending: Vec<usize> = (0..rays.len()).filter(|k| !rays[*k].stepped).collect();
        let mut request = sphere.request.clone();
        while !pending.is_empty() {
            let mut more = Vec::new();
            for some in pending.chunks(TOGETHER) {
                let [alpha, beta] = job.pick(some);
                let until: Vec<f64> = some.iter().map(|k| rays[*k].last_time()).collect();
                nodes.trace(&self.hole, observer, &alpha, &beta, Some(&until), &request)?;
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

    /// The same for a ray that was traced step by step.
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
        }
    }
}

/// The first crossing that hides the rest, unless that is after Mino time `until`.
#[inline(always)]
fn first_opaque<V: RayVisitor>(plane: &[PlaneCrossing], until: f64, visitor: &V) -> Option<f64> {
    let first = plane.iter().find(|crossing| visitor.is_opaque_at(crossing));
    first.map(|crossing| crossing.mino_time).filter(|time| *time <= until)
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
