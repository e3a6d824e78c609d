//! Images of emission around black holes.
//!
//! Data flow: [`scene`] → rays ([`kerrlight_geodesic`]) → [`emission`], moved by [`dynamics`] → [`transport`] →
//! [`picture`] → [`image`]. Volumes of emission are in [`volume`]. Nothing here knows a path or a terminal: codecs work on
//! bytes.

pub mod dynamics;
pub mod emission;
mod error;
pub mod image;
pub mod picture;
pub mod points;
pub mod polarization;
pub mod scene;
pub mod transport;
pub mod volume;

pub use error::{Error, Parts};
