//! Dual numbers: values with exact first derivatives with respect to `D` parameters
//! (forward-mode differentiation).

use crate::numbers::scalar::{Elementary, Scalar};
use core::ops::{Add, Div, Mul, Neg, Sub};

/// A value and its derivatives with respect to `D` parameters.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Dual<T, const D: usize> {
    /// The value.
    pub value: T,
    /// Its derivatives.
    pub slope: [T; D],
}

impl<T: Scalar, const D: usize> Dual<T, D> {
    /// The parameter number `k` at `value`: its own derivative is 1.
    pub fn parameter(value: T, k: usize) -> Self {
        let unit = |i| T::constant(if i == k { 1.0 } else { 0.0 });
        Dual { value, slope: core::array::from_fn(unit) }
    }

    fn chain(self, value: T, derivative: T) -> Self {
        Dual { value, slope: self.slope.map(|s| s * derivative) }
    }
}

impl<T: Scalar, const D: usize> Add for Dual<T, D> {
    type Output = Self;
    fn add(self, o: Self) -> Self {
        let slope = core::array::from_fn(|k| self.slope[k] + o.slope[k]);
        Dual { value: self.value + o.value, slope }
    }
}

impl<T: Scalar, const D: usize> Sub for Dual<T, D> {
    type Output = Self;
    fn sub(self, o: Self) -> Self {
        let slope = core::array::from_fn(|k| self.slope[k] - o.slope[k]);
        Dual { value: self.value - o.value, slope }
    }
}

// The product and quotient rules have sums in them.
#[allow(clippy::suspicious_arithmetic_impl)]
impl<T: Scalar, const D: usize> Mul for Dual<T, D> {
    type Output = Self;
    fn mul(self, o: Self) -> Self {
        let slope = core::array::from_fn(|k| self.slope[k] * o.value + self.value * o.slope[k]);
        Dual { value: self.value * o.value, slope }
    }
}

#[allow(clippy::suspicious_arithmetic_impl)]
impl<T: Scalar, const D: usize> Div for Dual<T, D> {
    type Output = Self;
    fn div(self, o: Self) -> Self {
        let value = self.value / o.value;
        let slope = core::array::from_fn(|k| (self.slope[k] - value * o.slope[k]) / o.value);
        Dual { value, slope }
    }
}

impl<T: Scalar, const D: usize> Neg for Dual<T, D> {
    type Output = Self;
    fn neg(self) -> Self {
        Dual { value: -self.value, slope: self.slope.map(|s| -s) }
    }
}

impl<T: Scalar, const D: usize> Scalar for Dual<T, D> {
    fn constant(x: f64) -> Self {
        Dual { value: T::constant(x), slope: [T::constant(0.0); D] }
    }

    fn sqrt(self) -> Self {
        let root = self.value.sqrt();
        self.chain(root, T::constant(0.5) / root)
    }
}

impl<T: Elementary, const D: usize> Elementary for Dual<T, D> {
    const EPSILON: f64 = T::EPSILON;

    type Wide = Dual<T::Wide, D>;

    fn widen(self) -> Self::Wide {
        Dual { value: self.value.widen(), slope: self.slope.map(T::widen) }
    }

    fn narrow(wide: Self::Wide) -> Self {
        Dual { value: T::narrow(wide.value), slope: wide.slope.map(T::narrow) }
    }

    fn pi() -> Self {
        Dual { value: T::pi(), slope: [T::constant(0.0); D] }
    }

    fn value(self) -> f64 {
        self.value.value()
    }

    fn ln_1p(self) -> Self {
        let one = T::constant(1.0);
        self.chain(self.value.ln_1p(), one / (one + self.value))
    }

    fn ln(self) -> Self {
        self.chain(self.value.ln(), T::constant(1.0) / self.value)
    }

    fn sin_cos(self) -> (Self, Self) {
        let (sin, cos) = self.value.sin_cos();
        (self.chain(sin, cos), self.chain(cos, -sin))
    }

    fn atan2(self, x: Self) -> Self {
        let inv = T::constant(1.0) / (self.value * self.value + x.value * x.value);
        let (by_y, by_x) = (x.value * inv, self.value * inv);
        let slope = core::array::from_fn(|k| self.slope[k] * by_y - x.slope[k] * by_x);
        Dual { value: self.value.atan2(x.value), slope }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exact_derivatives_of_an_expression() {
        fn f<T: Scalar>(x: T, y: T) -> T {
            (x * x + y).sqrt() / (x - T::constant(3.0)) - x * y
        }
        let (x, y) = (1.3, 0.7);
        let d = f(Dual::<f64, 2>::parameter(x, 0), Dual::parameter(y, 1));
        let h = 1e-5;
        let central =
            [(f(x + h, y) - f(x - h, y)) / (2.0 * h), (f(x, y + h) - f(x, y - h)) / (2.0 * h)];
        assert_eq!(d.value, f(x, y));
        for (exact, central) in d.slope.iter().zip(central) {
            assert!((exact - central).abs() < 1e-9);
        }
    }
}
