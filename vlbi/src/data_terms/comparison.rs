//! Comparisons of data terms, for callers who compute their χ² on another device.

use crate::products::ClosureKind;
use num_complex::Complex32;

/// Data that a [`DataTerm`](super::DataTerm) compares with the visibilities of a model, in their order and in single
/// precision.
#[derive(Clone, Debug, PartialEq)]
pub enum Comparison {
    /// Complex visibilities (Jy) and 1/σ² of their parts.
    Visibilities(Vec<(Complex32, f32)>),
    /// Amplitudes (Jy) and 1/σ².
    Amplitudes(Vec<(f32, f32)>),
    /// Closure quantities of some scans, among so many visibilities.
    Closures {
        /// Phases or logarithms of amplitudes.
        kind: ClosureKind,
        /// Visibilities of the model.
        visibilities: usize,
        /// The scans.
        scans: Vec<ClosureScan>,
    },
}

/// Closure quantities with a covariance.
#[derive(Clone, Debug, PartialEq)]
pub struct ClosureScan {
    /// Visibilities and signs of each quantity.
    pub legs: Vec<Vec<(usize, f32)>>,
    /// Measured values (rad, or without a unit).
    pub data: Vec<f32>,
    /// The inverse of the covariance, row after row.
    pub precision: Vec<f32>,
}
