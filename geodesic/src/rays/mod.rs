//! Many rays: what is requested of them, every way to trace them, and the columns that come back.

#[cfg(feature = "affine")]
mod affine_pair;
pub(crate) mod block;
mod blocks;
mod clock;
pub(crate) mod columns;
pub mod derivatives;
mod elliptic_rays;
pub mod footprint;
pub(crate) mod integrator;
mod length;
pub mod node_gradients;
pub mod nodes;
pub(crate) mod path_length;
pub(crate) mod request;
mod sampling;
mod tables;
mod trajectory;
