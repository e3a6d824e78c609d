//! The numbers that kernels compute with.

use super::math::Coefficients;
use kerrlight_geodesic::simd::lanes::Element;

/// f32 (to run) or f64 (to test).
pub trait Float: Coefficients + Element {}

impl Float for f32 {}

impl Float for f64 {}
