//! A grid of voxels where the axis is known: pixels are linear in its values, so that for data that are convex in the
//! pixels the best field is the minimum of a convex function over a box, and how far one is from it can be told.
//! Amplitudes and closure quantities are not convex: several lit fields are started from (`lit`, `start`), and what
//! comes out is a stationary point without a certificate.
//!
//! `walk` (rays in the grid) → `operator` (sparse matrix over the nodes that count, `active`) → `objective` → `descent` →
//! `certificate`; `problem`, `settings` and `solution` are what goes in and comes out, `solve` and `run` the way between.

mod active;
mod certificate;
mod change;
mod data;
mod descent;
mod early_stopping;
mod error;
mod gaussian;
mod initial_fields;
mod log_normal;
mod objective;
mod operator;
mod problem;
mod profile;
mod quasi_newton;
mod ray_weights;
mod row_storage;
mod rows;
mod run;
mod scaled;
mod settings;
mod solution;
mod solve;
mod start;
#[cfg(test)]
pub(in crate::fit) mod tests;

pub use crate::fit::loss::regulariser::Prior;
pub use certificate::{Certificate, Stationarity};
pub use change::Change;
pub use data::Weighted;
pub use descent::Ending;
pub use early_stopping::StopRule;
pub use error::LinearError;
pub use gaussian::{GaussianField, Matern, Roughness};
pub use log_normal::LogNormalField;
pub use problem::LinearProblem;
pub use profile::Profile;
pub use ray_weights::{Voxels, refined};
pub use settings::{Coarse, LinearSettings};
pub use solution::{Least, LinearProgress, LinearSolution, Watch};
