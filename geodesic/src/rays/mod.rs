//! Many rays: what is requested of them, every way to trace them, and the columns that come back.

pub(crate) mod block;
mod blocks;
pub(crate) mod columns;
pub mod derivatives;
mod elliptic_rays;
pub mod footprint;
pub(crate) mod integrator;
mod length;
pub mod nodes;
#[cfg(feature = "rayon")]
mod parallel;
pub(crate) mod request;
mod sampling;
