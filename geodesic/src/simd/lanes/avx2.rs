//! Four lanes on AVX2 with FMA.
//!
//! Sound because values of [`F64x4`] exist only inside code that is entered
//! after `is_x86_feature_detected!("avx2")` and `("fma")` (see `dispatch`).

#![expect(
    clippy::undocumented_unsafe_blocks,
    reason = "one reason for all: a value exists only where run-time detection has found the \
              instruction set, and loads and stores go through slices of the right length"
)]

use super::{MANTISSA, Real, SPLIT_OFFSET, SQRT_HALF_BITS, TWO52_BIAS, TWO52_BITS, line};
use core::arch::x86_64::*;
use core::ops::{Add, Div, Mul, Neg, Sub};

/// Four doubles in one AVX register.
#[derive(Clone, Copy)]
#[repr(transparent)]
pub(crate) struct F64x4(__m256d);

macro_rules! operator {
    ($trait:ident, $method:ident, $intrinsic:ident) => {
        impl $trait for F64x4 {
            type Output = Self;
            #[inline(always)]
            fn $method(self, o: Self) -> Self {
                // SAFETY: AVX2 is present wherever an F64x4 exists.
                Self(unsafe { $intrinsic(self.0, o.0) })
            }
        }
    };
}
operator!(Add, add, _mm256_add_pd);
operator!(Sub, sub, _mm256_sub_pd);
operator!(Mul, mul, _mm256_mul_pd);
operator!(Div, div, _mm256_div_pd);

impl Neg for F64x4 {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        // SAFETY: AVX2 is present wherever an F64x4 exists.
        Self(unsafe { _mm256_xor_pd(self.0, _mm256_set1_pd(-0.0)) })
    }
}

// SAFETY of every block below: AVX2 and FMA are present wherever an F64x4
// exists; loads and stores go through references to four doubles.
impl Real for F64x4 {
    type Mask = __m256d;
    const LANES: usize = 4;

