//! Recovery of an emission field from movies and visibilities.
//!
//! [`sightlines`] (traced once) → [`chain`] (with the motion, once) → [`batch`] (pulled back) →
//! representation → pixels → data terms → gradient.

mod batch;
mod chain;
mod objective;
mod occupancy;
mod shift;
mod sightlines;
mod terms;
#[cfg(test)]
mod tests;

pub use batch::{Batch, Columns};
pub use chain::{Chain, Field, Motion, Redshift};
pub use objective::{Data, Gradients, Loss, Objective, Room, Selection, Weighted, is_turned};
pub use occupancy::{Occupancy, OccupancySettings};
pub use sightlines::{Region, Sampling, SightlineRequest, Sightlines};
pub use terms::{FrameTerm, ImageTerm, LightCurveTerm, Scan, ScanTerm};
