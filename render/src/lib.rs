//! Images of emission around black holes.
//!
//! Data flow: [`scene`] → rays ([`kerrlight_geodesic`]) → [`emission`], moved by [`dynamics`] → [`transport`] →
//! [`picture`] → [`image`]. Volumes of emission are in [`volume`]. Nothing here knows a path or a terminal: codecs work on
//! bytes.

// A library tells its caller, not the terminal.
#![cfg_attr(not(test), warn(clippy::print_stdout, clippy::print_stderr))]

// In the order of the flow of data: a module imports from those above it.
pub mod image;

pub mod points;

pub mod polarization;

pub mod dynamics;

pub mod scene;

pub mod volume;

pub mod emission;

pub mod transport;

pub mod picture;

mod error;

pub use error::{Error, Parts};
