//! Two lanes on SSE2, which every x86-64 machine has.

#![expect(
    clippy::undocumented_unsafe_blocks,
    reason = "one reason for all: SSE2 belongs to every x86-64 machine, and loads and stores go \
              through slices of the right length"
)]

use super::{CHUNK, MANTISSA, Real, SPLIT_OFFSET, SQRT_HALF_BITS, TWO52_BIAS, TWO52_BITS, line};
use core::arch::x86_64::*;
use core::ops::{Add, Div, Mul, Neg, Sub};

/// Two doubles in one SSE register.
#[derive(Clone, Copy)]
#[repr(transparent)]
pub(crate) struct F64x2(__m128d);

macro_rules! operator {
    ($trait:ident, $method:ident, $intrinsic:ident) => {
        impl $trait for F64x2 {
            type Output = Self;
            #[inline(always)]
            fn $method(self, o: Self) -> Self {
                // SAFETY: SSE2 belongs to every x86-64 machine.
                Self(unsafe { $intrinsic(self.0, o.0) })
            }
        }
    };
}
operator!(Add, add, _mm_add_pd);
operator!(Sub, sub, _mm_sub_pd);
operator!(Mul, mul, _mm_mul_pd);
operator!(Div, div, _mm_div_pd);

impl Neg for F64x2 {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        // SAFETY: SSE2 belongs to every x86-64 machine.
        Self(unsafe { _mm_xor_pd(self.0, _mm_set1_pd(-0.0)) })
    }
}

// SAFETY of every block below: SSE2 belongs to every x86-64 machine; loads and
// stores go through references to two doubles.
impl Real for F64x2 {
    type Mask = __m128d;
    const LANES: usize = 2;

    #[inline(always)]
    fn splat(x: f64) -> Self {
        Self(unsafe { _mm_set1_pd(x) })
    }
    #[inline(always)]
    fn load(x: &[f64]) -> Self {
        if let Some(both) = x.first_chunk::<2>() {
            return Self(unsafe { _mm_loadu_pd(both.as_ptr()) });
        }
        let mut both = [x.last().copied().unwrap_or(0.0); 2];
        for (o, v) in both.iter_mut().zip(x) {
            *o = *v;
        }
        Self(unsafe { _mm_loadu_pd(both.as_ptr()) })
    }
    #[inline(always)]
    fn store(self, out: &mut [f64]) {
        if let Some(both) = out.first_chunk_mut::<2>() {
            unsafe { _mm_storeu_pd(both.as_mut_ptr(), self.0) };
            return;
        }
        let mut both = [0.0; 2];
        unsafe { _mm_storeu_pd(both.as_mut_ptr(), self.0) };
        for (o, v) in out.iter_mut().zip(both) {
            *o = v;
        }
    }
    #[inline(always)]
    fn mul_add(self, b: Self, c: Self) -> Self {
        self * b + c
    }
    #[inline(always)]
    fn neg_mul_add(self, b: Self, c: Self) -> Self {
        c - self * b
    }
    #[inline(always)]
    fn sqrt(self) -> Self {
        Self(unsafe { _mm_sqrt_pd(self.0) })
    }
    #[inline(always)]
    fn abs(self) -> Self {
        Self(unsafe { _mm_andnot_pd(_mm_set1_pd(-0.0), self.0) })
    }
    #[inline(always)]
    fn min(self, other: Self) -> Self {
        Self(unsafe { _mm_min_pd(self.0, other.0) })
    }
    #[inline(always)]
    fn max(self, other: Self) -> Self {
        Self(unsafe { _mm_max_pd(self.0, other.0) })
    }
    #[inline(always)]
    fn copysign(self, sign: Self) -> Self {
        let bit = unsafe { _mm_and_pd(_mm_set1_pd(-0.0), sign.0) };
        Self(unsafe { _mm_or_pd(self.abs().0, bit) })
    }
    #[inline(always)]
    fn lt(self, other: Self) -> __m128d {
        unsafe { _mm_cmplt_pd(self.0, other.0) }
    }
    #[inline(always)]
    fn select(mask: __m128d, yes: Self, no: Self) -> Self {
        Self(unsafe { _mm_or_pd(_mm_and_pd(mask, yes.0), _mm_andnot_pd(mask, no.0)) })
    }
    #[inline(always)]
    fn both(a: __m128d, b: __m128d) -> __m128d {
        unsafe { _mm_and_pd(a, b) }
    }
    #[inline(always)]
    fn all(mask: __m128d) -> bool {
        unsafe { _mm_movemask_pd(mask) == 3 }
    }
    #[inline(always)]
    fn any(mask: __m128d) -> bool {
        unsafe { _mm_movemask_pd(mask) != 0 }
    }
    #[inline(always)]
    fn split(self) -> (Self, Self) {
        unsafe {
            let bits = _mm_castpd_si128(self.0);
            let shifted = _mm_add_epi64(bits, _mm_set1_epi64x(SPLIT_OFFSET as i64));
            let biased = _mm_srli_epi64::<52>(shifted);
            let k = _mm_or_si128(biased, _mm_set1_epi64x(TWO52_BITS as i64));
            let k = _mm_sub_pd(_mm_castsi128_pd(k), _mm_set1_pd(TWO52_BIAS));
            let m = _mm_and_si128(shifted, _mm_set1_epi64x(MANTISSA as i64));
            let m = _mm_add_epi64(m, _mm_set1_epi64x(SQRT_HALF_BITS as i64));
            (Self(_mm_castsi128_pd(m)), Self(k))
        }
    }
    #[inline(always)]
    fn transpose_into(rows: &[f64], stride: usize, out: &mut [f64], starts: &[usize]) {
        let mut columns = [[0.0; CHUNK]; 2];
        for (s, row) in rows.chunks(stride).take(CHUNK).enumerate() {
            if let [a, b, ..] = row {
                (columns[0][s], columns[1][s]) = (*a, *b);
            }
        }
        for (column, start) in columns.iter().zip(starts) {
            if let Some(line) = line(out, *start) {
                *line = *column;
            }
        }
    }
}
