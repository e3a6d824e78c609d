//! Eight lanes on AVX-512 (F and DQ).
//!
//! Sound because values of [`F64x8`] exist only inside code that is entered
//! after `is_x86_feature_detected!("avx512f")` and `("avx512dq")`.

#![expect(
    clippy::undocumented_unsafe_blocks,
    reason = "one reason for all: a value exists only where run-time detection has found the \
              instruction set, and loads and stores go through slices of the right length"
)]

use super::{MANTISSA, Real, SPLIT_OFFSET, SQRT_HALF_BITS, TWO52_BIAS, TWO52_BITS, line};
use core::arch::x86_64::*;
use core::ops::{Add, Div, Mul, Neg, Sub};

/// Eight doubles in one AVX-512 register.
#[derive(Clone, Copy)]
#[repr(transparent)]
pub(crate) struct F64x8(__m512d);

macro_rules! operator {
    ($trait:ident, $method:ident, $intrinsic:ident) => {
        impl $trait for F64x8 {
            type Output = Self;
            #[inline(always)]
            fn $method(self, o: Self) -> Self {
                // SAFETY: AVX-512F is present wherever an F64x8 exists.
                Self(unsafe { $intrinsic(self.0, o.0) })
            }
        }
    };
}
operator!(Add, add, _mm512_add_pd);
operator!(Sub, sub, _mm512_sub_pd);
operator!(Mul, mul, _mm512_mul_pd);
operator!(Div, div, _mm512_div_pd);

impl Neg for F64x8 {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        // SAFETY: AVX-512DQ is present wherever an F64x8 exists.
        Self(unsafe { _mm512_xor_pd(self.0, _mm512_set1_pd(-0.0)) })
    }
}

// SAFETY of every block below: AVX-512F and DQ are present wherever an F64x8
// exists; loads and stores go through references to eight doubles.
impl Real for F64x8 {
    type Mask = __mmask8;
    const LANES: usize = 8;

