//! Lanes without intrinsics, for every target.

#![allow(clippy::needless_range_loop, reason = "loops over lanes read alike and unroll")]

use super::{Real, split_scalar};
use core::ops::{Add, Div, Mul, Neg, Sub};

/// `a · b + c`, fused only where that is one instruction on every machine of the target.
#[inline(always)]
pub(super) fn fma(a: f64, b: f64, c: f64) -> f64 {
    if cfg!(any(target_arch = "aarch64", target_feature = "fma")) {
        a.mul_add(b, c)
    } else {
        a * b + c
    }
}

/// `N` lanes in a plain array; the compiler vectorises as far as the target allows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Array<const N: usize>(pub [f64; N]);

impl<const N: usize> Array<N> {
    #[inline(always)]
    fn map(self, f: impl Fn(f64) -> f64) -> Self {
        let mut out = [0.0; N];
        for i in 0..N {
            out[i] = f(self.0[i]);
        }
        Self(out)
    }
    #[inline(always)]
    fn zip(self, o: Self, f: impl Fn(f64, f64) -> f64) -> Self {
        let mut out = [0.0; N];
        for i in 0..N {
            out[i] = f(self.0[i], o.0[i]);
        }
        Self(out)
    }
}

macro_rules! operator {
    ($trait:ident, $method:ident, $op:tt) => {
        impl<const N: usize> $trait for Array<N> {
            type Output = Self;
            #[inline(always)]
            fn $method(self, o: Self) -> Self {
                self.zip(o, |a, b| a $op b)
            }
        }
    };
}
operator!(Add, add, +);
operator!(Sub, sub, -);
operator!(Mul, mul, *);
operator!(Div, div, /);

impl<const N: usize> Neg for Array<N> {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        self.map(|a| -a)
    }
}

impl<const N: usize> Real for Array<N> {
    type Mask = [bool; N];
    const LANES: usize = N;

    #[inline(always)]
    fn splat(x: f64) -> Self {
        Self([x; N])
    }
    #[inline(always)]
    fn load(x: &[f64]) -> Self {
        let last = x.last().copied().unwrap_or(0.0);
        let mut out = [last; N];
        for (o, v) in out.iter_mut().zip(x) {
            *o = *v;
        }
        Self(out)
    }
    #[inline(always)]
    fn store(self, out: &mut [f64]) {
        for (o, v) in out.iter_mut().zip(self.0) {
            *o = v;
        }
    }
    #[inline(always)]
    fn mul_add(self, b: Self, c: Self) -> Self {
        let mut out = [0.0; N];
        for i in 0..N {
            out[i] = fma(self.0[i], b.0[i], c.0[i]);
        }
        Self(out)
    }
    #[inline(always)]
    fn neg_mul_add(self, b: Self, c: Self) -> Self {
        (-self).mul_add(b, c)
    }
    #[inline(always)]
    fn sqrt(self) -> Self {
        self.map(f64::sqrt)
    }
    #[inline(always)]
    fn abs(self) -> Self {
        self.map(f64::abs)
    }
    #[inline(always)]
    fn min(self, other: Self) -> Self {
        self.zip(other, |a, b| if a < b { a } else { b })
    }
    #[inline(always)]
    fn max(self, other: Self) -> Self {
        self.zip(other, |a, b| if a > b { a } else { b })
    }
    #[inline(always)]
    fn copysign(self, sign: Self) -> Self {
        self.zip(sign, f64::copysign)
    }
    #[inline(always)]
    fn lt(self, other: Self) -> Self::Mask {
        let mut out = [false; N];
        for i in 0..N {
            out[i] = self.0[i] < other.0[i];
        }
        out
    }
    #[inline(always)]
    fn select(mask: Self::Mask, yes: Self, no: Self) -> Self {
        let mut out = [0.0; N];
        for i in 0..N {
            out[i] = if mask[i] { yes.0[i] } else { no.0[i] };
        }
        Self(out)
    }
    #[inline(always)]
    fn both(a: Self::Mask, b: Self::Mask) -> Self::Mask {
        let mut out = [false; N];
        for i in 0..N {
            out[i] = a[i] & b[i];
        }
        out
    }
    #[inline(always)]
    fn all(mask: Self::Mask) -> bool {
        !mask.contains(&false)
    }
    #[inline(always)]
    fn any(mask: Self::Mask) -> bool {
        mask.contains(&true)
    }
    #[inline(always)]
    fn split(self) -> (Self, Self) {
        let mut m = [0.0; N];
        let mut k = [0.0; N];
        for i in 0..N {
            (m[i], k[i]) = split_scalar(self.0[i]);
        }
        (Self(m), Self(k))
    }
}
