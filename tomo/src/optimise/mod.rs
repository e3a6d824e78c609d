//! Steps towards smaller losses.
//!
//! Optimisers. The state of Adam and Muon is plain slices and counters that the caller owns: written out and read
//! back, a run goes on as if it had never stopped, to the last bit.

pub(crate) mod adam;
mod lbfgs;
mod line_search;
mod muon;
mod schedule;

pub use adam::AdamState;
pub use lbfgs::{Lbfgs, Objective};
pub(crate) use lbfgs::{add, difference, dot};
pub use muon::Muon;
pub use schedule::LinearDecay;
