//! Foundations that all crates of kerrlight share: limits on [`memory`], movies larger than memory ([`frames`]),
//! arrays of NumPy ([`numpy`]), TOML that names lines ([`toml_file`]), elementary functions on SIMD lanes ([`simd`]),
//! Stokes parameters ([`stokes`]) and [`units`].

// A library tells its caller, not the terminal.
#![cfg_attr(not(test), warn(clippy::print_stdout, clippy::print_stderr))]

// In the order of the flow of data: a module imports from those above it.
pub mod memory;

pub mod simd;

pub mod stokes;

pub mod toml_file;

pub mod units;

pub mod frames;

pub mod matrix;

pub mod numpy;

mod error;

pub use error::Error;
