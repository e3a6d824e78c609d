//! Numbers of twice the working precision: for the few places where a ray's fate hangs on a
//! difference of nearly equal numbers, and for reference values of everything.
//!
//! Error-free transformations of Dekker (1971) and Knuth (1969); no fused
//! multiply-add is assumed.

use crate::numbers::scalar::{Elementary, Scalar};

/// A number of about 31 decimal digits: an unevaluated sum `hi + lo` with `|lo|` at most half
/// a unit in the last place of `hi`. Magnitudes between 1e-140 and 1e140 keep all digits.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Double {
    /// The nearest double.
    pub hi: f64,
    /// Low part: the rounding error of the high part.
    pub lo: f64,
}

fn two_sum(a: f64, b: f64) -> Double {
    let s = a + b;
    let v = s - a;
    Double { hi: s, lo: (a - (s - v)) + (b - v) }
}

fn quick_two_sum(a: f64, b: f64) -> Double {
    let s = a + b;
    Double { hi: s, lo: b - (s - a) }
}

/// Splits a number into two halves of 26 bits (Veltkamp).
fn split(a: f64) -> (f64, f64) {
    let t = 134_217_729.0 * a;
    let hi = t - (t - a);
    (hi, a - hi)
}

fn two_prod(a: f64, b: f64) -> Double {
    let p = a * b;
    let (a1, a2) = split(a);
    let (b1, b2) = split(b);
    Double { hi: p, lo: ((a1 * b1 - p) + a1 * b2 + a2 * b1) + a2 * b2 }
}

impl From<f64> for Double {
    fn from(x: f64) -> Self {
        Double { hi: x, lo: 0.0 }
    }
}

impl Double {
    /// The exact product of two floats.
    pub fn product(a: f64, b: f64) -> Self {
        two_prod(a, b)
    }

    /// Times a power of two (exact).
    pub fn scale(self, p: f64) -> Self {
        Double { hi: self.hi * p, lo: self.lo * p }
    }
}

impl core::ops::Add for Double {
    type Output = Self;
    fn add(self, o: Self) -> Self {
        let s = two_sum(self.hi, o.hi);
        let t = two_sum(self.lo, o.lo);
        let s = quick_two_sum(s.hi, s.lo + t.hi);
        quick_two_sum(s.hi, s.lo + t.lo)
    }
}

impl core::ops::Neg for Double {
    type Output = Self;
    fn neg(self) -> Self {
        Double { hi: -self.hi, lo: -self.lo }
    }
}

impl core::ops::Sub for Double {
    type Output = Self;
    fn sub(self, o: Self) -> Self {
        self + (-o)
    }
}

impl core::ops::Mul for Double {
    type Output = Self;
    fn mul(self, o: Self) -> Self {
        let p = two_prod(self.hi, o.hi);
        quick_two_sum(p.hi, p.lo + (self.hi * o.lo + self.lo * o.hi))
    }
}

impl core::ops::Div for Double {
    type Output = Self;
    fn div(self, o: Self) -> Self {
        // Two steps of long division, the remainder of each exact to twice the precision.
        let first = self.hi / o.hi;
        if !first.is_finite() || !o.hi.is_finite() {
            return Double::from(first);
        }
        let rest = self - o * Double::from(first);
        let second = rest.hi / o.hi;
        let rest = rest - o * Double::from(second);
        let q = quick_two_sum(first, second);
        q + Double::from(rest.hi / o.hi)
    }
}

impl Scalar for Double {
    fn constant(x: f64) -> Self {
        Double::from(x)
    }

    fn sqrt(self) -> Self {
        if self.hi <= 0.0 {
            return Double::from(self.hi.sqrt());
        }
        let root = Double::from(self.hi.sqrt());
        root + (self - root * root) / root.scale(2.0)
    }
}

/// π/2 to 32 digits.
const HALF_PI: Double = Double { hi: core::f64::consts::FRAC_PI_2, lo: 6.123_233_995_736_766e-17 };

/// Terms of the series below: |x| ≤ π/4 needs 27 powers for 32 digits.
const TERMS: u32 = 14;

impl Double {
    /// π.
    pub const PI: Double = Double { hi: core::f64::consts::PI, lo: 1.224_646_799_147_353_2e-16 };

    /// Sine and cosine of |x| ≤ π/4 and a little by their power series.
    fn small_sin_cos(self) -> (Self, Self) {
        let square = self * self;
        let (mut sin, mut cos) = (Double::from(1.0), Double::from(1.0));
        for k in (1..=TERMS).rev() {
            let n = f64::from(2 * k);
            sin = Double::from(1.0) - square * sin / Double::from(n * (n + 1.0));
            cos = Double::from(1.0) - square * cos / Double::from(n * (n - 1.0));
        }
        (self * sin, cos)
    }

