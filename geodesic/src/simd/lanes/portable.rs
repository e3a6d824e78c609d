//! Lanes that every machine has: single numbers, and short arrays of them.

use super::register::{Element, Lanes, Sealed};
use core::ops::{Add, Div, Mul, Neg, Sub};

/// `N` ≤ [`MAX_LANES`](super::MAX_LANES) numbers, on any machine.
#[derive(Clone, Copy, Debug)]
#[repr(transparent)]
pub struct Array<T, const N: usize>([T; N]);

/// Bits of √½, the lower end of the mantissas of [`Lanes::split`]; those of the mantissa; and those
/// of the power of two whose last digit is worth one.
struct Bits<U> {
    sqrt_half: U,
    mantissa: U,
    power: U,
}

const SINGLE: Bits<u32> =
    Bits { sqrt_half: 0x3f35_04f3, mantissa: 0x007f_ffff, power: 0x4b00_0000 };

const DOUBLE: Bits<u64> = Bits {
    sqrt_half: 0x3fe6_a09e_667f_3bcd,
    mantissa: 0x000f_ffff_ffff_ffff,
    power: 0x4330_0000_0000_0000,
};

/// Lanes of one number.
macro_rules! one_lane {
    ($element:ident, $bits:ident, $width:literal, $bias:literal) => {
        impl Lanes<$element> for $element {
            type Mask = bool;
            const LANES: usize = 1;

            #[inline(always)]
            fn splat(x: $element) -> Self {
                x
            }
            #[inline(always)]
            unsafe fn read(x: *const $element) -> Self {
                // SAFETY: as the caller vouches.
                unsafe { *x }
            }
            #[inline(always)]
            unsafe fn write(self, x: *mut $element) {
                // SAFETY: as the caller vouches.
                unsafe { *x = self }
            }
            /// Fused only where that is one instruction on every machine of the target.
            #[inline(always)]
            fn mul_add(self, b: Self, c: Self) -> Self {
                if cfg!(any(target_arch = "aarch64", target_feature = "fma")) {
                    $element::mul_add(self, b, c)
                } else {
                    self * b + c
                }
            }
            #[inline(always)]
            fn neg_mul_add(self, b: Self, c: Self) -> Self {
                Lanes::mul_add(-self, b, c)
            }
            #[inline(always)]
            fn sqrt(self) -> Self {
                $element::sqrt(self)
            }
            #[inline(always)]
            fn abs(self) -> Self {
                $element::abs(self)
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
                $element::copysign(self, sign)
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
                // The exponent of the sum changes at √½ · 2^k.
                let offset = (1.0 as $element).to_bits() - $bits.sqrt_half;
                let shifted = self.to_bits().wrapping_add(offset);
                let power = $element::from_bits($bits.power);
                let k = $element::from_bits((shifted >> $width) | $bits.power) - (power + $bias);
                let mantissa = (shifted & $bits.mantissa).wrapping_add($bits.sqrt_half);
                ($element::from_bits(mantissa), k)
            }
            #[inline(always)]
            fn two_to_the(n: Self) -> Self {
                $element::from_bits((n + (Self::ROUNDER + $bias)).to_bits() << $width)
            }
        }
    };
}

one_lane!(f32, SINGLE, 23, 127.0);
one_lane!(f64, DOUBLE, 52, 1023.0);

impl<T: Copy, const N: usize> Array<T, N> {
    #[inline(always)]
    fn zip(self, other: Self, f: impl Fn(T, T) -> T) -> Self {
        let mut out = self.0;
        for (x, y) in out.iter_mut().zip(other.0) {
            *x = f(*x, y);
        }
        Self(out)
    }
}

impl<T, const N: usize> Sealed for Array<T, N> {}

macro_rules! operator {
    ($trait:ident, $method:ident) => {
        impl<T: Element, const N: usize> $trait for Array<T, N> {
            type Output = Self;
            #[inline(always)]
            fn $method(self, other: Self) -> Self {
                self.zip(other, T::$method)
            }
        }
    };
}
operator!(Add, add);
operator!(Sub, sub);
operator!(Mul, mul);
operator!(Div, div);

impl<T: Element, const N: usize> Neg for Array<T, N> {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        Self(self.0.map(T::neg))
    }
}

impl<T: Element + Lanes<T, Mask = bool>, const N: usize> Lanes<T> for Array<T, N> {
    type Mask = [bool; N];
    const LANES: usize = N;

    #[inline(always)]
    fn splat(x: T) -> Self {
        Self([x; N])
    }
    #[inline(always)]
    unsafe fn read(x: *const T) -> Self {
        // SAFETY: the caller vouches for N readable numbers; an array is aligned like its items.
        unsafe { x.cast::<Self>().read() }
    }
    #[inline(always)]
    unsafe fn write(self, x: *mut T) {
        // SAFETY: the caller vouches for N writable numbers; an array is aligned like its items.
        unsafe { x.cast::<Self>().write(self) }
    }
    #[inline(always)]
    fn mul_add(self, b: Self, c: Self) -> Self {
        let mut out = c.0;
        for ((o, a), b) in out.iter_mut().zip(self.0).zip(b.0) {
            *o = a.mul_add(b, *o);
        }
        Self(out)
    }
    #[inline(always)]
    fn neg_mul_add(self, b: Self, c: Self) -> Self {
        (-self).mul_add(b, c)
    }
    #[inline(always)]
    fn sqrt(self) -> Self {
        Self(self.0.map(T::sqrt))
    }
    #[inline(always)]
    fn abs(self) -> Self {
        Self(self.0.map(T::abs))
    }
    #[inline(always)]
    fn min(self, other: Self) -> Self {
        self.zip(other, T::min)
    }
    #[inline(always)]
    fn max(self, other: Self) -> Self {
        self.zip(other, T::max)
    }
    #[inline(always)]
    fn copysign(self, sign: Self) -> Self {
        self.zip(sign, T::copysign)
    }
    #[inline(always)]
    fn lt(self, other: Self) -> [bool; N] {
        core::array::from_fn(|l| self.0[l] < other.0[l])
    }
    #[inline(always)]
    fn select(mask: [bool; N], yes: Self, no: Self) -> Self {
        Self(core::array::from_fn(|l| if mask[l] { yes.0[l] } else { no.0[l] }))
    }
    #[inline(always)]
    fn both(a: [bool; N], b: [bool; N]) -> [bool; N] {
        core::array::from_fn(|l| a[l] && b[l])
    }
    #[inline(always)]
    fn any(mask: [bool; N]) -> bool {
        mask.contains(&true)
    }
    #[inline(always)]
    fn all(mask: [bool; N]) -> bool {
        !mask.contains(&false)
    }
    #[inline(always)]
    fn split(self) -> (Self, Self) {
        let both = self.0.map(T::split);
        (Self(both.map(|(mantissa, _)| mantissa)), Self(both.map(|(_, exponent)| exponent)))
    }
    #[inline(always)]
    fn two_to_the(n: Self) -> Self {
        Self(n.0.map(T::two_to_the))
    }
}
