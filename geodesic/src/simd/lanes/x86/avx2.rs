//! AVX2 with FMA: eight floats or four doubles.

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
    /// Eight floats in one AVX register.
    F32x8(__m256): 8 f32, 16 registers,
    [_mm256_add_ps, _mm256_sub_ps, _mm256_mul_ps, _mm256_div_ps, _mm256_min_ps, _mm256_max_ps, _mm256_sqrt_ps],
    [_mm256_set1_ps, _mm256_loadu_ps, _mm256_storeu_ps, _mm256_and_ps, _mm256_andnot_ps, _mm256_or_ps, _mm256_xor_ps],
    bits SINGLE, 23
    [_mm256_castps_si256, _mm256_castsi256_ps, _mm256_set1_epi32, _mm256_add_epi32, _mm256_and_si256],
    [_mm256_or_si256, _mm256_slli_epi32, _mm256_srli_epi32],
    mul_add(a, b, c): _mm256_fmadd_ps(a, b, c), _mm256_fnmadd_ps(a, b, c),
    mask __m256(m, n):
        _mm256_cmp_ps::<_CMP_LT_OQ>(a, b),
        _mm256_blendv_ps(b, a, m),
        unsafe { _mm256_and_ps(m, n) },
        unsafe { _mm256_movemask_ps(m) != 0 },
        unsafe { _mm256_movemask_ps(m) == 255 },
}

register! {
    /// Four doubles in one AVX register.
    F64x4(__m256d): 4 f64, 16 registers,
    [_mm256_add_pd, _mm256_sub_pd, _mm256_mul_pd, _mm256_div_pd, _mm256_min_pd, _mm256_max_pd, _mm256_sqrt_pd],
    [_mm256_set1_pd, _mm256_loadu_pd, _mm256_storeu_pd, _mm256_and_pd, _mm256_andnot_pd, _mm256_or_pd, _mm256_xor_pd],
    bits DOUBLE, 52
    [_mm256_castpd_si256, _mm256_castsi256_pd, _mm256_set1_epi64x, _mm256_add_epi64, _mm256_and_si256],
    [_mm256_or_si256, _mm256_slli_epi64, _mm256_srli_epi64],
    mul_add(a, b, c): _mm256_fmadd_pd(a, b, c), _mm256_fnmadd_pd(a, b, c),
    mask __m256d(m, n):
        _mm256_cmp_pd::<_CMP_LT_OQ>(a, b),
        _mm256_blendv_pd(b, a, m),
        unsafe { _mm256_and_pd(m, n) },
        unsafe { _mm256_movemask_pd(m) != 0 },
        unsafe { _mm256_movemask_pd(m) == 15 },
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
