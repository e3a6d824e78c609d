//! Null geodesics of the Kerr spacetime, traced backward from an observer's screen.
//!
//! Units G = c = M = 1; spin a ∈ \[−1, 1\]; Boyer–Lindquist coordinates, in equations that
//! are regular at the poles, for every spin including 0 and ±1, for an observer at
//! infinity and at every inclination.
//!
//! ```
//! use kerrlight_geodesic::{Inclination, Kerr, Observer, Outcome, Path, Tracer, Want};
//!
//! let hole = Kerr::new(0.9)?;
//! let observer = Observer::at_infinity(Inclination::from_degrees(60.0)?);
//! let tracer = Tracer::new(1e-10)?;
//! let mut path = Path::new();
//! tracer.trace(&hole, &observer.ray(&hole, -6.0, 2.0)?, Want::ALL, &mut path);
//!
//! assert_eq!(path.outcome(), Outcome::Escaped);
//! let hit = path.at(path.equatorial_crossings().next().unwrap());
//! println!("meets the disc at r = {:.6} M, φ = {:.6}", hit.radius(), hit.azimuth);
//! # Ok::<(), kerrlight_geodesic::OutOfRange>(())
//! ```
//!
//! Data flow: [`Observer`] → [`Ray`] (constants of motion) → [`Tracer`] → [`Path`]
//! (outcome, events, position at any Mino time) → [`Flow`](flow) (redshift factors).

#[cfg(feature = "affine")]
mod affine;
/// The examples of the README compile and run.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
mod readme {}

pub mod analytic;
mod blocks;
pub mod bundle;
mod camera;
#[cfg(feature = "capi")]
pub mod capi;
mod columns;
mod compensated;
pub mod derivatives;
mod dual;
mod elliptic_rays;
mod error;
pub mod flow;
pub mod footprint;
mod integrator;
mod kerr;
mod mino;
mod observer;
pub mod orbits;
#[cfg(feature = "rayon")]
mod parallel;
mod path;
pub mod plunge;
mod polynomial;
pub mod quadrature;
mod radial;
mod request;
mod runge_kutta;
mod sampling;
mod scalar;
mod series;
mod stepper;
mod trace;
mod uncertainty;

#[cfg(feature = "affine")]
pub use affine::{AffinePath, AffineTracer};
pub use camera::{Camera, Motion};
pub use columns::{Bundle, Points};
pub use compensated::Double;
pub use dual::Dual;
pub use error::OutOfRange;
pub use integrator::Integrator;
pub use kerr::Kerr;
pub use observer::{Inclination, Observer, Ray};
pub use path::{Outcome, Path, PathPoint, Unresolved};
pub use radial::{Barrier, RadialPotential};
pub use request::{Placement, Request};
pub use scalar::{Elementary, Scalar};
pub use trace::{Method, Tracer, Want, trace_series};
pub use uncertainty::Uncertainty;
