//! Emission around a black hole, recovered from images, visibilities or light curves.
//!
//! Data flow: points are pulled back along the gas ([`kerrlight_render::dynamics`]) → [`representation`] → images or
//! visibilities ([`kerrlight_vlbi`]) → loss → gradient → [`optimise`]; [`fit`] puts them together. Nothing here knows a path
//! or a terminal: codecs work on bytes.

// In the order of the flow of data: a module imports from those above it.
pub mod exr_picture;

pub mod representation;

pub mod optimise;

pub mod fit;

mod error;

pub use error::Error;
