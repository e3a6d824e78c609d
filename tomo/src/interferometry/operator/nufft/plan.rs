//! Plans of fast Fourier transforms.

use rustfft::{Fft, FftNum, FftPlanner};
use std::sync::Arc;

/// A number whose fast transforms this crate plans.
///
/// A planner compiles every algorithm that it may choose, wherever it is instantiated. The planners of both numbers
/// are therefore here, and generic code asks its number for a plan.
pub trait FourierNumber: FftNum {
    /// The transforms of `n` numbers: forward and inverse, neither normalised.
    fn plans(n: usize) -> [Arc<dyn Fft<Self>>; 2];
}

impl FourierNumber for f32 {
    fn plans(n: usize) -> [Arc<dyn Fft<f32>>; 2] {
        let mut planner = FftPlanner::new();
        [planner.plan_fft_forward(n), planner.plan_fft_inverse(n)]
    }
}

impl FourierNumber for f64 {
    fn plans(n: usize) -> [Arc<dyn Fft<f64>>; 2] {
        let mut planner = FftPlanner::new();
        [planner.plan_fft_forward(n), planner.plan_fft_inverse(n)]
    }
}
