//! The scalar trait [`Real`] and its lane types.
//!
//! One kernel source serves every width: `f64` itself, the hardware vectors of the x86-64
//! modules, and two of either side by side. Those beyond SSE2 are only ever constructed inside
//! functions that carry the matching `#[target_feature]` and that are reached after run-time
//! detection. (Plain arrays are no substitute: the compiler takes minutes over them, for half
//! the speed of SSE2.)

#[cfg(target_arch = "x86_64")]
pub(crate) mod avx2;
#[cfg(target_arch = "x86_64")]
pub(crate) mod avx512;
mod pair;
mod portable;
#[cfg(target_arch = "x86_64")]
pub(crate) mod sse2;

pub(crate) use pair::Pair;

use core::ops::{Add, Div, Mul, Neg, Sub};

/// A register of double-precision numbers, one per lane.
///
/// All operations work lane by lane. `mul_add` is fused where the hardware
/// fuses and a product followed by a sum elsewhere.
pub trait Real:
    Copy
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
    + Neg<Output = Self>
{
    /// Result of a comparison.
    type Mask: Copy;

    /// Number of lanes.
    const LANES: usize;

    /// The same number in every lane.
    fn splat(x: f64) -> Self;

    /// Lanes from the front of `x`; missing ones repeat the last entry (or are zero).
    fn load(x: &[f64]) -> Self;

    /// Lanes to the front of `out`, as many as fit.
    fn store(self, out: &mut [f64]);

    /// `self · b + c`.
    fn mul_add(self, b: Self, c: Self) -> Self;

    /// `c − self · b`.
    fn neg_mul_add(self, b: Self, c: Self) -> Self;

    /// Square root.
    fn sqrt(self) -> Self;

    /// `1 / self`, to about one unit in the last place.
    #[inline(always)]
    fn recip(self) -> Self {
        Self::splat(1.0) / self
    }

    /// Absolute value.
    fn abs(self) -> Self;

    /// The smaller one (unspecified for NaN).
    fn min(self, other: Self) -> Self;

    /// The larger one (unspecified for NaN).
    fn max(self, other: Self) -> Self;

    /// Magnitude of `self`, sign of `sign`.
    fn copysign(self, sign: Self) -> Self;

    /// `self < other`, false for NaN.
    fn lt(self, other: Self) -> Self::Mask;

    /// `yes` where the mask holds, `no` elsewhere.
    fn select(mask: Self::Mask, yes: Self, no: Self) -> Self;

    /// Both masks.
    fn both(a: Self::Mask, b: Self::Mask) -> Self::Mask;

    /// Whether the mask holds in some lane.
    fn any(mask: Self::Mask) -> bool;

    /// Whether the mask holds in all lanes.
    fn all(mask: Self::Mask) -> bool;

    /// For positive normal numbers: `(m, k)` with `self = m · 2^k`, `√½ ≤ m < √2`, `k` integer.
    fn split(self) -> (Self, Self);

    /// Turns `CHUNK` stored bundles: number `l` of row `s`, at `rows[s · stride + l]`, goes to
    /// `out[starts[l] + s]`. Lanes that would leave `out` may be dropped.
    #[inline(always)]
    fn transpose_into(rows: &[f64], stride: usize, out: &mut [f64], starts: &[usize]) {
        transpose_plain(rows, stride, CHUNK, out, starts.get(..Self::LANES).unwrap_or(&[]));
    }
}

/// Rows of a transposition.
pub const CHUNK: usize = 8;

/// The most lanes that any register has.
pub const MAX_LANES: usize = 16;

/// A transposition of any number of rows, one column for each of `starts`.
#[inline(always)]
pub(crate) fn transpose_plain(
    rows: &[f64],
    stride: usize,
    count: usize,
    out: &mut [f64],
    starts: &[usize],
) {
    for (s, row) in rows.chunks(stride).take(count).enumerate() {
        for (x, start) in row.iter().zip(starts) {
            if let Some(slot) = out.get_mut(start + s) {
                *slot = *x;
            }
        }
    }
}

/// `CHUNK` places from `start` on, if `out` has them.
#[inline(always)]
pub(crate) fn line(out: &mut [f64], start: usize) -> Option<&mut [f64; CHUNK]> {
    out.get_mut(start..)?.first_chunk_mut()
}

/// Bits of √½, the lower end of the mantissa interval of [`Real::split`].
pub(crate) const SQRT_HALF_BITS: u64 = 0x3fe6_a09e_667f_3bcd;
/// Bits of the mantissa.
pub(crate) const MANTISSA: u64 = 0x000f_ffff_ffff_ffff;
/// Added to the bits of x so that the exponent field switches at √½ · 2^k.
pub(crate) const SPLIT_OFFSET: u64 = 0x3ff0_0000_0000_0000 - SQRT_HALF_BITS;
/// 2^52 as bits: OR-ing a small integer into it makes the double 2^52 + integer.
pub(crate) const TWO52_BITS: u64 = 0x4330_0000_0000_0000;
/// 2^52 + 1023.
pub(crate) const TWO52_BIAS: f64 = 4_503_599_627_371_519.0;

#[inline(always)]
pub(crate) fn split_scalar(x: f64) -> (f64, f64) {
    let shifted = x.to_bits().wrapping_add(SPLIT_OFFSET);
    let k = f64::from_bits((shifted >> 52) | TWO52_BITS) - TWO52_BIAS;
    let m = f64::from_bits((shifted & MANTISSA).wrapping_add(SQRT_HALF_BITS));
    (m, k)
}

impl Real for f64 {
    type Mask = bool;
    const LANES: usize = 1;

    #[inline(always)]
    fn splat(x: f64) -> Self {
        x
    }
    #[inline(always)]
    fn load(x: &[f64]) -> Self {
        x.first().copied().unwrap_or(0.0)
    }
    #[inline(always)]
    fn store(self, out: &mut [f64]) {
        if let Some(slot) = out.first_mut() {
            *slot = self;
        }
    }
    #[inline(always)]
    fn mul_add(self, b: Self, c: Self) -> Self {
        portable::fma(self, b, c)
    }
    #[inline(always)]
    fn neg_mul_add(self, b: Self, c: Self) -> Self {
        portable::fma(-self, b, c)
    }
    #[inline(always)]
    fn sqrt(self) -> Self {
        f64::sqrt(self)
    }
    #[inline(always)]
    fn abs(self) -> Self {
        f64::abs(self)
    }
    #[inline(always)]
    fn min(self, other: Self) -> Self {
        if self < other { self } else { other }
    }
    #[inline(always)]
    fn max(self, other: Self) -> Self {
        if self > other { self } else { other }
    }
    #[inline(always)]
    fn copysign(self, sign: Self) -> Self {
        f64::copysign(self, sign)
    }
    #[inline(always)]
    fn lt(self, other: Self) -> bool {
        self < other
    }
    #[inline(always)]
    fn select(mask: bool, yes: Self, no: Self) -> Self {
        if mask { yes } else { no }
    }
    #[inline(always)]
    fn both(a: bool, b: bool) -> bool {
        a && b
    }
    #[inline(always)]
    fn any(mask: bool) -> bool {
        mask
    }
    #[inline(always)]
    fn all(mask: bool) -> bool {
        mask
    }
    #[inline(always)]
    fn split(self) -> (Self, Self) {
        split_scalar(self)
    }
}
