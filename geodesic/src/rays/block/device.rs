//! Devices that trace rays in place of this processor.

use super::device_paths::DevicePaths;
use super::traced::PlaneCrossing;
use crate::error::Error;
use crate::integrate::outcome::Outcome;
use crate::rays::nodes::{Leg, NodeColumns};
use crate::screen::view::View;
use crate::spacetime::kerr::Kerr;
use core::fmt;
use core::ops::Range;

/// A tracer of rays in place of this processor: a graphics device (`gpu::GpuTracer`, feature `wgpu`), or one of your own.
/// [`BlockTracer::with_device`](crate::BlockTracer::with_device) takes it.
pub trait RayDevice: fmt::Debug + Send + Sync {
    /// Returns its name.
    fn name(&self) -> &str;

    /// Traces the rays that arrive at the points (`x[k]`, `y[k]`) of `view`: (α, β) in M of an observer, tangents of angles
    /// from the line of sight of a camera. Rays that it cannot vouch for, points where no photon arrives among them, are
    /// not [trusted](DeviceEnd::is_trusted).
    ///
    /// # Errors
    /// If it fails; [`failure`](Self::failure) then says how.
    fn trace(
        &self,
        hole: &Kerr,
        view: &View,
        points: (&[f64], &[f64]),
        request: &DeviceRequest,
        rays: &mut DeviceRays,
    ) -> Result<(), Error>;

    /// Finds where rays are: those of ray `k` are the nodes `spans[k]`, whose Mino times ascend. They come with Mino times
    /// and steps of Mino time as weights; the device adds the rest, and Σ to the weights.
    ///
    /// # Errors
    /// If it fails; [`failure`](Self::failure) then says how.
    fn place(
        &self,
        hole: &Kerr,
        view: &View,
        points: (&[f64], &[f64]),
        spans: &[Range<usize>],
        nodes: &mut NodeColumns,
    ) -> Result<(), Error>;

    /// Follows rays to the horizon or to infinity and gives `paths`, cleared first, the steps of each. Rays that it cannot
    /// vouch for are [unknown](DevicePaths::push_unknown).
    ///
    /// # Errors
    /// If it fails; [`failure`](Self::failure) then says how.
    fn follow(
        &self,
        hole: &Kerr,
        view: &View,
        points: (&[f64], &[f64]),
        paths: &mut DevicePaths,
    ) -> Result<(), Error>;

    /// Returns the failure, if there was one.
    fn failure(&self) -> Option<String>;
}

/// Quantities that a device traces for each ray, beside outcome and number of crossings.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct DeviceRequest {
    /// Number of crossings of the equatorial plane that are located.
    pub crossings: usize,
    /// Samples equidistant in Mino time along the whole ray, both ends included but for those at infinity.
    pub samples: usize,
    /// True if azimuths, delays and directions of escape are computed.
    pub quadratures: bool,
    /// 1/r in M⁻¹ at which rays that escape end: 0 for infinity.
    pub end: f64,
    /// Radius in M of a sphere: when rays enter and leave it is wanted, and when they turn.
    pub sphere: Option<f64>,
}

/// End of a ray.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DeviceEnd {
    /// Unit vector of the direction in which it escapes, if it does; needs `quadratures`.
    pub exit: [f64; 3],
    /// Outcome; unresolved where the device cannot tell.
    pub outcome: Outcome,
    /// True if the device vouches for it; if not, trace it again in doubles.
    pub is_trusted: bool,
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
    /// Mino times in M⁻¹ at which it enters the sphere and leaves it, or ends; `None` if it does not meet it.
    pub within: Option<[f64; 2]>,
    /// Mino time in M⁻¹ of its turning point, if it turns; with a sphere alone.
    pub turning: Option<f64>,
}

impl DeviceEnd {
    /// Its legs inside the sphere up to the Mino time `until` (M⁻¹), cut at the turning point.
    pub fn legs(&self, until: f64) -> impl Iterator<Item = Leg> {
        let [start, leave] = self.within.unwrap_or([0.0; 2]);
        let falls = self.outcome == Outcome::Captured && leave >= self.mino_time && until >= leave;
        let end = leave.min(until);
        let middle = self.turning.unwrap_or(f64::INFINITY).clamp(start, end.max(start));
        let legs = [[start, middle], [middle, end]].into_iter().filter(|[from, to]| to > from);
        legs.map(move |ends| Leg { ends, falls: falls && ends[1] >= end })
    }
}

/// A sample of a ray.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DeviceSample {
    /// Boyer–Lindquist radius, in M.
    pub radius: f64,
    /// Polar angle, radians.
    pub theta: f64,
    /// Azimuth in radians, continuous along the ray; needs `quadratures`.
    pub azimuth: f64,
    /// t_o − t in M, its finite part for an observer at infinity; needs `quadratures`.
    pub delay: f64,
}

/// Results of a device for some rays; memory is reused.
#[derive(Debug, Default)]
pub struct DeviceRays {
    ends: Vec<DeviceEnd>,
    crossings: Vec<PlaneCrossing>,
    samples: Vec<DeviceSample>,
    per_ray: [usize; 2],
}

impl DeviceRays {
    /// Forgets all rays; what comes is as `request` has it.
    pub fn start(&mut self, request: &DeviceRequest) {
        self.ends.clear();
        self.crossings.clear();
        self.samples.clear();
        self.per_ray = [request.crossings, request.samples];
    }

    /// Takes more rays: their ends, and as many crossings and samples of each as were requested, whatever stands in those
    /// that a ray does not have.
    pub fn extend(
        &mut self,
        ends: impl Iterator<Item = DeviceEnd>,
        crossings: impl Iterator<Item = PlaneCrossing>,
        samples: impl Iterator<Item = DeviceSample>,
    ) {
        self.ends.extend(ends);
        self.crossings.extend(crossings);
        self.samples.extend(samples);
    }

    /// The ends of all rays.
    pub fn ends(&self) -> &[DeviceEnd] {
        &self.ends
    }

    /// The located crossings of ray `k`, in their order.
    ///
    /// # Panics
    /// If there is no such ray.
    pub fn crossings_of(&self, k: usize) -> &[PlaneCrossing] {
        let [each, _] = self.per_ray;
        &self.crossings[k * each..][..(self.ends[k].crossings as usize).min(each)]
    }

    /// The samples of ray `k`: none if it has no outcome.
    ///
    /// # Panics
    /// If there is no such ray.
    pub fn samples_of(&self, k: usize) -> &[DeviceSample] {
        let [_, each] = self.per_ray;
        let count = if self.ends[k].outcome.is_unresolved() { 0 } else { each };
        &self.samples[k * each..][..count]
    }
}
