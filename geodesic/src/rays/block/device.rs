//! Devices that trace rays in place of this processor.

use super::traced::PlaneCrossing;
use crate::error::Error;
use crate::integrate::outcome::Outcome;
use crate::screen::view::View;
use crate::spacetime::kerr::Kerr;
use core::fmt;

/// What traces rays in place of this processor: a graphics device (`gpu::GpuTracer`, feature `wgpu`), or one of your own.
/// [`BlockTracer::with_device`](crate::BlockTracer::with_device) takes it.
pub trait RayDevice: fmt::Debug + Send + Sync {
    /// What it is called.
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

    /// How it failed, if it did.
    fn failure(&self) -> Option<String>;
}

/// What a device traces of each ray, beside outcome and number of crossings.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct DeviceRequest {
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
pub struct DeviceEnd {
    /// Unit vector of the direction in which it escapes, if it does; needs `quadratures`.
    pub exit: [f64; 3],
    /// What becomes of it; unresolved where the device cannot tell.
    pub outcome: Outcome,
    /// Whether the device vouches for it; if not, trace it again in doubles.
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

/// What a device found of some rays; memory is reused.
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
