//! The registers of x86-64.
//!
//! Every intrinsic is sound where it is called: a register type is named in `dispatch` alone, where
//! its instruction set has been found (see [`lanes`](super)).

mod avx2;
mod avx512;
mod sse2;

pub(super) use avx2::{F32x8, F64x4};
pub(super) use avx512::{F32x16, F64x8};
pub(super) use sse2::{F32x4, F64x2};

/// Bits of a number as [`Lanes::split`](super::Lanes::split) takes them apart.
struct Bits<F, I> {
    /// Added to the bits of x so that the exponent changes at √½ · 2^k.
    offset: I,
    mantissa: I,
    /// √½, the lower end of mantissas.
    sqrt_half: I,
    /// The power of two whose last digit is worth one: OR-ing a small integer into it adds that.
    power: I,
    /// The same plus the bias of exponents.
    biased_power: F,
    bias: F,
}

const SINGLE: Bits<f32, i32> = Bits {
    offset: 0x3f80_0000 - 0x3f35_04f3,
    mantissa: 0x007f_ffff,
    sqrt_half: 0x3f35_04f3,
    power: 0x4b00_0000,
    biased_power: 8_388_735.0,
    bias: 127.0,
};

const DOUBLE: Bits<f64, i64> = Bits {
    offset: 0x3ff0_0000_0000_0000 - 0x3fe6_a09e_667f_3bcd,
    mantissa: 0x000f_ffff_ffff_ffff,
    sqrt_half: 0x3fe6_a09e_667f_3bcd,
    power: 0x4330_0000_0000_0000,
    biased_power: 4_503_599_627_371_519.0,
    bias: 1023.0,
};

/// A register type from the names of its intrinsics.
macro_rules! register {
    (
        $(#[$doc:meta])*
        $name:ident($raw:ident): $lanes:literal $element:ident, $registers:literal registers,
        [$add:ident, $sub:ident, $mul:ident, $div:ident, $min:ident, $max:ident, $sqrt:ident],
        [$set:ident, $read:ident, $write:ident, $and:ident, $and_not:ident, $or:ident, $xor:ident],
        bits $bits:ident, $digits:literal
        [$to_bits:ident, $of_bits:ident, $bit_set:ident, $bit_add:ident, $bit_and:ident],
        [$bit_or:ident, $left:ident, $right:ident],
        mul_add($a:ident, $b:ident, $c:ident): $mul_add:expr, $neg_mul_add:expr,
        mask $mask:ident($m:ident, $n:ident): $less:expr, $select:expr, $both:expr, $any:expr, $all:expr,
        $($extra:item)*
    ) => {
        $(#[$doc])*
        #[derive(Clone, Copy)]
        #[repr(transparent)]
        pub(in super::super) struct $name($raw);

        impl Sealed for $name {}

        register!(@operator $name, Add, add, $add);
        register!(@operator $name, Sub, sub, $sub);
        register!(@operator $name, Mul, mul, $mul);
        register!(@operator $name, Div, div, $div);

        impl Neg for $name {
            type Output = Self;
            #[inline(always)]
            fn neg(self) -> Self {
                Self(unsafe { $xor(self.0, $set(-0.0)) })
            }
        }

        impl Lanes<$element> for $name {
            type Mask = $mask;
            const LANES: usize = $lanes;
            const REGISTERS: usize = $registers;

            #[inline(always)]
            fn splat(x: $element) -> Self {
                Self(unsafe { $set(x) })
            }
            #[inline(always)]
            unsafe fn read(x: *const $element) -> Self {
                Self(unsafe { $read(x) })
            }
            #[inline(always)]
            unsafe fn write(self, x: *mut $element) {
                unsafe { $write(x, self.0) }
            }
            #[inline(always)]
            fn mul_add(self, b: Self, c: Self) -> Self {
                let ($a, $b, $c) = (self.0, b.0, c.0);
                Self(unsafe { $mul_add })
            }
            #[inline(always)]
            fn neg_mul_add(self, b: Self, c: Self) -> Self {
                let ($a, $b, $c) = (self.0, b.0, c.0);
                Self(unsafe { $neg_mul_add })
            }
            #[inline(always)]
            fn sqrt(self) -> Self {
                Self(unsafe { $sqrt(self.0) })
            }
            #[inline(always)]
            fn abs(self) -> Self {
                Self(unsafe { $and_not($set(-0.0), self.0) })
            }
            #[inline(always)]
            fn min(self, other: Self) -> Self {
                Self(unsafe { $min(self.0, other.0) })
            }
            #[inline(always)]
            fn max(self, other: Self) -> Self {
                Self(unsafe { $max(self.0, other.0) })
            }
            #[inline(always)]
            fn copysign(self, sign: Self) -> Self {
                Self(unsafe { $or(self.abs().0, $and($set(-0.0), sign.0)) })
            }
            #[inline(always)]
            fn lt(self, other: Self) -> $mask {
                let ($a, $b) = (self.0, other.0);
                unsafe { $less }
            }
            #[inline(always)]
            fn select($m: $mask, yes: Self, no: Self) -> Self {
                let ($a, $b) = (yes.0, no.0);
                Self(unsafe { $select })
            }
            #[inline(always)]
            fn both($m: $mask, $n: $mask) -> $mask {
                $both
            }
            #[inline(always)]
            fn any($m: $mask) -> bool {
                $any
            }
            #[inline(always)]
            fn all($m: $mask) -> bool {
                $all
            }
            #[inline(always)]
            fn split(self) -> (Self, Self) {
                unsafe {
                    let shifted = $bit_add($to_bits(self.0), $bit_set($bits.offset));
                    let k = $bit_or($right::<$digits>(shifted), $bit_set($bits.power));
                    let k = $sub($of_bits(k), $set($bits.biased_power));
                    let m = $bit_and(shifted, $bit_set($bits.mantissa));
                    let m = $bit_add(m, $bit_set($bits.sqrt_half));
                    (Self($of_bits(m)), Self(k))
                }
            }
            #[inline(always)]
            fn two_to_the(n: Self) -> Self {
                let sum = n + Self::splat($element::ROUNDER + $bits.bias);
                Self(unsafe { $of_bits($left::<$digits>($to_bits(sum.0))) })
            }
            $($extra)*
        }
    };
    (@operator $name:ident, $trait:ident, $method:ident, $intrinsic:ident) => {
        impl $trait for $name {
            type Output = Self;
            #[inline(always)]
            fn $method(self, other: Self) -> Self {
                Self(unsafe { $intrinsic(self.0, other.0) })
            }
        }
    };
}
use register;

/// [`CHUNK`](super::CHUNK) places from `start` on, if `out` has them.
#[inline(always)]
fn line(out: &mut [f64], start: usize) -> Option<&mut [f64; super::CHUNK]> {
    out.get_mut(start..)?.first_chunk_mut()
}
