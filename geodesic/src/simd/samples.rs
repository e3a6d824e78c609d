//! Samples of whole rays.

use super::column::Column;
use super::lanes::{InstructionSet, dispatch};
use super::motion::Camera;
use super::sample::{Block, Rays, Target};
use super::{BLOCK, ScreenRays, each};
use crate::error::{Error, check};
use crate::screen::observer::Observer;
use crate::spacetime::kerr::Kerr;

/// Samples of many rays in columns, ray after ray.
#[derive(Clone, Debug, Default)]
pub struct Samples {
    per_ray: usize,
    delay: Column,
    radius: Column,
    theta: Column,
    azimuth: Column,
    duration: Column,
    escapes: Column,
    error: Column,
}

/// The samples of one ray.
#[derive(Clone, Copy, Debug)]
pub struct RaySamples<'a> {
    /// Delay in M: t_o − t; lim \[(t_o − t) − r_o − 2 ln r_o\] for an observer at infinity, where the first
    /// sample has −∞ and the last one of a ray that escapes +∞.
    pub delay: &'a [f64],
    /// Boyer–Lindquist radius in M, infinite at infinity.
    pub radius: &'a [f64],
    /// Polar angle, radians.
    pub theta: &'a [f64],
    /// Azimuth in radians, continuous along the ray from the observer's on.
    pub azimuth: &'a [f64],
    /// Mino time of the whole ray, M⁻¹.
    pub mino_total: f64,
    /// True if the ray returns to the observer's radius, be that infinite; else it is captured, and its last sample lies a
    /// relative 1e-8 outside the horizon.
    pub escapes: bool,
    /// An estimate, rarely exceeded, of the largest error of the positions by rounding and
    /// quadrature: relative in the radius, absolute in θ and azimuth, at equal Mino time. It is
    /// about 1e-13 for most rays and grows in inverse proportion to the distance from the
    /// critical curve.
    pub error: f64,
}

impl RaySamples<'_> {
    /// Some of them.
    ///
    /// # Panics
    /// If there are no such samples.
    pub fn part(&self, span: core::ops::Range<usize>) -> Self {
        RaySamples {
            delay: &self.delay[span.clone()],
            radius: &self.radius[span.clone()],
            theta: &self.theta[span.clone()],
            azimuth: &self.azimuth[span],
            ..*self
        }
    }
}

impl Samples {
    /// Samples per ray.
    pub fn per_ray(&self) -> usize {
        self.per_ray
    }

    /// Number of rays.
    pub fn rays(&self) -> usize {
        self.duration.len()
    }

    /// Delays of all samples, ray after ray: sample `j` of ray `k` is number `k · per_ray + j`.
    pub fn delay(&self) -> &[f64] {
        &self.delay
    }

    /// Radii of all samples in M, in the same order.
    pub fn radius(&self) -> &[f64] {
        &self.radius
    }

    /// Polar angles of all samples in radians, in the same order.
    pub fn theta(&self) -> &[f64] {
        &self.theta
    }

    /// Azimuths of all samples in radians, in the same order.
    pub fn azimuth(&self) -> &[f64] {
        &self.azimuth
    }

