//! The scalars that kernels compute with.

use super::lanes::Lanes;
use super::math::Coefficients;
use super::portable::Array;

/// f32 (to run) or f64 (to test), with its lanes on each instruction set.
pub trait Float: Coefficients {
    /// Lanes that every machine has.
    type Portable: Lanes<Self>;
    /// Lanes of AVX2.
    type Avx2: Lanes<Self>;
    /// Lanes of AVX-512.
    type Avx512: Lanes<Self>;

    /// Adding and subtracting this rounds to the nearest integer: 3·2^(mantissa bits − 1).
    const ROUNDER: Self;

    /// Two to the power of an integer −127 < n < 128 (f32), −1023 < n < 1024 (f64).
    fn two_to_the(n: Self) -> Self;
}

impl Float for f32 {
    type Portable = Array<f32, 4>;
    #[cfg(target_arch = "x86_64")]
    type Avx2 = super::avx2::F32x8;
    #[cfg(target_arch = "x86_64")]
    type Avx512 = super::avx512::F32x16;
    #[cfg(not(target_arch = "x86_64"))]
    type Avx2 = Array<f32, 4>;
    #[cfg(not(target_arch = "x86_64"))]
    type Avx512 = Array<f32, 4>;

    const ROUNDER: f32 = 12_582_912.0;

    #[inline(always)]
    fn two_to_the(n: f32) -> f32 {
        f32::from_bits((n + (Self::ROUNDER + 127.0)).to_bits() << 23)
    }
}

impl Float for f64 {
    type Portable = Array<f64, 2>;
    #[cfg(target_arch = "x86_64")]
    type Avx2 = super::avx2::F64x4;
    #[cfg(target_arch = "x86_64")]
    type Avx512 = super::avx512::F64x8;
    #[cfg(not(target_arch = "x86_64"))]
    type Avx2 = Array<f64, 2>;
    #[cfg(not(target_arch = "x86_64"))]
    type Avx512 = Array<f64, 2>;

    const ROUNDER: f64 = 6_755_399_441_055_744.0;

    #[inline(always)]
    fn two_to_the(n: f64) -> f64 {
        f64::from_bits((n + (Self::ROUNDER + 1023.0)).to_bits() << 52)
    }
}
