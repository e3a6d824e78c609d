//! Rays of a picture, traced on a graphics device.

use super::bytes::{float, word};
use super::compute::{Compute, Kernel};
use super::device::{Adapter, Needs};
use super::error::GpuError;
use super::kernel::{self, ROW, whole_rays};
use super::paths::PathKernel;
use super::sums::test_sums;
use crate::error::Error;
use crate::integrate::outcome::{Outcome, Unresolved};
use crate::rays::block::{
    DeviceEnd, DevicePaths, DeviceRays, DeviceRequest, DeviceSample, PlaneCrossing, RayDevice,
};
use crate::rays::nodes::{Node, NodeColumns};
use crate::screen::view::View;
use crate::spacetime::kerr::Kerr;
use crate::wgsl::{
    self, CROSSING_BYTES, END_BYTES, NODE_BYTES, SAMPLE_BYTES, TASK_BYTES, Task, flags,
};
use core::ops::Range;
use std::sync::{Mutex, PoisonError};

/// Traces rays on a graphics device, in floats: about six digits.
///
/// ```no_run
/// use kerrlight_geodesic::gpu::{self, GpuTracer};
/// use kerrlight_geodesic::{DeviceRays, DeviceRequest, Inclination, Kerr, Observer, View};
///
/// let tracer = GpuTracer::open(&gpu::adapter(None)?)?;
/// let hole = Kerr::new(0.9)?;
/// let view = View::Screen(Observer::at_infinity(Inclination::from_degrees(60.0)?));
/// let request = DeviceRequest { crossings: 1, ..DeviceRequest::default() };
/// let mut rays = DeviceRays::default();
/// tracer.trace(&hole, &view, (&[-6.0], &[2.0]), &request, &mut rays)?;
/// println!("crosses the equatorial plane at r = {} M", rays.crossings_of(0)[0].radius);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug)]
pub struct GpuTracer {
    device: Compute,
    /// `kerr_trace` and `kerr_sample`.
    rays: Vec<Kernel>,
    /// `kerr_place`.
    places: Vec<Kernel>,
    paths: PathKernel,
    failure: Mutex<Option<GpuError>>,
}

impl GpuTracer {
    /// Opens a device and compiles the shaders.
    ///
    /// # Errors
    /// If the device refuses, is too small, or if its driver does not keep sums of two floats as they are.
    pub fn open(adapter: &Adapter) -> Result<Self, GpuError> {
        let device = Compute::open(adapter, Needs::default())?;
        test_sums(&device)?;
        let rays = kernel::compiled(&device, &wgsl::program(), &["kerr_trace", "kerr_sample"])?;
        let places = kernel::compiled(&device, &wgsl::places(), &["kerr_place"])?;
        let paths = PathKernel::new(&device)?;
        Ok(GpuTracer { device, rays, places, paths, failure: Mutex::default() })
    }

    /// The name of the device.
    pub fn name(&self) -> &str {
        self.device.name()
    }

    /// Traces the rays that arrive at the points (`x[k]`, `y[k]`) of `view`: (α, β) in M of an observer, tangents of
    /// angles from the line of sight of a camera. Points where no photon arrives are flagged.
    ///
    /// # Errors
    /// If the device fails: [`GpuError`].
    ///
    /// # Panics
    /// If the columns differ in length.
    pub fn trace(
        &self,
        hole: &Kerr,
        view: &View,
        (x, y): (&[f64], &[f64]),
        request: &DeviceRequest,
        rays: &mut DeviceRays,
    ) -> Result<(), GpuError> {
        assert_eq!(x.len(), y.len(), "as many y as x");
        rays.start(request);
        let task = Task {
            crossings: request.crossings as u32,
            samples: request.samples as u32,
            row: ROW,
            quadratures: request.quadratures,
            end: request.end,
            sphere: request.sphere.map_or(0.0, |radius| 1.0 / radius),
            ..Task::new(*hole, *view)
        };
        let most = self.most_rays(request);
        for (x, y) in x.chunks(most).zip(y.chunks(most)) {
            self.trace_some(Task { rays: x.len() as u32, ..task }, (x, y), rays)?;
        }
        Ok(())
    }

    /// Finds where rays are at given Mino times: see [`RayDevice::place`].
    ///
    /// # Errors
    /// If the device fails: [`GpuError`].
    ///
    /// # Panics
    /// If the columns differ in length, or there are not as many spans.
    pub fn place(
        &self,
        hole: &Kerr,
        view: &View,
        (x, y): (&[f64], &[f64]),
        spans: &[Range<usize>],
        nodes: &mut NodeColumns,
    ) -> Result<(), GpuError> {
        assert!(x.len() == y.len() && spans.len() == x.len(), "as many y and spans as x");
        let most = (self.device.largest_buffer() / NODE_BYTES as u64) as usize;
        let pieces: Vec<Piece> = spans.iter().enumerate().flat_map(pieces).collect();
        let mut rest = &pieces[..];
        while let Some((_, Range { start, .. })) = rest.first() {
            let fits = |piece: &&Piece| piece.1.end - start <= most;
            let count = rest.iter().take_while(fits).count().max(1);
            self.place_some((hole, view), (x, y), &rest[..count], nodes)?;
            rest = &rest[count..];
        }
        Ok(())
    }

