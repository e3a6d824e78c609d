//! Elementary functions on lanes, by polynomials of our own fit (Chebyshev nodes).
//!
//! Absolute error of sine and cosine: 1.2e-7 in f32, 2.5e-16 in f64. Relative error of the exponential,
//! the sigmoid and the softplus: 5e-7 in f32, 1e-15 in f64.

#![allow(clippy::excessive_precision, reason = "coefficients as the fit printed them")]

use super::float::Float;
use super::{Lanes, MAX_LANES};
use crate::real::Real;

/// What the functions need to know of a scalar.
pub trait Coefficients: Real {
    /// (sin √z/√z − 1)/z on 0 ≤ z ≤ (π/4)².
    const SIN: &'static [Self];
    /// ((cos √z − 1)/z + ½)/z on 0 ≤ z ≤ (π/4)².
    const COS: &'static [Self];
    /// (eʳ − 1 − r)/r² on |r| ≤ ½ ln 2.
    const EXP: &'static [Self];
    /// (2 atanh √z/√z − 2)/z on 0 ≤ z ≤ 1/9.
    const LOG: &'static [Self];
    /// π/2 in three pieces, of which the multiples up to `FAR` are exact.
    const HALF_PI: [Self; 3];
    /// ln 2 in two pieces, of which the multiples in use are exact.
    const LN_2: [Self; 2];
    /// 2/π.
    const TWO_OVER_PI: Self;
    /// 1/ln 2.
    const LOG2_E: Self;
    /// Beyond this the standard library takes the sine.
    const FAR: Self;
    /// Largest |x| of eˣ; beyond it is held.
    const HELD: Self;
}

impl Coefficients for f32 {
    const SIN: &'static [f32] =
        &[-0.166666646563107068, 0.00833274710437289478, -0.00019587639035792598];
    const COS: &'static [f32] =
        &[0.0416666646534872881, -0.00138883018672701415, 0.0000245476897093822079];
    const EXP: &'static [f32] = &[
        0.5,
        0.166665768459939763,
        0.0416665544376859389,
        0.00836320297157585495,
        0.0013926213466332443,
    ];
    const LOG: &'static [f32] = &[
        0.666666673239750094,
        0.399997050790086544,
        0.285924260746682632,
        0.217054270728385662,
        0.232302556068963591,
    ];
    const HALF_PI: [f32; 3] = [1.5703125, 0.0004837512969970703125, 7.549789954891882169163975e-8];
    const LN_2: [f32; 2] = [0.693115234375, 0.00003194618494530941723212146];
    const TWO_OVER_PI: f32 = core::f32::consts::FRAC_2_PI;
    const LOG2_E: f32 = core::f32::consts::LOG2_E;
    const FAR: f32 = 8192.0;
    const HELD: f32 = 87.0;
}

impl Coefficients for f64 {
    const SIN: &'static [f64] = &[
        -0.166666666666666667,
        0.00833333333333333148,
        -0.00019841269841265041,
        2.75573192193205751e-6,
        -2.50521062259927858e-8,
        1.60585305963902429e-10,
        -7.58663686776649696e-13,
    ];
    const COS: &'static [f64] = &[
        0.0416666666666666654,
        -0.00138888888888873898,
        0.0000248015872987543983,
        -2.75573172658766157e-7,
        2.08761450491082804e-9,
        -1.13825446234042903e-11,
    ];
    const EXP: &'static [f64] = &[
        0.5,
        0.16666666666666671,
        0.0416666666666666698,
        0.00833333333332611205,
        0.00138888888888837318,
        0.000198412698749012592,
        0.0000248015873256053228,
        2.75572552979696444e-6,
        2.75572735701021397e-7,
        2.51052595384484934e-8,
        2.0914717341716376e-9,
    ];
    const LOG: &'static [f64] = &[
        0.666666666666666667,
        0.4,
        0.28571428571428562,
        0.222222222222243801,
        0.181818181815600066,
        0.153846154030884387,
        0.133333324787485619,
        0.117647326467196465,
        0.105257337027579158,
        0.095326828034928533,
        0.0860146667427542827,
        0.0867760619972483971,
        0.0430097656468831377,
        0.147453895986446899,
    ];
    const HALF_PI: [f64; 3] = [
        1.57079632673412561416625976563,
        6.07710050630396597659554913662e-11,
        2.02226624879595073239947791688e-21,
    ];
    const LN_2: [f64; 2] = [0.69314718055829871445894241333, 1.6465949582897081280984430755e-12];
    const TWO_OVER_PI: f64 = core::f64::consts::FRAC_2_PI;
    const LOG2_E: f64 = core::f64::consts::LOG2_E;
    const FAR: f64 = 1_000_000.0;
    const HELD: f64 = 708.0;
}

