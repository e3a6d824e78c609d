//! Rays of a picture, traced on a graphics device.

use super::device::{Adapter, Device};
use super::error::GpuError;
use super::kernel::{Binding, Program, ROW};
use crate::integrate::outcome::{Outcome, Unresolved};
use crate::screen::view::View;
use crate::spacetime::kerr::Kerr;
use crate::wgsl::{
    self, CROSSING_BYTES, END_BYTES, POINT_BYTES, SAMPLE_BYTES, TASK_BYTES, Task, flags,
};

/// Traces rays on a graphics device, in floats: about six digits.
///
/// ```no_run
/// use kerrlight_geodesic::gpu::{self, GpuRays, GpuRequest, GpuTracer};
/// use kerrlight_geodesic::{Inclination, Kerr, Observer, View};
///
/// let tracer = GpuTracer::open(&gpu::adapter(None)?)?;
/// let hole = Kerr::new(0.9)?;
/// let view = View::Screen(Observer::at_infinity(Inclination::from_degrees(60.0)?));
/// let request = GpuRequest { crossings: 1, ..GpuRequest::default() };
/// let mut rays = GpuRays::default();
/// tracer.trace(&hole, &view, (&[-6.0], &[2.0]), &request, &mut rays)?;
/// println!("crosses the equatorial plane at r = {} M", rays.crossings_of(0)[0].radius);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug)]
pub struct GpuTracer {
    device: Device,
    program: Program,
}

/// What is traced of each ray, beside outcome and number of crossings.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct GpuRequest {
    /// How many crossings of the equatorial plane are located.
    pub crossings: usize,
    /// Samples equidistant in Mino time along the whole ray, both ends included but for those at infinity.
    pub samples: usize,
    /// Whether azimuths, delays and directions of escape are computed.
    pub quadratures: bool,
    /// 1/r in M⁻¹ at which rays that escape end: 0 for infinity.
    pub end: f64,
}

/// How a ray ends.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GpuEnd {
    /// Unit vector of the direction in which it escapes, if it does; needs `quadratures`.
    pub exit: [f64; 3],
    /// What becomes of it; unresolved where floats cannot tell.
    pub outcome: Outcome,
    /// What of it cannot be trusted: [`flags`].
    pub flags: u32,
    /// Crossings of the equatorial plane along the whole ray.
    pub crossings: u32,
    /// Mino time of the whole ray, M⁻¹.
    pub mino_time: f64,
    /// Estimated error: relative in radii, radians in azimuths.
    pub error: f64,
    /// λ = L/E, in M.
    pub lambda: f64,
    /// η = Q/E², in M².
    pub eta: f64,
    /// Steps that it took.
    pub steps: u32,
}

impl GpuEnd {
    /// Whether floats vouch for it; if not, trace it again in doubles.
    pub fn is_trusted(&self) -> bool {
        self.flags & !flags::MORE_CROSSINGS == 0
    }
}

/// Where a ray crosses the equatorial plane.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct GpuCrossing {
    /// Boyer–Lindquist radius, in M.
    pub radius: f64,
    /// Azimuth in radians, continuous along the ray; needs `quadratures`.
    pub azimuth: f64,
    /// Mino time since the observer, M⁻¹.
    pub mino_time: f64,
    /// t_o − t in M, its finite part for an observer at infinity; needs `quadratures`.
    pub delay: f64,
    /// d(1/r)/dτ and d cos θ/dτ.
    pub rates: [f64; 2],
}

/// A sample of a ray.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GpuSample {
    /// Boyer–Lindquist radius, in M.
    pub radius: f64,
    /// Polar angle, radians.
    pub theta: f64,
    /// Azimuth in radians, continuous along the ray; needs `quadratures`.
    pub azimuth: f64,
    /// t_o − t in M, its finite part for an observer at infinity; needs `quadratures`.
    pub delay: f64,
}

/// What was found of some rays; memory is reused.
#[derive(Debug, Default)]
pub struct GpuRays {
    ends: Vec<GpuEnd>,
    crossings: Vec<GpuCrossing>,
    per_ray: usize,
    samples: Vec<GpuSample>,
    samples_per_ray: usize,
    points: Vec<u8>,
}

