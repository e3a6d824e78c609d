//! The arithmetic that the equations of motion need, so that one source serves floats of
//! single, double and twice double precision, and dual numbers of them.

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

/// A real number with the elementary functions that positions in Boyer–Lindquist coordinates
/// need: [`f64`], [`Double`](crate::Double) and [`Dual`](crate::Dual) numbers of either.
pub trait Elementary: Scalar + PartialEq + core::fmt::Debug + Send + Sync {
    /// True if it is nothing but a double.
    const IS_PLAIN: bool = false;

    /// The rounding of its arithmetic: the distance from 1 to the next number.
    const EPSILON: f64 = f64::EPSILON;

    /// The same number with twice the digits.
    type Wide: Elementary;

    /// Widens to a number with twice the digits.
    fn widen(self) -> Self::Wide;

    /// The number nearest to a wider one.
    fn narrow(wide: Self::Wide) -> Self;

    /// π.
    fn pi() -> Self;

    /// Its leading part: what decides comparisons.
    fn value(self) -> f64;

    /// ln(1 + x), accurate for small x.
    fn ln_1p(self) -> Self;

    /// The natural logarithm.
    fn ln(self) -> Self;

    /// Sine and cosine.
    fn sin_cos(self) -> (Self, Self);

    /// The angle of the point (`x`, `self`), in \[−π, π\].
    fn atan2(self, x: Self) -> Self;
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
