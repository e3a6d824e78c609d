//! Many rays of one observer at once, several rays a SIMD register: the fastest way to
//! (t, r, θ, φ) along whole pictures ([`Samples`]) and to their equatorial crossings
//! ([`Crossings`]).
//!
//! Nothing is integrated step by step. r(τ) and the direction are elliptic functions of Mino
//! time, and their addition theorems for a fixed step h are rational recurrences with
//! constant coefficients (`radial`, `polar` in the source); azimuth and time are
//! quadratures of smooth functions of them over the same nodes, ten points an interval. The
//! length of a ray and its fate come from one Carlson integral of each end point, and so does
//! the time of a crossing. The instruction set is chosen at run time (AVX-512, else AVX2 with
//! FMA, else SSE2; one ray at a time on other architectures). [`lanes`] has what kernels are written
//! in.
//!
//! ```
//! use kerrlight_geodesic::simd::{Crossings, Samples};
//! use kerrlight_geodesic::{Inclination, Kerr, Observer};
//!
//! let hole = Kerr::new(0.94)?;
//! let observer = Observer::at_radius(Inclination::from_degrees(60.0)?, 1000.0)?;
//! let (alpha, beta) = ([-6.0, 2.0], [1.0, 0.5]);
//!
//! let mut samples = Samples::default();
//! samples.trace(&hole, &observer, &alpha, &beta, 100)?;
//! let first = samples.ray(0);
//! assert!(first.escapes && (first.radius[99] - 1000.0).abs() < 1e-6);
//! assert!(!samples.ray(1).escapes);
//!
//! let mut crossings = Crossings::default();
//! crossings.trace(&hole, &observer, &alpha, &beta, 1)?;
//! let disc = crossings.ray(0).next().expect("this ray meets the equatorial plane");
//! assert!(disc.radius > 5.0 && disc.radius < 15.0);
//! # Ok::<(), kerrlight_geodesic::Error>(())
//! ```

mod column;
mod crossing;
mod crossing_polar;
mod crossings;
mod elliptic;
mod error;
pub mod lanes;
mod march;
mod math;
mod motion;
mod nodes;
mod panel;
mod polar;
mod radial;
mod radial_sum;
mod ray_nodes;
mod sample;
mod samples;

pub(crate) use column::span;
pub use crossings::{Crossing, Crossings, RayEnds};
pub(crate) use error::MAX_STEP;
pub use lanes::InstructionSet;
pub(crate) use march::{GROWTH, Key};
pub use nodes::{NodeRequest, Nodes};
pub(crate) use panel::LONGEST_PANEL;
pub use panel::PanelRule;
pub(crate) use radial_sum::LEAST_STEPS;
pub use ray_nodes::RayNodes;
pub use samples::{RaySamples, Samples};

use crate::error::{Error, check};
use crate::interrupt;
use crate::screen::observer::{FARTHEST, Observer};
use crate::spacetime::kerr::Kerr;
use motion::Motion;

/// Rays that one task works on: enough for many registers, few enough for the cache.
const BLOCK: usize = 512;

/// Works on blocks of rays, each on its own: neither the number of threads nor their order changes a
/// bit.
fn each<B: Send>(blocks: Vec<B>, work: impl Fn(B) + Send + Sync) {
    let work = |block| {
        interrupt::check();
        work(block);
    };
    #[cfg(feature = "rayon")]
    {
        use rayon::prelude::*;
        blocks.into_par_iter().for_each(work);
    }
    #[cfg(not(feature = "rayon"))]
    blocks.into_iter().for_each(work);
}

/// The nearest observer, in M: outside every photon orbit, so that rays come from outside the
/// barrier.
pub(crate) const NEAREST: f64 = 5.0;

/// The least W = (dw/dτ)² at the observer: rays that pass it nearly tangentially would lose
/// digits in its root.
const SLOWEST: f64 = 0.01;

/// Points of an observer's screen within the reach of the kernels. They are checked when this is made, so that kernels
/// which trace the same rays need not.
#[derive(Clone, Copy)]
pub(crate) struct ScreenRays<'a> {
    camera: motion::Camera,
    /// The observer's azimuth, in radians.
    azimuth: f64,
    alpha: &'a [f64],
    beta: &'a [f64],
}

impl<'a> ScreenRays<'a> {
    /// The points (`alpha[k]`, `beta[k]`).
    ///
    /// # Errors
    /// As for [`Crossings::trace`].
    pub fn new(
        hole: &Kerr,
        observer: &Observer,
        alpha: &'a [f64],
        beta: &'a [f64],
    ) -> Result<Self, Error> {
        let w = observer.inverse_radius();
        let within = w == 0.0 || (1.0 / FARTHEST..=1.0 / NEAREST).contains(&w);
        check("observer radius", 1.0 / w, within, "infinity, or a number in [5, 1e30] (M)")?;
        let azimuth = observer.azimuth();
        check("observer azimuth", azimuth, azimuth.is_finite(), "a finite angle (radians)")?;
        let same = alpha.len() == beta.len();
        check("number of beta", beta.len() as f64, same, "as many as of alpha")?;
        let camera = motion::Camera::new(hole, observer);
        let mut points = alpha.iter().zip(beta);
        points.try_for_each(|(alpha, beta)| check_point(&camera, *alpha, *beta))?;
        Ok(ScreenRays { camera, azimuth, alpha, beta })
    }

    /// Some of these points, in any order.
    pub fn part<'b>(&self, alpha: &'b [f64], beta: &'b [f64]) -> ScreenRays<'b> {
        ScreenRays { camera: self.camera, azimuth: self.azimuth, alpha, beta }
    }

    /// Returns whether the observer is at infinity.
    pub fn is_at_infinity(&self) -> bool {
        self.camera.w_obs == 0.0
    }

    /// Counts azimuths from the observer's on.
    fn turn(&self, azimuth: &mut [f64]) {
        if self.azimuth != 0.0 {
            azimuth.iter_mut().for_each(|phi| *phi += self.azimuth);
        }
    }
}

fn check_point(camera: &motion::Camera, alpha: f64, beta: f64) -> Result<(), Error> {
    check("alpha", alpha, alpha.abs() <= 1e12, "a number in [-1e12, 1e12] (M)")?;
    check("beta", beta, beta.abs() <= 1e12, "a number in [-1e12, 1e12] (M)")?;
    let radial = Motion::<f64>::new(camera, alpha, beta).radial(camera.w_obs);
    let inwards = "with beta a ray that reaches the observer from well inside \
                   (W(1/r) = (dr/dtau)^2/r^4 at least 0.01)";
    check("alpha", alpha, radial >= SLOWEST, inwards)?;
    Ok(())
}

#[cfg(test)]
mod tests;
