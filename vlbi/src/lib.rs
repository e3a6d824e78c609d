//! Radio interferometry: visibilities of images, and the files of arrays.
//!
//! Data flow: [`mod@array`] (stations) → [`earth`] (sidereal time, projected baselines) →
//! [`schedule`] (when, and which baselines) → [`observation`] (visibilities with errors) ↔ [`files`]. [`simulate`]
//! fills them from images through an [`operator`], [`noise`] spoils them,
//! [`products`] are what gains leave, [`polarimetry`] is about circular feeds, [`data_terms`] compare them with a model.
//! Units are those of the field: metres, Jy, hours of UTC, wavelengths, degrees where a name says
//! so.

// A library tells its caller, not the terminal.
#![cfg_attr(not(test), warn(clippy::print_stdout, clippy::print_stderr))]

// In the order of the flow of data: a module imports from those above it.
pub mod array;

pub mod earth;

pub mod operator;

pub mod dirty_image;

pub mod observation;

pub mod source;

pub mod gains;

pub mod light_curve;

pub mod products;

pub mod schedule;

pub mod simulate;

pub mod polarimetry;

pub mod data_terms;

pub mod noise;

pub mod files;

#[cfg(test)]
mod conformance;

mod error;

pub use error::Error;

/// Complex number of double precision, as visibilities are kept.
pub type Complex64 = num_complex::Complex<f64>;