impl GpuRays {
    /// The ends of all rays.
    pub fn ends(&self) -> &[GpuEnd] {
        &self.ends
    }

    /// The located crossings of ray `k`, in their order.
    pub fn crossings_of(&self, k: usize) -> &[GpuCrossing] {
        let count = (self.ends[k].crossings as usize).min(self.per_ray);
        &self.crossings[k * self.per_ray..][..count]
    }

    /// The samples of ray `k`: none if it has no outcome.
    pub fn samples_of(&self, k: usize) -> &[GpuSample] {
        let count = if self.ends[k].outcome.is_unresolved() { 0 } else { self.samples_per_ray };
        &self.samples[k * self.samples_per_ray..][..count]
    }
}

const SHADER_SELF_TEST: &str = include_str!("self_test.wgsl");

impl GpuTracer {
    /// Opens a device and compiles the shaders.
    ///
    /// # Errors
    /// If the device refuses, is too small, or if its driver does not keep sums of two floats as they are.
    pub fn open(adapter: &Adapter) -> Result<Self, GpuError> {
        let device = Device::open(adapter)?;
        test_sums(&device)?;
        let kinds = bindings(&[], &[], [0; 3]);
        let program =
            Program::new(&device, &wgsl::program(), &["kerr_trace", "kerr_sample"], &kinds)?;
        Ok(GpuTracer { device, program })
    }

    /// The name of the device.
    pub fn name(&self) -> &str {
        &self.device.name
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
        request: &GpuRequest,
        rays: &mut GpuRays,
    ) -> Result<(), GpuError> {
        assert_eq!(x.len(), y.len(), "as many y as x");
        rays.ends.clear();
        rays.crossings.clear();
        rays.samples.clear();
        (rays.per_ray, rays.samples_per_ray) = (request.crossings, request.samples);
        let task = Task {
            hole: *hole,
            view: *view,
            rays: 0,
            crossings: request.crossings as u32,
            samples: request.samples as u32,
            row: ROW,
            quadratures: request.quadratures,
            end: request.end,
        };
        let most = self.most_rays(request);
        for (x, y) in x.chunks(most).zip(y.chunks(most)) {
            self.trace_some(Task { rays: x.len() as u32, ..task }, (x, y), rays)?;
        }
        Ok(())
    }

    /// Rays whose results fit the largest buffer.
    fn most_rays(&self, request: &GpuRequest) -> usize {
        let GpuRequest { crossings, samples, .. } = request;
        let widest = (crossings * CROSSING_BYTES).max(samples * SAMPLE_BYTES).max(END_BYTES);
        let rows = u64::from(ROW) * 4096;
        (self.device.largest / widest as u64).clamp(1, rows) as usize
    }

    fn trace_some(
        &self,
        task: Task,
        (x, y): (&[f64], &[f64]),
        rays: &mut GpuRays,
    ) -> Result<(), GpuError> {
        wgsl::point_bytes(x, y, &mut rays.points);
        let uniform = task.bytes();
        let count = x.len();
        let sizes = [
            count * END_BYTES,
            count * task.crossings as usize * CROSSING_BYTES,
            count * task.samples as usize * SAMPLE_BYTES,
        ];
        let bindings = bindings(&uniform, &rays.points, sizes.map(|size| size as u64));
        let entries: &[usize] = if task.samples > 0 { &[0, 1] } else { &[0] };
        let outputs = self.program.run(&self.device, entries, task.rays, &bindings)?;
        let start = task.delay_start();
        let sized = |k: usize| &outputs[k][..sizes[k]];
        rays.ends.extend(sized(0).chunks_exact(END_BYTES).map(end));
        let crossings = sized(1).chunks_exact(CROSSING_BYTES);
        rays.crossings.extend(crossings.map(|bytes| crossing(bytes, start)));
        let samples = sized(2).chunks_exact(SAMPLE_BYTES);
        rays.samples.extend(samples.map(|bytes| sample(bytes, start)));
        Ok(())
    }
}