    /// Follows rays to their ends: see [`RayDevice::follow`].
    ///
    /// # Errors
    /// If the device fails: [`GpuError`].
    ///
    /// # Panics
    /// If the columns differ in length.
    pub fn follow(
        &self,
        hole: &Kerr,
        view: &View,
        points: (&[f64], &[f64]),
        paths: &mut DevicePaths,
    ) -> Result<(), GpuError> {
        let request = DeviceRequest { quadratures: true, ..DeviceRequest::default() };
        let mut rays = DeviceRays::default();
        self.trace(hole, view, points, &request, &mut rays)?;
        self.paths.follow(&self.device, (hole, view), points, rays.ends(), paths)
    }

    fn place_some(
        &self,
        (hole, view): (&Kerr, &View),
        (x, y): (&[f64], &[f64]),
        pieces: &[Piece],
        nodes: &mut NodeColumns,
    ) -> Result<(), GpuError> {
        let all = pieces[0].1.start..pieces[pieces.len() - 1].1.end;
        let task = whole_rays(hole, view, pieces.len());
        let of_pieces =
            |column: &[f64]| -> Vec<f64> { pieces.iter().map(|(ray, _)| column[*ray]).collect() };
        let points = wgsl::point_bytes(&of_pieces(x), &of_pieces(y));
        let words = pieces.iter().flat_map(|(_, span)| [span.start - all.start, span.len()]);
        let spans: Vec<u8> = words.flat_map(|word| (word as u32).to_le_bytes()).collect();
        let times = nodes.mino_times()[all.clone()].iter().map(|time| *time as f32);
        let times: Vec<u8> = times.flat_map(f32::to_le_bytes).collect();
        let (inputs, room) = ([&points[..], &spans, &times], [(all.len() * NODE_BYTES) as u64]);
        let (device, kernels) = (&self.device, &self.places);
        let outputs = kernel::run(device, kernels, task.rays, &task.bytes(), &inputs, &room)?;
        let start = task.delay_start();
        for (k, bytes) in all.zip(outputs[0].chunks_exact(NODE_BYTES)) {
            let step = (nodes.mino_times()[k], nodes.weights()[k]);
            nodes.set(k, node(bytes, hole, step, start).ok_or_else(unfinished)?);
        }
        Ok(())
    }

    /// Keeps a failure, and names it to whoever traces.
    fn note(&self, failure: GpuError) -> Error {
        *self.failure.lock().unwrap_or_else(PoisonError::into_inner) = Some(failure);
        Error::out_of_range("graphics device", f64::NAN, "one that does not fail")
    }

    /// Rays whose results fit the largest buffer.
    fn most_rays(&self, request: &DeviceRequest) -> usize {
        let DeviceRequest { crossings, samples, .. } = request;
        let widest = (crossings * CROSSING_BYTES).max(samples * SAMPLE_BYTES).max(END_BYTES);
        let rows = u64::from(ROW) * 4096;
        (self.device.largest_buffer() / widest as u64).clamp(1, rows) as usize
    }

    fn trace_some(
        &self,
        task: Task,
        (x, y): (&[f64], &[f64]),
        rays: &mut DeviceRays,
    ) -> Result<(), GpuError> {
        let points = wgsl::point_bytes(x, y);
        let count = x.len();
        let sizes = [
            count * END_BYTES,
            count * task.crossings as usize * CROSSING_BYTES,
            count * task.samples as usize * SAMPLE_BYTES,
        ];
        let kernels = &self.rays[..1 + usize::from(task.samples > 0)];
        let (device, room) = (&self.device, sizes.map(|size| size as u64));
        let outputs = kernel::run(device, kernels, task.rays, &task.bytes(), &[&points], &room)?;
        let start = task.delay_start();
        let sized = |k: usize| &outputs[k][..sizes[k]];
        rays.extend(
            sized(0).chunks_exact(END_BYTES).map(end),
            sized(1).chunks_exact(CROSSING_BYTES).map(|bytes| crossing(bytes, start)),
            sized(2).chunks_exact(SAMPLE_BYTES).map(|bytes| sample(bytes, start)),
        );
        let first = rays.ends().len() - count;
        let last = |k: usize| rays.samples_of(k).last().map_or(1.0, |sample| sample.radius);
        if (first..first + count).any(|k| last(k) == 0.0) {
            return Err(unfinished());
        }
        Ok(())
    }
}

