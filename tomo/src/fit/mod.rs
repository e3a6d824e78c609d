//! Recovery of an emission field from movies and visibilities.
//!
//! [`sightlines`] (traced once) → [`chain`] (with the motion, once) → [`batch`] (pulled back) →
//! representation → pixels → data terms → gradient.

mod batch;
mod chain;
pub mod linear;
mod occupancy;
mod regulariser;
pub mod scan;
mod shift;
mod sightlines;
mod terms;

pub use batch::{Batch, Columns};
pub use chain::{Chain, Field, Motion, Redshift};
pub use occupancy::{Occupancy, OccupancySettings};
pub use regulariser::{Regulariser, Shape};
pub use sightlines::{Region, Sampling, SightlineRequest, Sightlines};
pub use terms::{FrameTerm, ImageTerm, LightCurveTerm, Scan, ScanTerm};
