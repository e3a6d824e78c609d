//! Emission around a black hole, recovered from images, visibilities or light curves.
//!
//! Data flow: points are pulled back along the gas ([`kerrlight_render::dynamics`]) → [`representation`] → images or
//! visibilities ([`kerrlight_vlbi`]) → loss → gradient → [`optimise`]; [`fit`] puts them together. Nothing here knows a path
//! or a terminal: codecs work on bytes.

mod error;
pub mod exr_picture;
pub mod fit;
pub mod optimise;
pub mod representation;

pub use error::Error;
