//! Null geodesics of the Kerr spacetime, traced backward from an observer's screen.
//!
//! Units G = c = M = 1; spin a ∈ \[−1, 1\]; Boyer–Lindquist coordinates, in equations that
//! are regular at the poles, for every spin including 0 and ±1, for an observer at
//! infinity and at every inclination.
//!
//! # One ray
//! An [`Observer`] turns a point of the screen into a [`Ray`] (constants of motion), a [`Tracer`]
//! follows it into a [`Path`], which knows the outcome, the events, and the position at any Mino
//! time.
//!
//! ```
//! use kerrlight_geodesic::{Inclination, Kerr, Observer, Outcome, Path, Tracer, Quantities};
//!
//! let hole = Kerr::new(0.9)?;
//! let observer = Observer::at_infinity(Inclination::from_degrees(60.0)?);
//! let tracer = Tracer::new(1e-10)?;
//! let mut path = Path::new();
//! tracer.trace(&hole, &observer.ray(&hole, -6.0, 2.0)?, Quantities::ALL, &mut path);
//!
//! assert_eq!(path.outcome(), Outcome::Escaped);
//! for time in path.equatorial_crossings() {
//!     let hit = path.at(time);
//!     println!("meets the disc at r = {:.6} M, φ = {:.6}", hit.radius(), hit.azimuth);
//! }
//! # Ok::<(), kerrlight_geodesic::Error>(())
//! ```
//!
//! # Many rays
//! An [`Integrator`] traces whole columns of rays, on all cores with the feature `rayon`, and hands
//! back a [`RayTable`]: the same from every integrator. A ray depends on nothing but
//! itself, so the number of threads does not change a bit.
//!
//! ```
//! use kerrlight_geodesic::{Inclination, Integrator, Kerr, Observer, Outcome, Request};
//!
//! let hole = Kerr::new(0.0)?;
//! let observer = Observer::at_infinity(Inclination::from_degrees(30.0)?);
//! let alpha: Vec<f64> = (0..100).map(|k| 0.1 * f64::from(k)).collect();
//! let beta = vec![0.0; alpha.len()];
//! let request = Request::default(); // fates alone
//! let rays = Integrator::TaylorMino.trace(&hole, &observer, &alpha, &beta, 1e-8, &request)?;
//! let shadow = rays.outcome.iter().filter(|o| **o == Outcome::Captured).count();
//! assert_eq!(shadow, 52); // α < √27
//! # Ok::<(), kerrlight_geodesic::Error>(())
//! ```
//!
//! # Requests
//! A [`Request`] says what is wanted of each ray: equatorial crossings, samples at a [`Placement`],
//! azimuth, coordinate time, momentum, path weight, errors. What is not requested is not
//! integrated, and its column is empty.
//!
//! ```
//! use kerrlight_geodesic::{Inclination, Integrator, Kerr, Observer, Placement, Request};
//!
//! let hole = Kerr::new(0.94)?;
//! let observer = Observer::at_radius(Inclination::from_degrees(60.0)?, 1000.0)?;
//! let request = Request {
//!     samples: Placement::GaussLegendre { points: 8, from: 3.0, to: 20.0 },
//!     weight: true,
//!     uncertainty: true,
//!     ..Request::default()
//! };
//! let rays = Integrator::TaylorMino.trace(&hole, &observer, &[-5.0], &[3.0], 1e-12, &request)?;
//! // An emissivity r⁻² along the ray: ∫ j ds with ds = Σ dτ.
//! let points = &rays.samples;
//! let light: f64 = points.of(0).map(|k| points.weight[k] * points.radius[k].powi(-2)).sum();
//! assert!(light > 0.0 && points.azimuth.is_empty());
//! # Ok::<(), kerrlight_geodesic::Error>(())
//! ```
//!
//! # Errors
//! With `uncertainty` each ray carries a bound of the [`Uncertainty`] of its points. Misuse is an
//! [`Error`] that names the field, its value and what is allowed; nothing panics. What becomes
//! of a ray is data: an [`Outcome`], with the reason where it is unresolved.
//!
//! ```
//! # use kerrlight_geodesic::{Inclination, Integrator, Kerr, Observer, Request};
//! let error = Kerr::new(1.5).unwrap_err();
//! assert_eq!(error.to_string(), "spin = 1.5 is not allowed: a number in [-1, 1]");
//! # let hole = Kerr::new(0.5)?;
//! # let observer = Observer::at_infinity(Inclination::from_degrees(60.0)?);
//! let request = Request { uncertainty: true, ..Request::crossings(1) };
//! let rays = Integrator::TaylorMino.trace(&hole, &observer, &[-6.0], &[2.0], 1e-12, &request)?;
//! assert!(rays.uncertainty[0].radius < 1e-11);
//! # Ok::<(), kerrlight_geodesic::Error>(())
//! ```
//!
//! # Derivatives
//! [`derivatives`] has exact slopes of all of it with respect to spin, inclination, α and β.
//!
//! ```
//! use kerrlight_geodesic::{Inclination, Kerr, Observer, Request, derivatives};
//!
//! let hole = Kerr::new(0.9)?;
//! let observer = Observer::at_infinity(Inclination::from_degrees(60.0)?);
//! let request = Request::crossings(1);
//! let rays = derivatives::trace(&hole, &observer, &[-6.0], &[2.0], 1e-12, &request)?;
//! println!("dr/da = {} M", rays.crossings.radius[0].spin);
//! # Ok::<(), kerrlight_geodesic::Error>(())
//! ```
//!
//! # Cameras
//! A [`Camera`] has a place, a [`Motion`] and a lens; its rays are traced like others, in tables by
//! [`Integrator::trace_view`], and [`Camera::blueshift`] is what its motion does to light.
//!
//! ```
//! use kerrlight_geodesic::{Camera, Inclination, Kerr, Motion, Outcome, Path, Tracer, Quantities};
//!
//! let hole = Kerr::new(0.9)?;
//! let camera = Camera::new(&hole, Inclination::from_degrees(85.0)?, 12.0, Motion::FreeFall)?;
//! let mut path = Path::new();
//! Tracer::new(1e-9)?.trace(&hole, &camera.ray(0.0, 0.0)?, Quantities::POLAR, &mut path);
//! assert_eq!(path.outcome(), Outcome::Captured); // straight ahead is the hole
//! # Ok::<(), kerrlight_geodesic::Error>(())
//! ```
//!
//! # Beams
//! [`footprint`] has what a small circle on the screen covers of the sky and of the equatorial
//! plane, for filters and magnifications. (Whole pictures of samples at the highest speed are
//! those of [`simd`].)
//!
//! ```
//! use kerrlight_geodesic::{Camera, Inclination, Kerr, Motion, footprint};
//!
//! let hole = Kerr::new(0.9)?;
//! let camera = Camera::new(&hole, Inclination::from_degrees(85.0)?, 12.0, Motion::Static)?;
//! let beams = footprint::of_camera(&camera, &[1.2], &[0.3], 1e-10, 0)?;
//! if let Some(sky) = beams.sky[0] {
//!     let [x, y, z] = sky.direction;
//!     println!("from ({x:.3}, {y:.3}, {z:.3}), stretched {:.2} times", sky.ellipse().semi_major);
//! }
//! # Ok::<(), kerrlight_geodesic::Error>(())
//! ```
//!
//! # Matter and closed forms
//! [`flow`], [`plunge`] and [`infall`] have the redshift factors of orbiting and falling matter, [`orbits`] the
//! special radii, [`analytic`] the critical curve, lensing bands and crossings in closed form.
//!
//! # Frames and polarisation
//! A [`ZamoFrame`] has the components of momenta and velocities that a local observer measures, and the
//! Walker–Penrose constant of a polarised photon; a [`ScreenPoint`] carries polarisation to the screen.
//!
//! # Features
//! `rayon` (default): all cores. `affine`: an independent tracer in the affine parameter. `capi`:
//! the functions of `include/kerrlight.h` for C. `wgpu`: `gpu`, which runs the shaders of [`wgsl`].

