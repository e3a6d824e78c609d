//! The arithmetic that the equations of motion need, so that one source serves
//! plain floats today and SIMD lanes or dual numbers beside them.

use core::ops::{Add, Div, Mul, Neg, Sub};

/// A real number, or several of them side by side.
pub trait Scalar:
    Copy
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
    + Neg<Output = Self>
{
    /// The constant `x`.
    fn constant(x: f64) -> Self;
}

impl Scalar for f64 {
    #[inline(always)]
    fn constant(x: f64) -> Self {
        x
    }
}

impl Scalar for f32 {
    #[inline(always)]
    fn constant(x: f64) -> Self {
        x as f32
    }
}
