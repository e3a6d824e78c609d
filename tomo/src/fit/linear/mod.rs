//! A grid of voxels where the axis is known: pixels are linear in its values, so that the best field is
//! the minimum of a convex function over a box, and how far one is from it can be told.
//!
//! `walk` (rays in the grid) → `operator` (sparse matrix over the nodes that count) → `objective` →
//! `descent` → `certificate`.

mod certificate;
mod data;
mod descent;
mod nodes;
mod objective;
mod operator;
mod quasi_newton;
mod scaled;
mod solve;
#[cfg(test)]
pub(in crate::fit) mod tests;
mod walk;

pub use certificate::Certificate;
pub use data::Weighted;
pub use descent::{Ending, Method};
pub use objective::Prior;
pub use solve::{Coarse, LinearProblem, LinearProgress, LinearSettings, LinearSolution, Watch};
pub use walk::Voxels;
