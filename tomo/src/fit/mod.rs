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
mod batch;
mod change_price;
pub mod checkpoint;
mod compiled;
mod curve_term;
mod device;
mod device_observable;
mod device_runner;
mod fall;
mod forward_model;
pub mod geometry;
#[cfg(feature = "wgpu")]
pub mod graphics;
mod images;
pub mod journal;
mod known_field;
pub mod linear;
mod movie_loss;
mod objective;
mod occupancy;
mod pixel_rays;
mod quiescent;
mod regulariser;
pub mod scan;
mod scan_term;
mod selection;
pub mod settings;
pub mod setup;
mod shift;
mod sightlines;
mod state;
mod steps;
mod stokes;
mod terms;
#[cfg(test)]
mod tests;
mod trainer;
mod training;
pub mod verdict;

pub use batch::{Batch, Columns};
pub use change_price::{ChangeBuffers, ChangePrice};
pub use curve_term::{FluxDatum, StokesCurveTerm};
pub use device::{DeviceError, DeviceRunner, Drawn, StepDevice, Stretch, Taken};
pub use device_observable::Compared;
pub use forward_model::{Field, ForwardModel, Motion, Redshift};
pub use objective::{Buffers, Data, Gradients, Loss, Objective, Weighted};
pub use occupancy::{Occupancy, OccupancySettings};
pub use pixel_rays::RingRays;
pub use quiescent::{Quiescent, WithStaticImage};
pub use regulariser::{Regulariser, Shape};
pub use scan_term::{IntensityTerm, Scan, ScanTerm};
pub use selection::Selection;
pub use sightlines::{Region, Sampling, SightlineRequest, Sightlines};
pub use state::{Diverged, Outcome, Progress, State};
pub use steps::Place;
pub use stokes::{Observable, PolarizedView};
pub use terms::{FrameTerm, ImageTerm, LightCurveTerm};
pub use trainer::Trainer;
pub use training::{BatchSize, OccupancyPlan, Training};
