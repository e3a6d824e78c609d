//! What the crates of kerrlight share and none of them is about: how much [`memory`] may be taken, movies larger than
//! memory ([`frames`]), arrays of NumPy ([`numpy`]), TOML that names lines ([`toml_file`]), elementary functions on
//! SIMD lanes ([`simd`]), Stokes parameters ([`stokes`]) and [`units`].

mod error;
pub mod frames;
pub mod matrix;
pub mod memory;
pub mod numpy;
pub mod simd;
pub mod stokes;
pub mod toml_file;
pub mod units;

pub use error::Error;
