//! Radiative transfer: from rays and sources to what a pixel sees.
//!
//! [`PreparedScene`] holds what does not depend on the ray. Each source (`sources`) has prepared state
//! and memory of its own and adds its light to an accumulator; `ray` is the only place where they are
//! summed up.

mod central;
mod chord;
mod layers;
mod meter;
mod optics;
mod plan;
mod polarized;
mod prepare;
mod quadrature;
mod ray;
mod result;
mod sources;
mod straight;
#[cfg(test)]
mod tests;
mod tree;

pub(crate) use central::FAR;
pub use kerrlight_geodesic::View;
pub(crate) use layers::{Layers, Mixed, names};
pub use meter::Meter;
pub use plan::{Plan, Step};
pub(crate) use prepare::view;
pub use prepare::{Assets, PreparedScene};
pub(crate) use ray::Block;
pub use ray::Scratch;
pub(crate) use result::Passes;
pub use result::RayResult;
