//! Lensing in closed form, by elliptic functions and root finding alone: none of it shares an
//! integration with the [`Tracer`](crate::Tracer).
//!
//! - [`CriticalCurve`]: the edge of the shadow, with what half an orbit next to it does.
//! - [`ClosedForm`]: radius at any Mino time, and the n-th equatorial crossing.
//! - [`LensingBand`]: where on the screen how many images of the equatorial plane lie.
//! - [`screen`]: (λ, η) ↔ (α, β).
//!
//! ```
//! use kerrlight_geodesic::analytic::CriticalCurve;
//! use kerrlight_geodesic::{Inclination, Kerr};
//!
//! let curve = CriticalCurve::new(&Kerr::new(0.9)?, Inclination::from_degrees(90.0)?);
//! let flat_side = curve.point(core::f64::consts::PI);
//! assert!((flat_side.alpha + 2.8444214035).abs() < 1e-10);
//! # Ok::<(), kerrlight_geodesic::Error>(())
//! ```

mod bands;
mod closed_form;
mod critical_curve;
mod elliptic;
mod root;
pub mod screen;

pub use bands::LensingBand;
pub use closed_form::{ClosedForm, Crossing};
pub use critical_curve::{CriticalCurve, CriticalPoint, HalfOrbit};
