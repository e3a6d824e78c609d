//! Sixteen f32 or eight f64 on AVX-512 F.
//!
//! Sound because values exist only inside code that is entered after run-time detection (see
//! [`dispatch`](super::dispatch)).

#![expect(
    clippy::undocumented_unsafe_blocks,
    reason = "one reason for all: a value exists only where run-time detection has found the \
              instruction set, and whoever loads or stores vouches for the memory"
)]

use super::lanes::Lanes;
use super::scalar::Float;
use core::arch::x86_64::*;
use core::ops::{Add, Div, Mul, Sub};

macro_rules! operator {
    ($name:ident, $trait:ident, $method:ident, $intrinsic:ident) => {
        impl $trait for $name {
            type Output = Self;
            #[inline(always)]
            fn $method(self, other: Self) -> Self {
                Self(unsafe { $intrinsic(self.0, other.0) })
            }
        }
    };
}

/// Sixteen floats in one AVX-512 register.
#[derive(Clone, Copy)]
#[repr(transparent)]
pub struct F32x16(__m512);

operator!(F32x16, Add, add, _mm512_add_ps);
operator!(F32x16, Sub, sub, _mm512_sub_ps);
operator!(F32x16, Mul, mul, _mm512_mul_ps);
operator!(F32x16, Div, div, _mm512_div_ps);

impl Lanes<f32> for F32x16 {
    const LANES: usize = 16;

    #[inline(always)]
    fn splat(x: f32) -> Self {
        Self(unsafe { _mm512_set1_ps(x) })
    }
    #[inline(always)]
    unsafe fn load(x: *const f32) -> Self {
        Self(unsafe { _mm512_loadu_ps(x) })
    }
    #[inline(always)]
    unsafe fn store(self, x: *mut f32) {
        unsafe { _mm512_storeu_ps(x, self.0) }
    }
    #[inline(always)]
    fn mul_add(self, b: Self, c: Self) -> Self {
        Self(unsafe { _mm512_fmadd_ps(self.0, b.0, c.0) })
    }
    #[inline(always)]
    fn max(self, other: Self) -> Self {
        Self(unsafe { _mm512_max_ps(self.0, other.0) })
    }
    #[inline(always)]
    fn min(self, other: Self) -> Self {
        Self(unsafe { _mm512_min_ps(self.0, other.0) })
    }
    #[inline(always)]
    fn sqrt(self) -> Self {
        Self(unsafe { _mm512_sqrt_ps(self.0) })
    }
    #[inline(always)]
    fn select_less(a: Self, b: Self, yes: Self, no: Self) -> Self {
        Self(unsafe {
            _mm512_mask_blend_ps(_mm512_cmp_ps_mask::<_CMP_LT_OQ>(a.0, b.0), no.0, yes.0)
        })
    }
    #[inline(always)]
    fn two_to_the(n: Self) -> Self {
        let sum = n + Self::splat(f32::ROUNDER + 127.0);
        Self(unsafe { _mm512_castsi512_ps(_mm512_slli_epi32::<23>(_mm512_castps_si512(sum.0))) })
    }
}

/// Eight doubles in one AVX-512 register.
#[derive(Clone, Copy)]
#[repr(transparent)]
pub struct F64x8(__m512d);

operator!(F64x8, Add, add, _mm512_add_pd);
operator!(F64x8, Sub, sub, _mm512_sub_pd);
operator!(F64x8, Mul, mul, _mm512_mul_pd);
operator!(F64x8, Div, div, _mm512_div_pd);

impl Lanes<f64> for F64x8 {
    const LANES: usize = 8;

    #[inline(always)]
    fn splat(x: f64) -> Self {
        Self(unsafe { _mm512_set1_pd(x) })
    }
    #[inline(always)]
    unsafe fn load(x: *const f64) -> Self {
        Self(unsafe { _mm512_loadu_pd(x) })
    }
    #[inline(always)]
    unsafe fn store(self, x: *mut f64) {
        unsafe { _mm512_storeu_pd(x, self.0) }
    }
    #[inline(always)]
    fn mul_add(self, b: Self, c: Self) -> Self {
        Self(unsafe { _mm512_fmadd_pd(self.0, b.0, c.0) })
    }
    #[inline(always)]
    fn max(self, other: Self) -> Self {
        Self(unsafe { _mm512_max_pd(self.0, other.0) })
    }
    #[inline(always)]
    fn min(self, other: Self) -> Self {
        Self(unsafe { _mm512_min_pd(self.0, other.0) })
    }
    #[inline(always)]
    fn sqrt(self) -> Self {
        Self(unsafe { _mm512_sqrt_pd(self.0) })
    }
    #[inline(always)]
    fn select_less(a: Self, b: Self, yes: Self, no: Self) -> Self {
        Self(unsafe {
            _mm512_mask_blend_pd(_mm512_cmp_pd_mask::<_CMP_LT_OQ>(a.0, b.0), no.0, yes.0)
        })
    }
    #[inline(always)]
    fn two_to_the(n: Self) -> Self {
        let sum = n + Self::splat(f64::ROUNDER + 1023.0);
        Self(unsafe { _mm512_castsi512_pd(_mm512_slli_epi64::<52>(_mm512_castpd_si512(sum.0))) })
    }
}