    /// eˣ − 1: by the power series of a part of x, squared again.
    fn exp_m1(self) -> Self {
        let halvings = (self.hi.abs() * 2.0).max(1.0).log2().ceil() as i32;
        let part = self.scale(0.5f64.powi(halvings));
        let mut sum = Double::from(1.0);
        for k in (2..=26).rev() {
            sum = Double::from(1.0) + part * sum / Double::from(f64::from(k));
        }
        let mut e = part * sum;
        for _ in 0..halvings {
            e = e.scale(2.0) + e * e;
        }
        e
    }
}

/// ln(1 + x) of a rounding error x.
fn small_ln_1p(x: Double) -> Double {
    x - (x * x).scale(0.5)
}

impl Elementary for Double {
    const EPSILON: f64 = 1.3e-32;

    type Wide = Double;

    fn widen(self) -> Double {
        self
    }

    fn narrow(wide: Double) -> Self {
        wide
    }

    fn pi() -> Self {
        Self::PI
    }

    fn value(self) -> f64 {
        self.hi
    }

    fn ln_1p(self) -> Self {
        if self.hi.abs() > 0.5 {
            return (self + Double::from(1.0)).ln();
        }
        // Newton from the rounded value: e^{−y}(1 + x) = 1 + δ.
        let y = self.hi.ln_1p();
        let e = Double::from(-y).exp_m1();
        Double::from(y) + small_ln_1p(e + self + e * self)
    }

    fn ln(self) -> Self {
        let y = self.hi.ln();
        if !y.is_finite() {
            return Double::from(y);
        }
        // Of e^y and e^{−y} the one above 1, which keeps its digits.
        let one = Double::from(1.0);
        let e = one + Double::from(y.abs()).exp_m1();
        let ratio = if y > 0.0 { self / e } else { self * e };
        Double::from(y) + small_ln_1p(ratio - one)
    }

    fn sin_cos(self) -> (Self, Self) {
        let quarters = (self.hi / HALF_PI.hi).round();
        let (sin, cos) = (self - HALF_PI * Double::from(quarters)).small_sin_cos();
        match quarters.rem_euclid(4.0) as u8 {
            0 => (sin, cos),
            1 => (cos, -sin),
            2 => (-sin, -cos),
            _ => (-cos, sin),
        }
    }

    fn atan2(self, x: Self) -> Self {
        let angle = self.hi.atan2(x.hi);
        if (self.hi == 0.0 && x.hi == 0.0) || !angle.is_finite() {
            return Double::from(angle);
        }
        // What is left after turning the point back by the rounded angle is tiny.
        let (sin, cos) = Double::from(angle).sin_cos();
        let across = self * cos - x * sin;
        let along = x * cos + self * sin;
        let rest = across / along;
        Double::from(angle) + rest
    }
}

#[cfg(test)]
mod tests {
    use super::{Double, HALF_PI};
    use crate::numbers::scalar::{Elementary, Scalar};

    #[test]
    fn exact_product_and_sum_keep_what_rounding_drops() {
        let e = f64::EPSILON;
        let p = Double::product(1.0 + e, 1.0 - e);
        // (1 + e)(1 − e) − 1 = −e², far below the rounding of the product itself.
        assert_eq!((p - Double::from(1.0)).value(), -e * e);
        let s = Double::from(1e16) + Double::from(1.0) - Double::from(1e16);
        assert_eq!(s.value(), 1.0);
        let q = (Double::from(1.0) + Double::from(e * e)) * Double::from(3.0);
        assert_eq!((q - Double::from(3.0)).value(), 3.0 * e * e);
    }

    /// sin 0.7, cos 0.7, ln 3, ln(1 + 1e-9), atan2(2, −3), √2 and 1/3, to 32 digits (mpmath).
    #[test]
    fn exact_elementary_functions_to_31_digits() {
        let near = |x: Double, hi: f64, lo: f64| {
            let miss = (x - Double { hi, lo }).value();
            assert!(miss.abs() <= 4e-32 * hi.abs(), "{x:?} is off by {miss:e}");
        };
        let of = Double::from;
        let (sin, cos) = of(0.7).sin_cos();
        near(sin, 0.644217687237691, 2.8740567927338755e-18);
        near(cos, 0.7648421872844885, -4.013780434022238e-17);
        near(of(3.0).ln(), 1.0986122886681098, -9.07129723500153e-17);
        near(of(1e-9).ln_1p(), 9.999999995e-10, 7.493897403823754e-26);
        near(of(-0.999).ln_1p(), -6.907755278982136, -2.369515526854508e-16);
        near(of(2.0).atan2(of(-3.0)), 2.5535900500422257, -3.5886651473917e-17);
        near(of(2.0).sqrt(), core::f64::consts::SQRT_2, -9.667293313452913e-17);
        near(of(1.0) / of(3.0), 0.3333333333333333, 1.850371707708594e-17);
        near(of(1e6).ln(), 13.815510557964274, 4.739031053709008e-16);
        let turn = HALF_PI + HALF_PI;
        near(turn, Double::PI.hi, Double::PI.lo);
        for x in [0.1, 1.0, 2.5, 4.0, -3.0] {
            let (s, c) = of(x).sin_cos();
            assert!((s * s + c * c - of(1.0)).value().abs() < 1e-31);
        }
    }
}
