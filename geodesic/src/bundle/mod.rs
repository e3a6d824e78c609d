//! Many rays of one observer at a finite radius, sampled equidistantly in Mino time, several
//! rays a SIMD register: the fastest way to (t, r, θ, φ) along whole pictures.
//!
//! Nothing is integrated step by step. r(τ) and the direction are elliptic functions of Mino
//! time, and their addition theorems for a fixed step h are rational recurrences with
//! constant coefficients (`radial`, `polar` in the source); azimuth and time are
//! quadratures of smooth functions of them over the same nodes, ten points an interval. The
//! length of a ray and its fate come from one Carlson integral of each end point. The
//! instruction set is chosen at run time (AVX2 with FMA, else one ray at a time; AVX-512 on request).
//!
//! ```
//! use kerrlight_geodesic::bundle::Samples;
//! use kerrlight_geodesic::{Inclination, Kerr, Observer};
//!
//! let hole = Kerr::new(0.94)?;
//! let observer = Observer::at_radius(Inclination::from_degrees(60.0)?, 1000.0)?;
//! let mut samples = Samples::default();
//! samples.trace(&hole, &observer, &[-6.0, 2.0], &[1.0, 0.5], 100)?;
//! let first = samples.ray(0);
//! assert!(first.escapes && (first.radius[99] - 1000.0).abs() < 1e-6);
//! assert!(!samples.ray(1).escapes);
//! # Ok::<(), kerrlight_geodesic::OutOfRange>(())
//! ```

mod dispatch;
mod elliptic;
mod lanes;
mod math;
mod motion;
mod polar;
mod radial;
mod sample;

pub use dispatch::Width;

use crate::error::{OutOfRange, check};
use crate::kerr::Kerr;
use crate::observer::Observer;
use dispatch::dispatch;
use motion::Camera;
use sample::{Block, Rays, Target};

/// Samples of many rays in columns, ray after ray.
#[derive(Clone, Debug, Default)]
pub struct Samples {
    per_ray: usize,
    delay: Vec<f64>,
    radius: Vec<f64>,
    theta: Vec<f64>,
    azimuth: Vec<f64>,
    duration: Vec<f64>,
    escapes: Vec<f64>,
}

/// The samples of one ray.
#[derive(Clone, Copy, Debug)]
pub struct RaySamples<'a> {
    /// t_o − t.
    pub delay: &'a [f64],
    /// Boyer–Lindquist radius.
    pub radius: &'a [f64],
    /// Polar angle.
    pub theta: &'a [f64],
    /// Azimuth, continuous along the ray from the observer's on.
    pub azimuth: &'a [f64],
    /// Mino time of the whole ray.
    pub mino_total: f64,
    /// Whether the ray returns to the observer's radius; else it is captured, and its last
    /// sample lies a relative 1e-8 outside the horizon.
    pub escapes: bool,
}

/// Rays that one task works on: enough for many registers, few enough for the cache.
const BLOCK: usize = 512;

impl Samples {
    /// Samples per ray.
    pub fn per_ray(&self) -> usize {
        self.per_ray
    }

    /// Number of rays.
    pub fn rays(&self) -> usize {
        self.duration.len()
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
        }
    }

    /// Samples the rays that arrive at (`alpha[k]`, `beta[k]`) at `per_ray` points equidistant
    /// in Mino time, from the observer to the ray's end, both included. Memory is reused.
    ///
    /// # Errors
    /// If the observer is nearer than 10 M or at infinity, `per_ray` is below 2, the columns
    /// differ in length, or a ray's √(α² + β²) is above 0.9 of the observer's radius.
    pub fn trace(
        &mut self,
        hole: &Kerr,
        observer: &Observer,
        alpha: &[f64],
        beta: &[f64],
        per_ray: usize,
    ) -> Result<(), OutOfRange> {
        self.trace_at(Width::best(), hole, observer, alpha, beta, per_ray)
    }

    /// [`trace`](Self::trace) with lanes of a given width.
    ///
    /// # Errors
    /// As for [`trace`](Self::trace).
    pub fn trace_at(
        &mut self,
        width: Width,
        hole: &Kerr,
        observer: &Observer,
        alpha: &[f64],
        beta: &[f64],
        per_ray: usize,
    ) -> Result<(), OutOfRange> {
        let w = observer.inverse_radius();
        check(
            "observer radius",
            1.0 / w,
            w > 0.0 && w <= 0.1,
            "a finite radius of at least 10 (M)",
        )?;
        check("samples per ray", per_ray as f64, per_ray >= 2, "at least 2")?;
        let same = alpha.len() == beta.len();
        check("number of beta", beta.len() as f64, same, "as many as of alpha")?;
        for (x, y) in alpha.iter().zip(beta) {
            let ok = (x * x + y * y) * w * w <= 0.81;
            check("alpha", *x, ok, "with beta at most 0.9 of the observer's radius away from 0")?;
        }
        self.resize(alpha.len(), per_ray);
        let camera = Camera::new(hole, observer);
        self.run(width, camera, alpha, beta);
        if observer.inclination().sin() == 0.0 {
            // On the axis the azimuth is that of the direction in which the ray leaves it.
            let cos = observer.inclination().cos();
            let starts = self.azimuth.chunks_mut(per_ray);
            for (ray, (alpha, beta)) in starts.zip(alpha.iter().zip(beta)) {
                ray[0] = alpha.atan2(-beta * cos);
            }
        }
        let origin = observer.azimuth();
        if origin != 0.0 {
            self.azimuth.iter_mut().for_each(|phi| *phi += origin);
        }
        Ok(())
    }

    fn resize(&mut self, rays: usize, per_ray: usize) {
        self.per_ray = per_ray;
        for column in [&mut self.delay, &mut self.radius, &mut self.theta, &mut self.azimuth] {
            column.resize(rays * per_ray, 0.0);
        }
        for column in [&mut self.duration, &mut self.escapes] {
            column.resize(rays, 0.0);
        }
    }

    /// Blocks of rays, each on its own: neither the number of threads nor their order
    /// changes a bit.
    fn run(&mut self, width: Width, camera: Camera, alpha: &[f64], beta: &[f64]) {
        let per_ray = self.per_ray;
        let (long, short) = (BLOCK * per_ray, BLOCK);
        let blocks: Vec<_> = alpha
            .chunks(short)
            .zip(beta.chunks(short))
            .zip(self.delay.chunks_mut(long).zip(self.radius.chunks_mut(long)))
            .zip(self.theta.chunks_mut(long).zip(self.azimuth.chunks_mut(long)))
            .zip(self.duration.chunks_mut(short).zip(self.escapes.chunks_mut(short)))
            .map(|((((alpha, beta), (delay, radius)), (theta, azimuth)), (duration, escapes))| {
                let rays = Rays { camera, alpha, beta, per_ray };
                (rays, Target { delay, radius, theta, azimuth, duration, escapes })
            })
            .collect();
        let work = |(rays, mut out): (Rays<'_>, Target<'_>)| {
            dispatch(width, Block { rays, out: &mut out });
        };
        #[cfg(feature = "rayon")]
        {
            use rayon::prelude::*;
            blocks.into_par_iter().for_each(work);
        }
        #[cfg(not(feature = "rayon"))]
        blocks.into_iter().for_each(work);
    }
}

#[cfg(test)]
mod tests;