fn bindings<'a>(uniform: &'a [u8], points: &'a [u8], sizes: [u64; 3]) -> [Binding<'a>; 5] {
    let [ends, crossings, samples] = sizes.map(Binding::Output);
    [Binding::Uniform(uniform), Binding::Input(points), ends, crossings, samples]
}

fn word(bytes: &[u8], at: usize) -> u32 {
    u32::from_le_bytes(core::array::from_fn(|k| bytes[4 * at + k]))
}

fn float(bytes: &[u8], at: usize) -> f64 {
    f64::from(f32::from_bits(word(bytes, at)))
}

fn end(bytes: &[u8]) -> GpuEnd {
    let flagged = word(bytes, 4);
    let outcome = match word(bytes, 3) {
        _ if flagged & flags::NEAR_CRITICAL != 0 => Outcome::Unresolved(Unresolved::PhotonOrbit),
        _ if flagged & flags::OUT_OF_STEPS != 0 => Outcome::Unresolved(Unresolved::StepLimit),
        0 => Outcome::Captured,
        1 => Outcome::Escaped,
        _ => Outcome::Unresolved(Unresolved::StepLimit),
    };
    GpuEnd {
        exit: [0, 1, 2].map(|k| float(bytes, k)),
        outcome,
        flags: flagged,
        crossings: word(bytes, 5),
        mino_time: float(bytes, 6),
        error: float(bytes, 7),
        lambda: float(bytes, 8),
        eta: float(bytes, 9),
        steps: word(bytes, 10),
    }
}

fn crossing(bytes: &[u8], delay_start: f64) -> GpuCrossing {
    GpuCrossing {
        radius: float(bytes, 0),
        azimuth: float(bytes, 1),
        mino_time: float(bytes, 2),
        delay: float(bytes, 3) + delay_start,
        rates: [float(bytes, 4), float(bytes, 5)],
    }
}

fn sample(bytes: &[u8], delay_start: f64) -> GpuSample {
    GpuSample {
        radius: float(bytes, 0),
        theta: float(bytes, 1),
        azimuth: float(bytes, 2),
        delay: float(bytes, 3) + delay_start,
    }
}

/// Sums and products of two floats on the device, against exact ones.
fn test_sums(device: &Device) -> Result<(), GpuError> {
    let source = [wgsl::TWO_FLOATS, SHADER_SELF_TEST].join("\n");
    let pairs: Vec<[f32; 2]> = (1..=256u32).map(|k| pair(k.wrapping_mul(2_654_435_761))).collect();
    let points: Vec<u8> = pairs.iter().flatten().flat_map(|x| x.to_le_bytes()).collect();
    let uniform = [0; POINT_BYTES];
    let bindings = [
        Binding::Uniform(&uniform),
        Binding::Input(&points),
        Binding::Output(16 * pairs.len() as u64),
    ];
    let program = Program::new(device, &source, &["kerr_self_test"], &bindings)?;
    let outputs = program.run(device, &[0], pairs.len() as u32, &bindings)?;
    let exact = pairs.iter().zip(outputs[0].chunks_exact(16)).all(|([a, b], bytes)| {
        let (a, b) = (f64::from(*a), f64::from(*b));
        let [sum, product] = [0, 2].map(|k| float(bytes, k) + float(bytes, k + 1));
        sum == a + b && product == a * b
    });
    if exact { Ok(()) } else { Err(GpuError::Inexact(device.name.clone())) }
}

/// Two floats with all their digits, of magnitudes up to 2⁸ apart.
fn pair(bits: u32) -> [f32; 2] {
    let digits = |x: u32| 1.0 + (x & 0x7f_ffff) as f32 / 8_388_608.0;
    let sign = if bits & 1 == 0 { 1.0 } else { -1.0 };
    [digits(bits), sign * digits(bits.rotate_left(13)) / f32::from(1u16 << (bits >> 29))]
}

const _: () = assert!(TASK_BYTES.is_multiple_of(16));
