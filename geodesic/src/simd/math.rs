//! Elementary functions on lanes, accurate to about 1e-14.

#![allow(clippy::excessive_precision, reason = "coefficients as the fit printed them")]

use super::lanes::Lanes;
use core::f64::consts::{FRAC_PI_2, LN_2, PI};

/// `Σ cᵢ xⁱ` as two interleaved Horner chains in x².
#[inline(always)]
pub fn poly<V: Lanes<f64>, const N: usize>(c: &[f64; N], x: V) -> V {
    let x2 = x * x;
    let mut a = V::splat(c[N - 1]);
    let mut b = V::splat(c[N - 2]);
    let mut i = N - 2;
    while i >= 2 {
        i -= 2;
        a = a.mul_add(x2, V::splat(c[i + 1]));
        b = b.mul_add(x2, V::splat(c[i]));
    }
    if i == 1 {
        // N odd: the even powers are those of a.
        b.mul_add(x, a.mul_add(x2, V::splat(c[0])))
    } else {
        a.mul_add(x, b)
    }
}

/// atan(√s)/√s on 0 ≤ s ≤ 1, error 7.5e-15.
const ATAN: [f64; 17] = [
    0.9999999999999924109,
    -0.333333333328939797,
    0.1999999995748182498,
    -0.1428571264605040049,
    0.1111107758497177199,
    -0.09090489647799032273,
    0.07688811662401293987,
    -0.0664614579022125362,
    0.05794192316881845096,
    -0.04977996675955047365,
    0.04051778977125066108,
    -0.02958901219434437146,
    0.01819857048539578552,
    -0.008792435542217635545,
    0.003065995702810800817,
    -0.0006774105399645076441,
    0.00007063142635888045644,
];

/// atan(√s)/√s on 0 ≤ s ≤ 0.04, error 1.2e-15.
const SMALL_ATAN: [f64; 7] = [
    0.9999999999999988196,
    -0.3333333333304402343,
    0.1999999988406279147,
    -0.1428569683123289713,
    0.1110985628116949448,
    -0.09044356940165544613,
    0.0682498572049819599,
];

/// asin(√s)/√s on 0 ≤ s ≤ 0.04, error 3e-16.
const SMALL_ASIN: [f64; 7] = [
    1.000000000000000314,
    0.1666666666658973669,
    0.07500000030718613213,
    0.0446428112239793585,
    0.03038520448378739153,
    0.02225393108112551172,
    0.01945350827866383194,
];

/// 2 atanh(√s)/√s on 0 ≤ s ≤ ((√2 − 1)/(√2 + 1))², error 4e-16.
const ATANH2: [f64; 7] = [
    2.000000000000000342,
    0.66666666666552918,
    0.400000000617416152,
    0.2857141602110767158,
    0.2222343454751790666,
    0.1812193443121521441,
    0.1683765997068048829,
];

/// Largest argument of [`small_atan`] and [`small_asin`].
pub const SMALL_ANGLE: f64 = 0.2;

/// Largest argument of [`small_log`], (√2 − 1)/(√2 + 1) less a trifle.
pub const SMALL_LOG: f64 = 0.1715;

/// Arcus tangent for `|x| ≤ SMALL_ANGLE`.
#[inline(always)]
pub fn small_atan<V: Lanes<f64>>(x: V) -> V {
    x * poly(&SMALL_ATAN, x * x)
}

/// Arcus sine for `|x| ≤ SMALL_ANGLE`.
#[inline(always)]
pub fn small_asin<V: Lanes<f64>>(x: V) -> V {
    x * poly(&SMALL_ASIN, x * x)
}

/// `2 atanh(x)/x = ln[(1 + x)/(1 − x)]/x` for `|x| ≤ SMALL_LOG`.
#[inline(always)]
pub fn small_log<V: Lanes<f64>>(x: V) -> V {
    poly(&ATANH2, x * x)
}

/// Angle of the point (x, y), in [−π, π]; zero at the origin.
#[inline(always)]
pub fn atan2<V: Lanes<f64>>(y: V, x: V) -> V {
    let (ax, ay) = (x.abs(), y.abs());
    let far = ax.max(ay).max(V::splat(1e-300));
    let t = ax.min(ay) * far.recip();
    let p = t * poly(&ATAN, t * t);
    let p = V::select(ax.lt(ay), V::splat(FRAC_PI_2) - p, p);
    let p = V::select(x.lt(V::splat(0.0)), V::splat(PI) - p, p);
    p.copysign(y)
}

/// Natural logarithm of a positive normal number.
#[inline(always)]
pub fn ln<V: Lanes<f64>>(x: V) -> V {
    let (m, k) = x.split();
    let one = V::splat(1.0);
    let s = (m - one) * (m + one).recip();
    k.mul_add(V::splat(LN_2), s * poly(&ATANH2, s * s))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn elementary_functions_meet_the_standard_library() {
        for i in 0..200_000 {
            let a = -PI + 2.0 * PI * (i as f64 + 0.5) / 200_000.0;
            let x = (4.0 * a).exp();
            assert!((ln(x) - x.ln()).abs() < 1e-14, "{x}");
            let (s, c) = a.sin_cos();
            assert!((atan2(s, c) - s.atan2(c)).abs() < 2e-14, "{a}");
            let x = SMALL_ANGLE * a / PI;
            assert!((small_atan(x) - x.atan()).abs() < 1e-15, "{x}");
            assert!((small_asin(x) - x.asin()).abs() < 1e-15, "{x}");
            let x = SMALL_LOG * a / PI;
            assert!((x * small_log(x) - 2.0 * x.atanh()).abs() < 1e-15, "{x}");
        }
    }
}
