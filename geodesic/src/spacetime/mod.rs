//! The Kerr spacetime: metric, radial potential, special orbits, points of rays and local frames.

pub(crate) mod frame;
pub(crate) mod kerr;
pub mod orbits;
pub(crate) mod point;
pub(crate) mod quantities;
pub(crate) mod radial;