impl RayDevice for GpuTracer {
    fn name(&self) -> &str {
        self.name()
    }

    fn trace(
        &self,
        hole: &Kerr,
        view: &View,
        points: (&[f64], &[f64]),
        request: &DeviceRequest,
        rays: &mut DeviceRays,
    ) -> Result<(), Error> {
        GpuTracer::trace(self, hole, view, points, request, rays).map_err(|why| self.note(why))
    }

    fn place(
        &self,
        hole: &Kerr,
        view: &View,
        points: (&[f64], &[f64]),
        spans: &[Range<usize>],
        nodes: &mut NodeColumns,
    ) -> Result<(), Error> {
        GpuTracer::place(self, hole, view, points, spans, nodes).map_err(|why| self.note(why))
    }

    fn follow(
        &self,
        hole: &Kerr,
        view: &View,
        points: (&[f64], &[f64]),
        paths: &mut DevicePaths,
    ) -> Result<(), Error> {
        GpuTracer::follow(self, hole, view, points, paths).map_err(|why| self.note(why))
    }

    fn failure(&self) -> Option<String> {
        let failure = self.failure.lock().unwrap_or_else(PoisonError::into_inner);
        failure.as_ref().map(ToString::to_string)
    }
}

fn end(bytes: &[u8]) -> DeviceEnd {
    let flagged = word(bytes, 4);
    let outcome = match word(bytes, 3) {
        _ if flagged & flags::NEAR_CRITICAL != 0 => Outcome::Unresolved(Unresolved::PhotonOrbit),
        _ if flagged & flags::OUT_OF_STEPS != 0 => Outcome::Unresolved(Unresolved::StepLimit),
        0 => Outcome::Captured,
        1 => Outcome::Escaped,
        _ => Outcome::Unresolved(Unresolved::StepLimit),
    };
    DeviceEnd {
        exit: [0, 1, 2].map(|k| float(bytes, k)),
        outcome,
        is_trusted: flagged & !flags::MORE_CROSSINGS == 0,
        crossings: word(bytes, 5),
        mino_time: float(bytes, 6),
        error: float(bytes, 7),
        lambda: float(bytes, 8),
        eta: float(bytes, 9),
        steps: word(bytes, 10),
        within: (float(bytes, 12) >= 0.0).then(|| [12, 13].map(|at| float(bytes, at))),
        turning: Some(float(bytes, 11)).filter(|time| *time >= 0.0),
    }
}

fn crossing(bytes: &[u8], delay_start: f64) -> PlaneCrossing {
    PlaneCrossing {
        radius: float(bytes, 0),
        azimuth: float(bytes, 1),
        mino_time: float(bytes, 2),
        delay: float(bytes, 3) + delay_start,
        rates: [float(bytes, 4), float(bytes, 5)],
        error: float(bytes, 6),
    }
}

fn sample(bytes: &[u8], delay_start: f64) -> DeviceSample {
    DeviceSample {
        radius: float(bytes, 0),
        theta: float(bytes, 1),
        azimuth: float(bytes, 2),
        delay: float(bytes, 3) + delay_start,
    }
}

/// Some nodes of a ray: its number and theirs.
type Piece = (usize, Range<usize>);

/// Most nodes of an invocation: devices end those that take too long.
const MOST_NODES: usize = 1024;

/// The nodes of a ray in pieces for one invocation each.
fn pieces((ray, span): (usize, &Range<usize>)) -> impl Iterator<Item = Piece> {
    let end = span.end;
    span.clone().step_by(MOST_NODES).map(move |start| (ray, start..(start + MOST_NODES).min(end)))
}

fn unfinished() -> GpuError {
    GpuError::Failed("it did not follow a ray to its end".to_owned())
}

/// `None` if the device did not get there.
fn node(
    bytes: &[u8],
    hole: &Kerr,
    (mino_time, step): (f64, f64),
    delay_start: f64,
) -> Option<Node> {
    let (inverse_radius, cos_theta) = (float(bytes, 0), float(bytes, 1));
    let radius = Some(1.0 / inverse_radius).filter(|_| inverse_radius > 0.0)?;
    Some(Node {
        radius,
        cos_theta,
        weight: hole.sigma(radius, cos_theta) * step,
        mino_time,
        azimuth: float(bytes, 2),
        delay: float(bytes, 3) + delay_start,
        radial_velocity: float(bytes, 4),
        polar_velocity: float(bytes, 5),
    })
}

const _: () = assert!(TASK_BYTES.is_multiple_of(16));
