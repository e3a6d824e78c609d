//! A double as a scalar, whose wider number has twice its digits.

use super::compensated::Double;
use super::scalar::{Elementary, Scalar};

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

impl Elementary for f64 {
    const IS_PLAIN: bool = true;

    type Wide = Double;

    fn widen(self) -> Double {
        Double::from(self)
    }

    fn narrow(wide: Double) -> Self {
        wide.value()
    }

    fn pi() -> Self {
        core::f64::consts::PI
    }

    #[inline(always)]
    fn value(self) -> f64 {
        self
    }

    #[inline(always)]
    fn ln_1p(self) -> Self {
        f64::ln_1p(self)
    }

    #[inline(always)]
    fn ln(self) -> Self {
        f64::ln(self)
    }

    #[inline(always)]
    fn sin_cos(self) -> (Self, Self) {
        f64::sin_cos(self)
    }

    #[inline(always)]
    fn atan2(self, x: Self) -> Self {
        f64::atan2(self, x)
    }
}