// A library tells its caller, not the terminal.
#![cfg_attr(not(test), warn(clippy::print_stdout, clippy::print_stderr))]

/// The examples of the README compile and run.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
mod readme {}

// In the order of the flow of data: a module imports from those above it.
mod error;
pub mod interrupt;

mod numbers;

mod spacetime;

mod screen;

mod integrate;

pub mod analytic;

pub mod simd;

mod matter;

mod rays;

pub mod wgsl;

#[cfg(feature = "wgpu")]
pub mod gpu;

#[cfg(feature = "capi")]
pub mod capi;

pub use matter::{flow, infall, plunge};
pub use numbers::{legendre, quadrature, vector};
pub use rays::{derivatives, footprint, node_gradients, nodes};
pub use spacetime::orbits;

pub use error::Error;
#[cfg(feature = "affine")]
pub use integrate::affine::{AffinePath, AffineTracer};
pub use integrate::assembly::TaylorStep;
pub use integrate::outcome::{Outcome, Unresolved};
pub use integrate::path::Path;
pub use integrate::trace::{Method, Tracer, trace_series};
pub use integrate::uncertainty::Uncertainty;
pub use numbers::compensated::Double;
pub use numbers::dual::Dual;
pub use numbers::scalar::{Elementary, Scalar};
pub use rays::block::{
    BlockRequest, BlockTracer, DeviceEnd, DevicePaths, DeviceRays, DeviceRequest, DeviceSample,
    PathOfRay, PathUse, PlaneCrossing, RayBlock, RayDevice, RayVisitor, SphereNodes, TracedRay,
    Work,
};
pub use rays::columns::{Points, RayTable};
pub use rays::integrator::Integrator;
pub use rays::path_length::PathLength;
pub use rays::request::{Placement, Request};
pub use screen::camera::{Camera, Motion};
pub use screen::observer::{Inclination, Observer, Ray};
pub use screen::view::View;
pub use spacetime::frame::{ScreenPoint, ZamoFrame};
pub use spacetime::kerr::Kerr;
pub use spacetime::point::PathPoint;
pub use spacetime::quantities::Quantities;
pub use spacetime::radial::{Barrier, RadialPotential};
