//! AVX-512 F and DQ: sixteen floats or eight doubles.

#![expect(
    clippy::undocumented_unsafe_blocks,
    reason = "one reason for all: a register exists only where run-time detection has found the \
              instruction set, and whoever reads or writes vouches for the memory"
)]

use super::super::register::{Element, Lanes, Sealed};
use super::{DOUBLE, SINGLE, line, register};
use core::arch::x86_64::*;
use core::ops::{Add, Div, Mul, Neg, Sub};

register! {
    /// Sixteen floats in one AVX-512 register.
    F32x16(__m512): 16 f32, 32 registers,
    [_mm512_add_ps, _mm512_sub_ps, _mm512_mul_ps, _mm512_div_ps, _mm512_min_ps, _mm512_max_ps, _mm512_sqrt_ps],
    [_mm512_set1_ps, _mm512_loadu_ps, _mm512_storeu_ps, _mm512_and_ps, _mm512_andnot_ps, _mm512_or_ps, _mm512_xor_ps],
    bits SINGLE, 23
    [_mm512_castps_si512, _mm512_castsi512_ps, _mm512_set1_epi32, _mm512_add_epi32, _mm512_and_si512],
    [_mm512_or_si512, _mm512_slli_epi32, _mm512_srli_epi32],
    mul_add(a, b, c): _mm512_fmadd_ps(a, b, c), _mm512_fnmadd_ps(a, b, c),
    mask __mmask16(m, n):
        _mm512_cmp_ps_mask::<_CMP_LT_OQ>(a, b),
        _mm512_mask_blend_ps(m, b, a),
        m & n,
        m != 0,
        m == u16::MAX,
}

register! {
    /// Eight doubles in one AVX-512 register.
    F64x8(__m512d): 8 f64, 32 registers,
    [_mm512_add_pd, _mm512_sub_pd, _mm512_mul_pd, _mm512_div_pd, _mm512_min_pd, _mm512_max_pd, _mm512_sqrt_pd],
    [_mm512_set1_pd, _mm512_loadu_pd, _mm512_storeu_pd, _mm512_and_pd, _mm512_andnot_pd, _mm512_or_pd, _mm512_xor_pd],
    bits DOUBLE, 52
    [_mm512_castpd_si512, _mm512_castsi512_pd, _mm512_set1_epi64, _mm512_add_epi64, _mm512_and_si512],
    [_mm512_or_si512, _mm512_slli_epi64, _mm512_srli_epi64],
    mul_add(a, b, c): _mm512_fmadd_pd(a, b, c), _mm512_fnmadd_pd(a, b, c),
    mask __mmask8(m, n):
        _mm512_cmp_pd_mask::<_CMP_LT_OQ>(a, b),
        _mm512_mask_blend_pd(m, b, a),
        m & n,
        m != 0,
        m == u8::MAX,
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
