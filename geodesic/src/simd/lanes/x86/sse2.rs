//! SSE2, which every x86-64 machine has: four floats or two doubles.

#![expect(
    clippy::undocumented_unsafe_blocks,
    reason = "one reason for all: SSE2 belongs to every x86-64 machine, and whoever reads or \
              writes vouches for the memory"
)]

use super::super::register::{CHUNK, Element, Lanes, Sealed};
use super::{DOUBLE, SINGLE, line, register};
use core::arch::x86_64::*;
use core::ops::{Add, Div, Mul, Neg, Sub};

register! {
    /// Four floats in one SSE register.
    F32x4(__m128): 4 f32, 16 registers,
    [_mm_add_ps, _mm_sub_ps, _mm_mul_ps, _mm_div_ps, _mm_min_ps, _mm_max_ps, _mm_sqrt_ps],
    [_mm_set1_ps, _mm_loadu_ps, _mm_storeu_ps, _mm_and_ps, _mm_andnot_ps, _mm_or_ps, _mm_xor_ps],
    bits SINGLE, 23
    [_mm_castps_si128, _mm_castsi128_ps, _mm_set1_epi32, _mm_add_epi32, _mm_and_si128],
    [_mm_or_si128, _mm_slli_epi32, _mm_srli_epi32],
    mul_add(a, b, c): _mm_add_ps(_mm_mul_ps(a, b), c), _mm_sub_ps(c, _mm_mul_ps(a, b)),
    mask __m128(m, n):
        _mm_cmplt_ps(a, b),
        _mm_or_ps(_mm_and_ps(m, a), _mm_andnot_ps(m, b)),
        unsafe { _mm_and_ps(m, n) },
        unsafe { _mm_movemask_ps(m) != 0 },
        unsafe { _mm_movemask_ps(m) == 15 },
}

register! {
    /// Two doubles in one SSE register.
    F64x2(__m128d): 2 f64, 16 registers,
    [_mm_add_pd, _mm_sub_pd, _mm_mul_pd, _mm_div_pd, _mm_min_pd, _mm_max_pd, _mm_sqrt_pd],
    [_mm_set1_pd, _mm_loadu_pd, _mm_storeu_pd, _mm_and_pd, _mm_andnot_pd, _mm_or_pd, _mm_xor_pd],
    bits DOUBLE, 52
    [_mm_castpd_si128, _mm_castsi128_pd, _mm_set1_epi64x, _mm_add_epi64, _mm_and_si128],
    [_mm_or_si128, _mm_slli_epi64, _mm_srli_epi64],
    mul_add(a, b, c): _mm_add_pd(_mm_mul_pd(a, b), c), _mm_sub_pd(c, _mm_mul_pd(a, b)),
    mask __m128d(m, n):
        _mm_cmplt_pd(a, b),
        _mm_or_pd(_mm_and_pd(m, a), _mm_andnot_pd(m, b)),
        unsafe { _mm_and_pd(m, n) },
        unsafe { _mm_movemask_pd(m) != 0 },
        unsafe { _mm_movemask_pd(m) == 3 },
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
