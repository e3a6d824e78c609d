//! Sums and products with twice the working precision, for the few places where
//! a ray's fate hangs on a difference of nearly equal numbers.
//!
//! Error-free transformations of Dekker (1971) and Knuth (1969); no fused
//! multiply-add is assumed.

/// An unevaluated sum `hi + lo` with `|lo|` at most half a unit in the last place of `hi`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Double {
    pub hi: f64,
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

    /// Rounded to working precision.
    pub fn value(self) -> f64 {
        self.hi + self.lo
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

#[cfg(test)]
mod tests {
    use super::Double;

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
}
