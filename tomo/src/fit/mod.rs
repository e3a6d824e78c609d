//! Recovery of an emission field from movies and visibilities.
//!
//! [`Sightlines`] (traced once) → [`ForwardModel`] (with the motion, once) → [`Batch`] (pulled back) →
//! representation → pixels → data terms → gradient.

mod batch;
pub mod checkpoint;
mod forward_model;
pub mod linear;
mod newton;
mod objective;
mod occupancy;
mod penalties;
mod regulariser;
pub mod scan;
pub mod settings;
pub mod setup;
mod shift;
mod sightlines;
mod steps;
mod terms;
#[cfg(test)]
mod tests;
mod train;
pub mod verdict;

pub use batch::{Batch, Columns};
pub use forward_model::{Field, ForwardModel, Motion, Redshift};
pub use objective::{Buffers, Data, Gradients, Loss, Objective, Selection, Weighted, is_turned};
pub use occupancy::{Occupancy, OccupancySettings};
pub use penalties::{Draw, Penalties, Probe, ProbeBuffers};
pub use regulariser::{Regulariser, Shape};
pub use sightlines::{Region, Sampling, SightlineRequest, Sightlines};
pub use steps::Place;
pub use terms::{FrameTerm, ImageTerm, LightCurveTerm, Scan, ScanTerm};
pub use train::{BatchSize, Diverged, OccupancyPlan, Outcome, Progress, State, Trainer, Training};
