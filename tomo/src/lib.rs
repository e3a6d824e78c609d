//! Emission around black holes: what a scene holds, how a pixel sums it up, and the files
//! that pictures are kept in.
//!
//! Data flow: [`scene`] → rays ([`kerrlight_geodesic`]) → [`emission`] → [`transport`] →
//! [`render`] → [`image`] → [`interferometry`]. SI units enter in [`units`] and [`interferometry`]. Nothing here knows a path or
//! a terminal: codecs work on bytes.

pub mod emission;
pub mod film;
pub mod image;
pub mod interferometry;
pub mod render;
pub mod scene;
pub mod transport;
pub mod units;