    /// The samples of ray number `k`.
    ///
    /// # Panics
    /// If there is no such ray.
    pub fn ray(&self, k: usize) -> RaySamples<'_> {
        let span = k * self.per_ray..(k + 1) * self.per_ray;
        RaySamples {
            delay: &self.delay[span.clone()],
            radius: &self.radius[span.clone()],
            theta: &self.theta[span.clone()],
            azimuth: &self.azimuth[span],
            mino_total: self.duration[k],
            escapes: self.escapes[k] > 0.5,
            error: self.error[k],
        }
    }

    /// Samples the rays that arrive at (`alpha[k]`, `beta[k]`) at `per_ray` points equidistant
    /// in Mino time, from the observer to the ray's end, both included. Memory is reused.
    ///
    /// # Errors
    /// If the observer is nearer than 5 M or, at a finite radius, farther than 1e30 M, `per_ray` is below 2 or too large for the memory, the
    /// columns differ in length, or α or β is not in \[−1e12, 1e12\] or belongs to a ray whose
    /// turning point is at or outside the observer (W(1/r_o) below 0.01).
    pub fn trace(
        &mut self,
        hole: &Kerr,
        observer: &Observer,
        alpha: &[f64],
        beta: &[f64],
        per_ray: usize,
    ) -> Result<(), Error> {
        self.trace_at(InstructionSet::best(), hole, observer, alpha, beta, per_ray)
    }

    /// [`trace`](Self::trace) on a given instruction set.
    ///
    /// # Errors
    /// As for [`trace`](Self::trace).
    pub fn trace_at(
        &mut self,
        set: InstructionSet,
        hole: &Kerr,
        observer: &Observer,
        alpha: &[f64],
        beta: &[f64],
        per_ray: usize,
    ) -> Result<(), Error> {
        self.trace_rays(set, ScreenRays::new(hole, observer, alpha, beta)?, per_ray)
    }

    /// [`trace_at`](Self::trace_at) of rays that have been checked.
    pub(crate) fn trace_rays(
        &mut self,
        set: InstructionSet,
        rays: ScreenRays<'_>,
        per_ray: usize,
    ) -> Result<(), Error> {
        check("samples per ray", per_ray as f64, per_ray >= 2, "at least 2")?;
        if let Err(error) = self.resize(rays.alpha.len(), per_ray) {
            *self = Self::default();
            return Err(error);
        }
        self.run(set, rays.camera, rays.alpha, rays.beta);
        if rays.is_at_infinity() {
            self.mark_infinity();
        }
        rays.turn(&mut self.azimuth);
        Ok(())
    }

    /// The samples at infinity itself.
    fn mark_infinity(&mut self) {
        let columns = self.delay.chunks_mut(self.per_ray).zip(self.radius.chunks_mut(self.per_ray));
        for ((delay, radius), escapes) in columns.zip(self.escapes.iter()) {
            if let (Some(delay), Some(radius)) = (delay.first_mut(), radius.first_mut()) {
                (*delay, *radius) = (f64::NEG_INFINITY, f64::INFINITY);
            }
            if let (Some(delay), Some(radius), true) =
                (delay.last_mut(), radius.last_mut(), *escapes > 0.5)
            {
                (*delay, *radius) = (f64::INFINITY, f64::INFINITY);
            }
        }
    }

    fn resize(&mut self, rays: usize, per_ray: usize) -> Result<(), Error> {
        let count = rays.checked_mul(per_ray);
        for column in [&mut self.delay, &mut self.radius, &mut self.theta, &mut self.azimuth] {
            column.resize(count)?;
        }
        for column in [&mut self.duration, &mut self.escapes, &mut self.error] {
            column.resize(Some(rays))?;
        }
        self.per_ray = per_ray;
        Ok(())
    }

    /// Works on blocks of rays.
    fn run(&mut self, set: InstructionSet, camera: Camera, alpha: &[f64], beta: &[f64]) {
        let per_ray = self.per_ray;
        let (long, short) = (BLOCK * per_ray, BLOCK);
        let blocks: Vec<_> = alpha
            .chunks(short)
            .zip(beta.chunks(short))
            .zip(self.delay.chunks_mut(long).zip(self.radius.chunks_mut(long)))
            .zip(self.theta.chunks_mut(long).zip(self.azimuth.chunks_mut(long)))
            .zip(self.duration.chunks_mut(short).zip(self.escapes.chunks_mut(short)))
            .zip(self.error.chunks_mut(short))
            .map(|(((((alpha, beta), (delay, radius)), (theta, azimuth)), ends), error)| {
                let (duration, escapes) = ends;
                let rays = Rays { camera, alpha, beta, per_ray };
                (rays, Target { delay, radius, theta, azimuth, duration, escapes, error })
            })
            .collect();
        let work = |(rays, mut out): (Rays<'_>, Target<'_>)| {
            dispatch(set, Block { rays, out: &mut out });
        };
        each(blocks, work);
    }
}
