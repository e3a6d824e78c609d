//! Lanes that every machine has: short arrays, which the compiler turns into its base registers.

use super::lanes::Lanes;
use super::scalar::Float;
use core::ops::{Add, Div, Mul, Sub};

/// `N` numbers.
#[derive(Clone, Copy)]
#[repr(transparent)]
pub struct Array<T, const N: usize>([T; N]);

impl<T: Float, const N: usize> Array<T, N> {
    #[inline(always)]
    fn zip(self, other: Self, f: impl Fn(T, T) -> T) -> Self {
        let mut out = self.0;
        for (x, y) in out.iter_mut().zip(other.0) {
            *x = f(*x, y);
        }
        Self(out)
    }
}

macro_rules! operator {
    ($trait:ident, $method:ident, $symbol:tt) => {
        impl<T: Float, const N: usize> $trait for Array<T, N> {
            type Output = Self;
            #[inline(always)]
            fn $method(self, other: Self) -> Self {
                self.zip(other, |x, y| x $symbol y)
            }
        }
    };
}
operator!(Add, add, +);
operator!(Sub, sub, -);
operator!(Mul, mul, *);
operator!(Div, div, /);

/// `a · b + c`, fused only where that is one instruction on every machine of the target.
#[inline(always)]
fn fma<T: Float>(a: T, b: T, c: T) -> T {
    if cfg!(any(target_arch = "aarch64", target_feature = "fma")) {
        a.mul_add(b, c)
    } else {
        a * b + c
    }
}

impl<T: Float, const N: usize> Lanes<T> for Array<T, N> {
    const LANES: usize = N;

    #[inline(always)]
    fn splat(x: T) -> Self {
        Self([x; N])
    }
    #[inline(always)]
    unsafe fn load(x: *const T) -> Self {
        // SAFETY: the caller vouches for N readable numbers; an array is aligned like its items.
        unsafe { x.cast::<Self>().read() }
    }
    #[inline(always)]
    unsafe fn store(self, x: *mut T) {
        // SAFETY: the caller vouches for N writable numbers; an array is aligned like its items.
        unsafe { x.cast::<Self>().write(self) }
    }
    #[inline(always)]
    fn mul_add(self, b: Self, c: Self) -> Self {
        let mut out = c.0;
        for ((o, a), b) in out.iter_mut().zip(self.0).zip(b.0) {
            *o = fma(a, b, *o);
        }
        Self(out)
    }
    #[inline(always)]
    fn max(self, other: Self) -> Self {
        self.zip(other, |x, y| if x > y { x } else { y })
    }
    #[inline(always)]
    fn min(self, other: Self) -> Self {
        self.zip(other, |x, y| if x < y { x } else { y })
    }
    #[inline(always)]
    fn sqrt(self) -> Self {
        Self(self.0.map(T::sqrt))
    }
    #[inline(always)]
    fn select_less(a: Self, b: Self, yes: Self, no: Self) -> Self {
        let mut out = no.0;
        for (o, ((a, b), yes)) in out.iter_mut().zip(a.0.into_iter().zip(b.0).zip(yes.0)) {
            *o = if a < b { yes } else { *o };
        }
        Self(out)
    }
    #[inline(always)]
    fn two_to_the(n: Self) -> Self {
        Self(n.0.map(T::two_to_the))
    }
}
