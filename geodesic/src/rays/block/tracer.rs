//! The tracer of a view, and the memory of its blocks.

use super::device::{DeviceRays, RayDevice};
use super::device_paths::DevicePaths;
use super::request::BlockRequest;
use super::traced::{PlaneCrossing, SampleColumns, TracedRay};
use crate::analytic::ClosedForm;
use crate::error::Error;
use crate::integrate::path::Path;
use crate::integrate::trace::Tracer;
use crate::rays::footprint;
use crate::rays::integrator::Integrator;
use crate::rays::nodes::NodeColumns;
use crate::screen::observer::{Observer, Ray};
use crate::screen::view::View;
use crate::simd::{Crossings, NEAREST, Nodes, Samples};
use crate::spacetime::kerr::Kerr;
use std::sync::Arc;

/// Traces the rays of one view of a hole. Made once, it serves any number of blocks and threads.
///
/// ```
/// use kerrlight_geodesic::{
///     BlockRequest, BlockTracer, Inclination, Integrator, Kerr, Observer, Error, PathOfRay,
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
///     ) -> Result<(), Error> {
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
/// # Ok::<(), Error>(())
/// ```
#[derive(Debug, Clone)]
pub struct BlockTracer {
    pub(super) hole: Kerr,
    pub(super) view: View,
    pub(super) tracer: Tracer,
    pub(super) device: Option<Arc<dyn RayDevice>>,
    closed_form: bool,
}

/// The rays of a block, in memory that is reused from block to block.
#[derive(Debug, Default)]
pub struct RayBlock {
    pub(super) rays: Vec<TracedRay>,
    pub(super) plane: Vec<PlaneCrossing>,
    pub(super) crossings: Crossings,
    pub(super) nodes: Nodes,
    pub(super) device: DeviceRays,
    /// Paths from a device, and the numbers of their rays, which ascend.
    pub(super) paths: DevicePaths,
    pub(super) followed: Vec<usize>,
    /// Ends of rays that escape.
    pub(super) exits: Samples,
    /// Samples of whole rays: of those that fall, or of all from a finite radius, and of the others.
    pub(super) falling: Samples,
    pub(super) rising: Samples,
    /// Place of each ray among them.
    pub(super) places: Vec<usize>,
    pub(super) path: Path,
    pub(super) beam: Path<footprint::Number>,
    pub(super) columns: NodeColumns,
    pub(super) sampled: SampleColumns,
    pub(super) intervals: Vec<[f64; 2]>,
}

impl RayBlock {
    /// The rays of the last block.
    pub fn rays(&self) -> &[TracedRay] {
        &self.rays
    }
}

/// The rays of a block as they arrive, and what is wanted of them.
#[derive(Clone, Copy)]
pub(super) struct Job<'a> {
    pub alpha: &'a [f64],
    pub beta: &'a [f64],
    pub request: &'a BlockRequest,
}

impl Job<'_> {
    /// Some of the rays.
    pub fn pick(&self, rays: &[usize]) -> [Vec<f64>; 2] {
        [self.alpha, self.beta].map(|column| rays.iter().map(|k| column[*k]).collect())
    }
}

impl BlockTracer {
    /// Traces the rays of `view` around `hole`. With [`Integrator::Elliptic`] rays are traced in
    /// closed form where it keeps the digits of `tolerance` and no path is needed, and by Taylor
    /// series elsewhere: for cameras, for observers nearer than 5 M, and next to the critical curve.
    ///
    /// # Errors
    /// If `tolerance` is not in \[1e-14, 1e-2\], the integrator does not work in Mino time, or a camera was made for another
    /// hole.
    pub fn new(
        hole: Kerr,
        view: View,
        integrator: Integrator,
        tolerance: f64,
    ) -> Result<Self, Error> {
        view.check_hole(&hole)?;
        let closed_form = integrator == Integrator::Elliptic;
        let allowed = "an integrator in Mino time";
        let method =
            integrator.method().ok_or(Error::out_of_range("integrator", f64::NAN, allowed))?;
        let tracer = Tracer::with_method(method, tolerance)?;
        Ok(BlockTracer { hole, view, tracer, device: None, closed_form })
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

    /// The same rays, traced on a device: their outcomes, crossings, directions of escape, nodes inside spheres and paths
    /// have its digits. Rays that it does not vouch for are traced step by step on this processor, and so are samples.
    pub fn with_device(self, device: Arc<dyn RayDevice>) -> Self {
        BlockTracer { device: Some(device), ..self }
    }

    /// The device on which rays are traced, if it is not this processor.
    pub fn device(&self) -> Option<&dyn RayDevice> {
        self.device.as_deref()
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

    /// The Mino time half-way between the last crossing that counts and the next, of a ray with so many `crossings`.
    pub(super) fn until(&self, ray: &Ray, half_orbits: Option<u32>, crossings: usize) -> f64 {
        let Some(n) = half_orbits else { return f64::INFINITY };
        let form = ClosedForm::new(&self.hole, ray);
        if self.view.observer().is_none() {
            // A camera's ray may start outwards, where the closed form ends at another radius: times of crossings hold anyway.
            let has_next = crossings > n as usize + 1;
            let middle = 0.5 * (form.crossing_time(n + 1) + form.crossing_time(n + 2));
            return if has_next { middle } else { f64::INFINITY };
        }
        let mut times = form.crossings().skip(n as usize).map(|crossing| crossing.mino_time);
        match (times.next(), times.next()) {
            (Some(last), Some(next)) => 0.5 * (last + next),
            _ => f64::INFINITY,
        }
    }
}
