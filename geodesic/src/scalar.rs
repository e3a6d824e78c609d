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

    /// The square root.
    fn sqrt(self) -> Self;
}

impl Scalar for f64 {
    #[inline(always)]
    fn constant(x: f64) -> Self {
        x
    }

    #[inline(always)]
    fn sqrt(self) -> Self {
        f64::sqrt(self)
    }
}

impl Scalar for f32 {
    #[inline(always)]
    fn constant(x: f64) -> Self {
        x as f32
    }

    #[inline(always)]
    fn sqrt(self) -> Self {
        f32::sqrt(self)
    }
}
