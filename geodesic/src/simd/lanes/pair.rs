//! Two registers side by side.

use super::register::{Element, Lanes, Sealed};
use core::ops::{Add, Div, Mul, Neg, Sub};

/// Twice the lanes of `V`: every operation is issued twice in a row, which keeps the arithmetic
/// units busy while long chains wait for results.
#[derive(Clone, Copy)]
pub(crate) struct Pair<V>(V, V);

impl<V> Sealed for Pair<V> {}

macro_rules! operator {
    ($trait:ident, $method:ident) => {
        impl<V: $trait<Output = V>> $trait for Pair<V> {
            type Output = Self;
            #[inline(always)]
            fn $method(self, o: Self) -> Self {
                Self(self.0.$method(o.0), self.1.$method(o.1))
            }
        }
    };
}
operator!(Add, add);
operator!(Sub, sub);
operator!(Mul, mul);
operator!(Div, div);

impl<V: Neg<Output = V>> Neg for Pair<V> {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        Self(-self.0, -self.1)
    }
}

/// Functions of each half alone.
macro_rules! lanewise {
    ($($method:ident($($other:ident),*))*) => {$(
        #[inline(always)]
        fn $method(self, $($other: Self),*) -> Self {
            Self(self.0.$method($($other.0),*), self.1.$method($($other.1),*))
        }
    )*};
}

impl<T: Element, V: Lanes<T>> Lanes<T> for Pair<V> {
    type Mask = (V::Mask, V::Mask);
    const LANES: usize = 2 * V::LANES;
    const REGISTERS: usize = V::REGISTERS / 2;

    #[inline(always)]
    fn splat(x: T) -> Self {
        Self(V::splat(x), V::splat(x))
    }
    #[inline(always)]
    unsafe fn read(x: *const T) -> Self {
        // SAFETY: the caller vouches for both.
        unsafe { Self(V::read(x), V::read(x.add(V::LANES))) }
    }
    #[inline(always)]
    unsafe fn write(self, x: *mut T) {
        // SAFETY: the caller vouches for both.
        unsafe {
            self.0.write(x);
            self.1.write(x.add(V::LANES));
        }
    }
    lanewise!(mul_add(b, c) neg_mul_add(b, c) sqrt() recip() abs() min(o) max(o) copysign(o));
    #[inline(always)]
    fn lt(self, o: Self) -> Self::Mask {
        (self.0.lt(o.0), self.1.lt(o.1))
    }
    #[inline(always)]
    fn select(mask: Self::Mask, yes: Self, no: Self) -> Self {
        Self(V::select(mask.0, yes.0, no.0), V::select(mask.1, yes.1, no.1))
    }
    #[inline(always)]
    fn both(a: Self::Mask, b: Self::Mask) -> Self::Mask {
        (V::both(a.0, b.0), V::both(a.1, b.1))
    }
    #[inline(always)]
    fn all(mask: Self::Mask) -> bool {
        V::all(mask.0) & V::all(mask.1)
    }
    #[inline(always)]
    fn any(mask: Self::Mask) -> bool {
        V::any(mask.0) | V::any(mask.1)
    }
    #[inline(always)]
    fn split(self) -> (Self, Self) {
        let (m0, k0) = self.0.split();
        let (m1, k1) = self.1.split();
        (Self(m0, m1), Self(k0, k1))
    }
    #[inline(always)]
    fn two_to_the(n: Self) -> Self {
        Self(V::two_to_the(n.0), V::two_to_the(n.1))
    }
    #[inline(always)]
    fn transpose_into(rows: &[T], stride: usize, out: &mut [T], starts: &[usize]) {
        V::transpose_into(rows, stride, out, starts);
        let rows = rows.get(V::LANES..).unwrap_or(&[]);
        V::transpose_into(rows, stride, out, starts.get(V::LANES..).unwrap_or(&[]));
    }
}