    #[inline(always)]
    fn splat(x: f64) -> Self {
        Self(unsafe { _mm256_set1_pd(x) })
    }
    #[inline(always)]
    fn load(x: &[f64]) -> Self {
        if let Some(four) = x.first_chunk::<4>() {
            return Self(unsafe { _mm256_loadu_pd(four.as_ptr()) });
        }
        let mut four = [x.last().copied().unwrap_or(0.0); 4];
        for (o, v) in four.iter_mut().zip(x) {
            *o = *v;
        }
        Self(unsafe { _mm256_loadu_pd(four.as_ptr()) })
    }
    #[inline(always)]
    fn store(self, out: &mut [f64]) {
        if let Some(four) = out.first_chunk_mut::<4>() {
            unsafe { _mm256_storeu_pd(four.as_mut_ptr(), self.0) };
            return;
        }
        let mut four = [0.0; 4];
        unsafe { _mm256_storeu_pd(four.as_mut_ptr(), self.0) };
        for (o, v) in out.iter_mut().zip(four) {
            *o = v;
        }
    }
    #[inline(always)]
    fn mul_add(self, b: Self, c: Self) -> Self {
        Self(unsafe { _mm256_fmadd_pd(self.0, b.0, c.0) })
    }
    #[inline(always)]
    fn neg_mul_add(self, b: Self, c: Self) -> Self {
        Self(unsafe { _mm256_fnmadd_pd(self.0, b.0, c.0) })
    }
    #[inline(always)]
    fn sqrt(self) -> Self {
        Self(unsafe { _mm256_sqrt_pd(self.0) })
    }
    #[inline(always)]
    fn abs(self) -> Self {
        Self(unsafe { _mm256_andnot_pd(_mm256_set1_pd(-0.0), self.0) })
    }
    #[inline(always)]
    fn min(self, other: Self) -> Self {
        Self(unsafe { _mm256_min_pd(self.0, other.0) })
    }
    #[inline(always)]
    fn max(self, other: Self) -> Self {
        Self(unsafe { _mm256_max_pd(self.0, other.0) })
    }
    #[inline(always)]
    fn copysign(self, sign: Self) -> Self {
        let bit = unsafe { _mm256_and_pd(_mm256_set1_pd(-0.0), sign.0) };
        Self(unsafe { _mm256_or_pd(self.abs().0, bit) })
    }
    #[inline(always)]
    fn lt(self, other: Self) -> __m256d {
        unsafe { _mm256_cmp_pd::<_CMP_LT_OQ>(self.0, other.0) }
    }
    #[inline(always)]
    fn select(mask: __m256d, yes: Self, no: Self) -> Self {
        Self(unsafe { _mm256_blendv_pd(no.0, yes.0, mask) })
    }
    #[inline(always)]
    fn both(a: __m256d, b: __m256d) -> __m256d {
        unsafe { _mm256_and_pd(a, b) }
    }
    #[inline(always)]
    fn all(mask: __m256d) -> bool {
        unsafe { _mm256_movemask_pd(mask) == 15 }
    }
    #[inline(always)]
    fn any(mask: __m256d) -> bool {
        unsafe { _mm256_movemask_pd(mask) != 0 }
    }
    #[inline(always)]
    fn split(self) -> (Self, Self) {
        unsafe {
            let bits = _mm256_castpd_si256(self.0);
            let shifted = _mm256_add_epi64(bits, _mm256_set1_epi64x(SPLIT_OFFSET as i64));
            let biased = _mm256_srli_epi64::<52>(shifted);
            let k = _mm256_or_si256(biased, _mm256_set1_epi64x(TWO52_BITS as i64));
            let k = _mm256_sub_pd(_mm256_castsi256_pd(k), _mm256_set1_pd(TWO52_BIAS));
            let m = _mm256_and_si256(shifted, _mm256_set1_epi64x(MANTISSA as i64));
            let m = _mm256_add_epi64(m, _mm256_set1_epi64x(SQRT_HALF_BITS as i64));
            (Self(_mm256_castsi256_pd(m)), Self(k))
        }
    }
    #[inline(always)]
    fn transpose_into(rows: &[f64], stride: usize, out: &mut [f64], starts: &[usize]) {
        let row = |s: usize| Self::load(rows.get(s * stride..).unwrap_or(&[]));
        let (r0, r1, r2, r3) = (row(0), row(1), row(2), row(3));
        let (r4, r5, r6, r7) = (row(4), row(5), row(6), row(7));
        let (left, right) = (square(r0, r1, r2, r3), square(r4, r5, r6, r7));
        let Some(starts) = starts.first_chunk::<4>() else { return };
        for l in 0..4 {
            if let Some(line) = line(out, starts[l]) {
                unsafe {
                    _mm256_storeu_pd(line.as_mut_ptr(), left[l]);
                    _mm256_storeu_pd(line.as_mut_ptr().add(4), right[l]);
                }
            }
        }
    }
}

/// The columns of four rows.
#[inline(always)]
fn square(r0: F64x4, r1: F64x4, r2: F64x4, r3: F64x4) -> [__m256d; 4] {
    // SAFETY: AVX2 is present wherever an F64x4 exists.
    unsafe {
        let lo01 = _mm256_unpacklo_pd(r0.0, r1.0);
        let hi01 = _mm256_unpackhi_pd(r0.0, r1.0);
        let lo23 = _mm256_unpacklo_pd(r2.0, r3.0);
        let hi23 = _mm256_unpackhi_pd(r2.0, r3.0);
        [
            _mm256_permute2f128_pd::<0x20>(lo01, lo23),
            _mm256_permute2f128_pd::<0x20>(hi01, hi23),
            _mm256_permute2f128_pd::<0x31>(lo01, lo23),
            _mm256_permute2f128_pd::<0x31>(hi01, hi23),
        ]
    }
}
