//! Emission around black holes: what a scene holds, how a pixel sums it up, and the files
//! that pictures are kept in.
//!
//! Data flow: [`scene`] → rays ([`kerrlight_geodesic`]) → [`emission`] → [`transport`] →
//! [`render`] → [`image`] → [`interferometry`]. Fits: [`points`] → [`dynamics`] →
//! [`representation`] → [`optimise`] → [`volume`]. SI units enter in [`units`] and
//! [`interferometry`]. Nothing here knows a path or a terminal: codecs work on bytes.

pub mod dynamics;
pub mod emission;
mod error;
pub mod fit;
pub mod frames;
pub mod image;
pub mod interferometry;
mod matrix;
pub mod memory;
pub mod numpy;
pub mod optimise;
pub mod points;
pub mod polarization;
pub mod render;
pub mod representation;
pub mod scene;
mod simd;
pub mod toml_file;
pub mod transport;
pub mod units;
pub mod volume;

pub use error::Error;