/// `Σ cᵢ xⁱ`.
#[inline(always)]
fn polynomial<T: Float, V: Lanes<T>>(c: &[T], x: V) -> V {
    let Some((last, rest)) = c.split_last() else { return V::splat(T::zero()) };
    rest.iter().rev().fold(V::splat(*last), |sum, c| sum.mul_add(x, V::splat(*c)))
}

/// The nearest integer, for |x| below 2^22 (f32), 2^51 (f64).
#[inline(always)]
pub fn round<T: Float, V: Lanes<T>>(x: V) -> V {
    (x + V::splat(T::ROUNDER)) - V::splat(T::ROUNDER)
}

/// ⌊n/2⌋ of integers and the remainder.
#[inline(always)]
fn halve<T: Float, V: Lanes<T>>(n: V) -> (V, V) {
    let half = round((n - V::splat(T::of(0.5))) * V::splat(T::of(0.5)));
    (half, n - (half + half))
}

/// Sine and cosine for |x| ≤ `FAR`; a bounded number beyond.
#[inline(always)]
fn near_sin_cos<T: Float, V: Lanes<T>>(x: V) -> (V, V) {
    let s = V::splat;
    let far = s(T::FAR);
    let x = far.min(s(-T::FAR).max(x));
    let quarter = round(x * s(T::TWO_OVER_PI));
    let r = T::HALF_PI.iter().fold(x, |r, piece| quarter.mul_add(s(-*piece), r));
    let z = r * r;
    let sin = (polynomial(T::SIN, z) * z).mul_add(r, r);
    let cos = (z * z).mul_add(polynomial(T::COS, z), z.mul_add(s(T::of(-0.5)), s(T::one())));
    let (half, odd) = halve::<T, V>(quarter);
    let (_, negative) = halve::<T, V>(half);
    let (zero, one, two) = (s(T::zero()), s(T::one()), s(T::of(2.0)));
    let sign = one - two * negative;
    let turn = sign * (one - two * odd);
    let of_sin = V::select(zero.lt(odd), cos, sin);
    let of_cos = V::select(zero.lt(odd), sin, cos);
    (of_sin * sign, of_cos * turn)
}

/// Sine and cosine of every lane.
#[inline(always)]
pub fn sin_cos<T: Float, V: Lanes<T>>(x: V) -> (V, V) {
    let (sin, cos) = near_sin_cos::<T, V>(x);
    let zero = V::splat(T::zero());
    let size = x.max(zero - x);
    if V::any(V::splat(T::FAR).lt(size)) { patch::<T, V>(x, sin, cos) } else { (sin, cos) }
}

/// The lanes beyond `FAR` replaced by what the standard library says.
#[cold]
#[inline(never)]
fn patch<T: Float, V: Lanes<T>>(x: V, sin: V, cos: V) -> (V, V) {
    let mut lanes = [[T::zero(); MAX_LANES]; 3];
    for (lanes, v) in lanes.iter_mut().zip([x, sin, cos]) {
        v.store(lanes);
    }
    let [x, mut sin, mut cos] = lanes;
    for k in 0..V::LANES {
        if x[k].abs() > T::FAR {
            (sin[k], cos[k]) = x[k].sin_cos();
        }
    }
    (V::load_or(&sin, T::zero()), V::load_or(&cos, T::zero()))
}

/// eˣ, held beyond |x| = 87 (f32), 708 (f64).
#[inline(always)]
pub fn exp<T: Float, V: Lanes<T>>(x: V) -> V {
    let s = V::splat;
    let x = s(T::HELD).min(s(-T::HELD).max(x)); // a NaN stays one
    let n = round(x * s(T::LOG2_E));
    let r = T::LN_2.iter().fold(x, |r, piece| n.mul_add(s(-*piece), r));
    let e = (r * r).mul_add(polynomial(T::EXP, r), r) + s(T::one());
    e * V::two_to_the(n)
}

/// 1/(1 + e⁻ˣ).
#[inline(always)]
pub fn sigmoid<T: Float, V: Lanes<T>>(x: V) -> V {
    let one = V::splat(T::one());
    one / (one + exp(V::splat(T::zero()) - x))
}

/// ln(1 + eˣ).
#[inline(always)]
pub fn softplus<T: Float, V: Lanes<T>>(x: V) -> V {
    let zero = V::splat(T::zero());
    let e = exp((zero - x).min(x)); // −|x|
    let s = e / (e + V::splat(T::of(2.0)));
    let z = s * s;
    (polynomial(T::LOG, z) * z).mul_add(s, s + s) + zero.max(x)
}

#[cfg(test)]
mod tests;
