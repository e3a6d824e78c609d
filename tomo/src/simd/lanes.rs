//! The interface of a vector register.

use super::scalar::Float;
use core::ops::{Add, Div, Mul, Sub};

/// The most lanes that any register has.
pub const MAX_LANES: usize = 16;

/// Numbers side by side in one register; all operations work lane by lane.
///
/// Values of a hardware type may only come into being where its instruction set has been found
/// (see [`dispatch`](super::dispatch)).
pub trait Lanes<T: Float>:
    Copy + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self> + Div<Output = Self>
{
    /// How many.
    const LANES: usize;

    /// The same number in every lane.
    fn splat(x: T) -> Self;

    /// `LANES` numbers from memory.
    ///
    /// # Safety
    /// `x` points to that many readable numbers.
    unsafe fn load(x: *const T) -> Self;

    /// `LANES` numbers to memory.
    ///
    /// # Safety
    /// `x` points to that many writable numbers.
    unsafe fn store(self, x: *mut T);

    /// `self · b + c`, fused where the hardware fuses.
    fn mul_add(self, b: Self, c: Self) -> Self;

    /// The larger one; the second where either is NaN.
    fn max(self, other: Self) -> Self;

    /// The smaller one; the second where either is NaN.
    fn min(self, other: Self) -> Self;

    /// Square root.
    fn sqrt(self) -> Self;

    /// `yes` where `a < b`, `no` elsewhere.
    fn select_less(a: Self, b: Self, yes: Self, no: Self) -> Self;

    /// Two to the power of integers −127 < n < 128 (f32), −1023 < n < 1024 (f64).
    fn two_to_the(n: Self) -> Self;

    /// Sum of all lanes, always in the same order.
    #[inline(always)]
    fn sum(self) -> T {
        let mut lanes = [T::zero(); MAX_LANES];
        // SAFETY: no register has more than MAX_LANES lanes.
        unsafe { self.store(lanes.as_mut_ptr()) };
        let mut width = Self::LANES;
        while width > 1 {
            width /= 2;
            for k in 0..width {
                lanes[k] += lanes[k + width];
            }
        }
        lanes[0]
    }

    /// The lanes from the front of `x`; missing ones are `fill`.
    #[inline(always)]
    fn load_front(x: &[T], fill: T) -> Self {
        if x.len() >= Self::LANES {
            // SAFETY: there are enough.
            return unsafe { Self::load(x.as_ptr()) };
        }
        let mut lanes = [fill; MAX_LANES];
        for (lane, x) in lanes.iter_mut().zip(x) {
            *lane = *x;
        }
        // SAFETY: no register has more than MAX_LANES lanes.
        unsafe { Self::load(lanes.as_ptr()) }
    }

    /// The lanes to the front of `x`, as many as fit.
    #[inline(always)]
    fn store_front(self, x: &mut [T]) {
        if x.len() >= Self::LANES {
            // SAFETY: there is room.
            return unsafe { self.store(x.as_mut_ptr()) };
        }
        let mut lanes = [T::zero(); MAX_LANES];
        // SAFETY: no register has more than MAX_LANES lanes.
        unsafe { self.store(lanes.as_mut_ptr()) };
        for (x, lane) in x.iter_mut().zip(lanes) {
            *x = lane;
        }
    }
}
