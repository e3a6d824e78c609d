//! Recovery of an emission field from movies and visibilities.
//!
//! [`Sightlines`] (traced once) → [`ForwardModel`] (with the motion, once) → [`Batch`] (pulled back) →
//! representation → pixels → data terms → gradient.
//!
//! [`settings::FitFile`] and [`setup`] make all of these from a fit file; the pieces also stand alone,
//! for data terms, motions or optimisers of your own. Lengths and times are in M, fluxes in Jy.
//!
//! ```
//! use kerrlight_geodesic::{Inclination, Kerr, Observer};
//! use kerrlight_render::dynamics::{AngularVelocity, Axis};
//! use kerrlight_tomo::fit::{
//!     Batch, ForwardModel, Motion, Region, Sampling, SightlineRequest, Sightlines,
//! };
//!
//! let hole = Kerr::new(0.0)?;
//! let observer = Observer::at_infinity(Inclination::from_degrees(0.0)?);
//! // One ray that grazes the region, one that misses it: impact parameters 6 M and 40 M.
//! let request = SightlineRequest {
//!     region: Region { r_min: 5.0, r_max: 10.0, z_width: f64::INFINITY },
//!     sampling: Sampling::Gauss { order: 8, split: 1 },
//!     delay: false,
//!     momentum: false,
//! };
//! let lines = Sightlines::trace(&hole, &observer, &[6.0, 40.0], &[0.0, 0.0], &request)?;
//! assert_eq!((lines.pixels, lines.rays()), (2, 1));
//!
//! // Emission that does not depend on the azimuth looks the same however it turns about the axis.
//! let motion = Motion {
//!     velocity: AngularVelocity::bhnerf(),
//!     reference: 0.0,
//!     injection: None,
//!     times: vec![0.0, 30.0],
//! };
//! let model = ForwardModel::<f64>::new(&lines, &motion, &hole, None)?;
//! let ring = |[x, y, _]: [f64; 3]| (-(x.hypot(y) - 7.0).powi(2)).exp();
//! let movie = model.movie_of(Axis::new([0.0, 0.0, 1.0])?, &ring, &mut Batch::default());
//! let [first, miss, last, _] = movie[..] else { panic!("two frames of two pixels") };
//! assert!(first > 0.0 && miss == 0.0 && (first - last).abs() < 1e-12 * first);
//! # Ok::<(), kerrlight_tomo::Error>(())
//! ```

pub mod band;
mod forward;
pub mod geometry;
#[cfg(feature = "wgpu")]
pub mod graphics;
pub mod journal;
mod learning;
pub mod linear;
mod loss;
mod quiescent;
pub mod scan;
mod seeds;
pub mod settings;
pub mod setup;
#[cfg(test)]
mod tests;
pub mod verdict;

pub use forward::batch::{Batch, Columns};
pub use forward::forward_model::{Field, ForwardModel, Motion, Redshift};
pub use forward::occupancy::{Occupancy, OccupancySettings};
pub use forward::pixel_rays::RingRays;
pub use forward::shift::Circles;
pub use forward::sightlines::{Arrival, Region, Sampling, SightlineRequest, Sightlines, flight};
pub use forward::stokes::{Observable, PolarizedView};
pub use learning::checkpoint;
pub use learning::device::{DeviceError, DeviceRunner, StepDevice, Stretch, Taken};
pub use learning::state::{Diverged, Outcome, Progress, State};
pub use learning::steps::Place;
pub use learning::trainer::Trainer;
pub use learning::training::{BatchSize, COMPARED, Training};
pub use loss::change_price::{ChangeBuffers, ChangePrice};
pub use loss::curve_term::{BackgroundDatum, FluxDatum, StokesCurveTerm};
pub use loss::objective::{Buffers, Data, Drawn, Gradients, Loss, Objective, Weighted};
pub use loss::regulariser::{Regulariser, Shape};
pub use loss::scan_term::{Scan, ScanTerm};
pub use loss::terms::{Compared, FrameTerm, ImageTerm, LightCurveTerm};
pub use quiescent::{Quiescent, WithStaticImage};
pub use seeds::{OF_POSTERIOR, mixed_seed};
