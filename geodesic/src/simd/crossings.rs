//! Equatorial crossings of many rays.

use super::column::Column;
use super::crossing::{Block, Target, Whole};
use super::lanes::{InstructionSet, dispatch};
use super::motion::Camera;
use super::{BLOCK, ScreenRays, each};
use crate::error::{Error, check};
use crate::screen::observer::Observer;
use crate::spacetime::kerr::Kerr;

/// The first crossings of the equatorial plane of many rays, in columns, ray after ray: crossing
/// `m` (from 0) of ray `k` is number `k · per_ray + m` of each column. Where there is none all
/// columns hold NaN.
///
/// A crossing is where a ray passes from one side to the other outside the horizon, on the way
/// in or out again, short of the observer's radius; the observer's own position is none, and
/// neither is a ray that lies in the plane.
#[derive(Clone, Debug, Default)]
pub struct Crossings {
    per_ray: usize,
    delay: Column,
    radius: Column,
    azimuth: Column,
    mino_time: Column,
    error: Column,
    rays: [Column; 4],
}

/// Properties of a ray as a whole.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RayEnds {
    /// Mino time of the whole ray, M⁻¹.
    pub mino_total: f64,
    /// True if it returns to the observer's radius, be that infinite; else it is captured.
    pub escapes: bool,
    /// Number of crossings of the plane, requested or not.
    pub crossings: u32,
    /// An estimate, rarely exceeded, of the error of its phase by rounding, in radians: in
    /// inverse proportion to its distance from the critical curve. Where that is not small
    /// against the tolerance a ray is better traced by an integrator.
    pub error: f64,
}

/// A crossing of the equatorial plane.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Crossing {
    /// t_o − t, in M; lim \[(t_o − t) − r_o − 2 ln r_o\] for an observer at infinity.
    pub delay: f64,
    /// Boyer–Lindquist radius, in M.
    pub radius: f64,
    /// Azimuth in radians, continuous along the ray from the observer's on.
    pub azimuth: f64,
    /// Mino time since the observer, in 1/M.
    pub mino_time: f64,
    /// An estimate, rarely exceeded, of the error by rounding and quadrature: relative in the
    /// radius, absolute in the azimuth. It grows in inverse proportion to the distance of the
    /// ray from the critical curve.
    pub error: f64,
}

/// Some values of a column; none if they are not all there.
#[inline]
fn part(column: &Column, span: core::ops::Range<usize>) -> core::slice::Iter<'_, f64> {
    column.get(span).unwrap_or_default().iter()
}

impl Crossings {
    /// The most crossings per ray that were requested.
    pub fn per_ray(&self) -> usize {
        self.per_ray
    }

    /// Number of rays.
    pub fn rays(&self) -> usize {
        self.radius.len().checked_div(self.per_ray).unwrap_or(0)
    }

    /// Delay of each crossing in M, as in [`Crossing`].
    pub fn delay(&self) -> &[f64] {
        &self.delay
    }

    /// Radius of each crossing, M.
    pub fn radius(&self) -> &[f64] {
        &self.radius
    }

    /// Azimuth of each crossing, radians.
    pub fn azimuth(&self) -> &[f64] {
        &self.azimuth
    }

    /// Mino time of each crossing, M⁻¹.
    pub fn mino_time(&self) -> &[f64] {
        &self.mino_time
    }

    /// Estimate of the error of each crossing, in the units of [`Crossing`].
    pub fn error(&self) -> &[f64] {
        &self.error
    }