    #[inline(always)]
    fn splat(x: f64) -> Self {
        Self(unsafe { _mm512_set1_pd(x) })
    }
    #[inline(always)]
    fn load(x: &[f64]) -> Self {
        if let Some(eight) = x.first_chunk::<8>() {
            return Self(unsafe { _mm512_loadu_pd(eight.as_ptr()) });
        }
        let mut eight = [x.last().copied().unwrap_or(0.0); 8];
        for (o, v) in eight.iter_mut().zip(x) {
            *o = *v;
        }
        Self(unsafe { _mm512_loadu_pd(eight.as_ptr()) })
    }
    #[inline(always)]
    fn store(self, out: &mut [f64]) {
        if let Some(eight) = out.first_chunk_mut::<8>() {
            unsafe { _mm512_storeu_pd(eight.as_mut_ptr(), self.0) };
            return;
        }
        let mut eight = [0.0; 8];
        unsafe { _mm512_storeu_pd(eight.as_mut_ptr(), self.0) };
        for (o, v) in out.iter_mut().zip(eight) {
            *o = v;
        }
    }
    #[inline(always)]
    fn mul_add(self, b: Self, c: Self) -> Self {
        Self(unsafe { _mm512_fmadd_pd(self.0, b.0, c.0) })
    }
    #[inline(always)]
    fn neg_mul_add(self, b: Self, c: Self) -> Self {
        Self(unsafe { _mm512_fnmadd_pd(self.0, b.0, c.0) })
    }
    #[inline(always)]
    fn sqrt(self) -> Self {
        Self(unsafe { _mm512_sqrt_pd(self.0) })
    }
    /// The 14-bit estimate with a cubic and a quadratic Newton step: about
    /// 3 cycles of throughput instead of the divider's 16.
    #[inline(always)]
    fn recip(self) -> Self {
        let one = Self::splat(1.0);
        let y = Self(unsafe { _mm512_rcp14_pd(self.0) });
        let e = self.neg_mul_add(y, one);
        let y = y.mul_add(e.mul_add(e, e), y);
        let e = self.neg_mul_add(y, one);
        y.mul_add(e, y)
    }
    #[inline(always)]
    fn abs(self) -> Self {
        Self(unsafe { _mm512_abs_pd(self.0) })
    }
    #[inline(always)]
    fn min(self, other: Self) -> Self {
        Self(unsafe { _mm512_min_pd(self.0, other.0) })
    }
    #[inline(always)]
    fn max(self, other: Self) -> Self {
        Self(unsafe { _mm512_max_pd(self.0, other.0) })
    }
    #[inline(always)]
    fn copysign(self, sign: Self) -> Self {
        let bit = unsafe { _mm512_and_pd(_mm512_set1_pd(-0.0), sign.0) };
        Self(unsafe { _mm512_or_pd(self.abs().0, bit) })
    }
    #[inline(always)]
    fn lt(self, other: Self) -> __mmask8 {
        unsafe { _mm512_cmp_pd_mask::<_CMP_LT_OQ>(self.0, other.0) }
    }
    #[inline(always)]
    fn select(mask: __mmask8, yes: Self, no: Self) -> Self {
        Self(unsafe { _mm512_mask_blend_pd(mask, no.0, yes.0) })
    }
    #[inline(always)]
    fn both(a: __mmask8, b: __mmask8) -> __mmask8 {
        a & b
    }
    #[inline(always)]
    fn all(mask: __mmask8) -> bool {
        mask == 255
    }
    #[inline(always)]
    fn any(mask: __mmask8) -> bool {
        mask != 0
    }
    #[inline(always)]
    fn split(self) -> (Self, Self) {
        unsafe {
            let bits = _mm512_castpd_si512(self.0);
            let shifted = _mm512_add_epi64(bits, _mm512_set1_epi64(SPLIT_OFFSET as i64));
            let biased = _mm512_srli_epi64::<52>(shifted);
            let k = _mm512_or_si512(biased, _mm512_set1_epi64(TWO52_BITS as i64));
            let k = _mm512_sub_pd(_mm512_castsi512_pd(k), _mm512_set1_pd(TWO52_BIAS));
            let m = _mm512_and_si512(shifted, _mm512_set1_epi64(MANTISSA as i64));
            let m = _mm512_add_epi64(m, _mm512_set1_epi64(SQRT_HALF_BITS as i64));
            (Self(_mm512_castsi512_pd(m)), Self(k))
        }
    }
    #[inline(always)]
    fn transpose_into(rows: &[f64], stride: usize, out: &mut [f64], starts: &[usize]) {
        let row = |s: usize| Self::load(rows.get(s * stride..).unwrap_or(&[]));
        let (r0, r1, r2, r3) = (row(0), row(1), row(2), row(3));
        let (r4, r5, r6, r7) = (row(4), row(5), row(6), row(7));
        let columns = unsafe {
            // Pairs of rows, then quarters of four rows, then halves.
            let a0 = _mm512_unpacklo_pd(r0.0, r1.0);
            let a1 = _mm512_unpackhi_pd(r0.0, r1.0);
            let a2 = _mm512_unpacklo_pd(r2.0, r3.0);
            let a3 = _mm512_unpackhi_pd(r2.0, r3.0);
            let a4 = _mm512_unpacklo_pd(r4.0, r5.0);
            let a5 = _mm512_unpackhi_pd(r4.0, r5.0);
            let a6 = _mm512_unpacklo_pd(r6.0, r7.0);
            let a7 = _mm512_unpackhi_pd(r6.0, r7.0);
            // Lanes (0, 4 | 2, 6) of rows 0–3 and of rows 4–7, and so on.
            let b0 = _mm512_shuffle_f64x2::<0x88>(a0, a2);
            let b1 = _mm512_shuffle_f64x2::<0x88>(a1, a3);
            let b2 = _mm512_shuffle_f64x2::<0xdd>(a0, a2);
            let b3 = _mm512_shuffle_f64x2::<0xdd>(a1, a3);
            let b4 = _mm512_shuffle_f64x2::<0x88>(a4, a6);
            let b5 = _mm512_shuffle_f64x2::<0x88>(a5, a7);
            let b6 = _mm512_shuffle_f64x2::<0xdd>(a4, a6);
            let b7 = _mm512_shuffle_f64x2::<0xdd>(a5, a7);
            [
                _mm512_shuffle_f64x2::<0x88>(b0, b4),
                _mm512_shuffle_f64x2::<0x88>(b1, b5),
                _mm512_shuffle_f64x2::<0x88>(b2, b6),
                _mm512_shuffle_f64x2::<0x88>(b3, b7),
                _mm512_shuffle_f64x2::<0xdd>(b0, b4),
                _mm512_shuffle_f64x2::<0xdd>(b1, b5),
                _mm512_shuffle_f64x2::<0xdd>(b2, b6),
                _mm512_shuffle_f64x2::<0xdd>(b3, b7),
            ]
        };
        let Some(starts) = starts.first_chunk::<8>() else { return };
        for l in 0..8 {
            if let Some(line) = line(out, starts[l]) {
                unsafe { _mm512_storeu_pd(line.as_mut_ptr(), columns[l]) };
            }
        }
    }
}