    /// The crossings of ray number `k`, in the order of the backward ray; none if there is no
    /// such ray.
    #[inline]
    pub fn ray(&self, k: usize) -> impl Iterator<Item = Crossing> + Clone + '_ {
        let first = k.saturating_mul(self.per_ray);
        let span = first..first.saturating_add(self.per_ray);
        let of = |column| part(column, span.clone());
        let place = of(&self.delay).zip(of(&self.radius)).zip(of(&self.azimuth));
        let all = place.zip(of(&self.mino_time)).zip(of(&self.error));
        all.map_while(|((((delay, radius), azimuth), mino_time), error)| {
            let (delay, radius, azimuth) = (*delay, *radius, *azimuth);
            let crossing =
                Crossing { delay, radius, azimuth, mino_time: *mino_time, error: *error };
            (!mino_time.is_nan()).then_some(crossing)
        })
    }

    /// All rays as wholes, in order.
    #[inline]
    pub fn all_ends(&self) -> impl Iterator<Item = RayEnds> + '_ {
        let [duration, escapes, count, doubt] = self.rays.each_ref().map(|column| column.iter());
        let all = duration.zip(escapes).zip(count.zip(doubt));
        all.map(|((duration, escapes), (count, doubt))| RayEnds {
            mino_total: *duration,
            escapes: *escapes > 0.5,
            crossings: *count as u32,
            error: *doubt,
        })
    }

    /// Ray number `k` as a whole.
    ///
    /// # Panics
    /// If there is no such ray.
    #[inline]
    pub fn ends(&self, k: usize) -> RayEnds {
        let [duration, escapes, count, doubt] = &self.rays;
        RayEnds {
            mino_total: duration[k],
            escapes: escapes[k] > 0.5,
            crossings: count[k] as u32,
            error: doubt[k],
        }
    }

    /// Finds the first `per_ray` crossings of the rays that arrive at (`alpha[k]`, `beta[k]`).
    /// Memory is reused.
    ///
    /// # Errors
    /// If the observer is nearer than 5 M or, at a finite radius, farther than 1e30 M, `per_ray` is 0 or too large for the memory, the
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
        check("crossings per ray", per_ray as f64, per_ray >= 1, "at least 1")?;
        if let Err(error) = self.resize(rays.alpha.len(), per_ray) {
            *self = Self::default();
            return Err(error);
        }
        // The horizon itself is the end: no sample has to lie short of it.
        self.run(set, Camera { margin: 0.0, ..rays.camera }, rays.alpha, rays.beta);
        rays.turn(&mut self.azimuth);
        Ok(())
    }

    fn resize(&mut self, rays: usize, per_ray: usize) -> Result<(), Error> {
        let count = rays.checked_mul(per_ray);
        self.columns().into_iter().try_for_each(|column| column.resize(count))?;
        self.rays.iter_mut().try_for_each(|column| column.resize(Some(rays)))?;
        self.per_ray = per_ray;
        Ok(())
    }

    fn columns(&mut self) -> [&mut Column; 5] {
        let Self { delay, radius, azimuth, mino_time, error, .. } = self;
        [delay, radius, azimuth, mino_time, error]
    }

    /// Works on blocks of rays.
    fn run(&mut self, set: InstructionSet, camera: Camera, alpha: &[f64], beta: &[f64]) {
        let count = self.per_ray;
        // The columns have that length times the number of rays.
        let long = BLOCK.saturating_mul(count);
        let [duration, escapes, crossings, doubt] = &mut self.rays;
        let rays = duration
            .chunks_mut(BLOCK)
            .zip(escapes.chunks_mut(BLOCK))
            .zip(crossings.chunks_mut(BLOCK).zip(doubt.chunks_mut(BLOCK)))
            .map(|((duration, escapes), (count, doubt))| Whole { duration, escapes, count, doubt });
        let blocks: Vec<_> = alpha
            .chunks(BLOCK)
            .zip(beta.chunks(BLOCK))
            .zip(self.delay.chunks_mut(long).zip(self.radius.chunks_mut(long)))
            .zip(self.azimuth.chunks_mut(long).zip(self.mino_time.chunks_mut(long)))
            .zip(self.error.chunks_mut(long).zip(rays))
            .map(|((((alpha, beta), (delay, radius)), (azimuth, mino_time)), (error, rays))| {
                (alpha, beta, Target { delay, radius, azimuth, mino_time, error, rays })
            })
            .collect();
        let work = |(alpha, beta, mut out): (&[f64], &[f64], Target<'_>)| {
            dispatch(set, Block { camera, alpha, beta, count, out: &mut out });
        };
        each(blocks, work);
    }
}
