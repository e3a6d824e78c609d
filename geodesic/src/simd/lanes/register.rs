//! The interface of a vector register, and of what runs on it.

use core::fmt::Debug;
use core::ops::{Add, Div, Mul, Neg, Sub};

/// The most lanes that any register has.
pub const MAX_LANES: usize = 16;

/// Rows of [`Lanes::transpose_into`].
pub const CHUNK: usize = 8;

/// Implemented in this crate alone.
pub trait Sealed {}

/// Instruction sets that kernels are compiled for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum InstructionSet {
    /// One number at a time: what [`Portable`](Self::Portable) is without SSE2.
    #[cfg(test)]
    Scalar,
    /// The instruction set that every machine of the target has: SSE2 on x86-64, without fused
    /// multiply-add.
    Portable,
    /// AVX2 and FMA.
    Avx2,
    /// AVX-512 F and DQ.
    Avx512,
}

impl InstructionSet {
    /// All of them, the widest last.
    pub const ALL: [Self; 3] = [Self::Portable, Self::Avx2, Self::Avx512];

    /// Returns whether this machine supports it.
    pub fn available(self) -> bool {
        match self {
            #[cfg(test)]
            Self::Scalar => true,
            Self::Portable => true,
            #[cfg(target_arch = "x86_64")]
            Self::Avx2 => is_x86_feature_detected!("avx2") && is_x86_feature_detected!("fma"),
            #[cfg(target_arch = "x86_64")]
            Self::Avx512 => {
                is_x86_feature_detected!("avx512f")
                    && is_x86_feature_detected!("avx512dq")
                    && Self::Avx2.available()
            }
            #[cfg(not(target_arch = "x86_64"))]
            _ => false,
        }
    }

    /// The widest that this machine supports.
    pub fn best() -> Self {
        let widest = Self::ALL.into_iter().rev().find(|set| set.available());
        widest.unwrap_or(Self::Portable)
    }
}

/// A number that registers hold: `f32` or `f64`.
pub trait Element:
    Copy
    + Debug
    + PartialOrd
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
    + Neg<Output = Self>
    + Sealed
    + 'static
{
    /// Zero.
    const ZERO: Self;
    /// One.
    const ONE: Self;
    /// Adding and subtracting this rounds to the nearest integer: 3·2^(mantissa bits − 1).
    const ROUNDER: Self;

    /// Runs a task as [`dispatch`](super::dispatch()) does.
    #[doc(hidden)]
    fn dispatch<K: Task<Self>>(set: InstructionSet, task: K) -> K::Output;
}

/// Something to be done with lanes of any width.
///
/// `run` and all that it calls must be `#[inline(always)]`, so that it is compiled anew for each
/// instruction set. A closure that the compiler does not inline lacks the instruction set: keep those
/// that handle lanes small.
pub trait Task<T: Element> {
    /// Result.
    type Output;
    /// Does it.
    fn run<V: Lanes<T>>(self) -> Self::Output;
}

/// Numbers side by side in one register; all operations work lane by lane.
pub trait Lanes<T: Element>:
    Copy
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
    + Neg<Output = Self>
    + Sealed
{
    /// Result of a comparison.
    type Mask: Copy;

    /// Number of lanes, at most [`MAX_LANES`].
    const LANES: usize;

    /// Registers of this kind that a kernel can count on.
    const REGISTERS: usize = 16;

    /// The same number in every lane.
    fn splat(x: T) -> Self;

    /// `LANES` numbers from memory.
    ///
    /// # Safety
    /// `x` points to that many readable numbers.
    unsafe fn read(x: *const T) -> Self;

    /// `LANES` numbers to memory.
    ///
    /// # Safety
    /// `x` points to that many writable numbers.
    unsafe fn write(self, x: *mut T);

    /// `self · b + c`, fused where the hardware fuses and a product followed by a sum elsewhere.
    fn mul_add(self, b: Self, c: Self) -> Self;

    /// `c − self · b`, as [`mul_add`](Self::mul_add).
    fn neg_mul_add(self, b: Self, c: Self) -> Self;

    /// Square root.
    fn sqrt(self) -> Self;

    /// `1 / self`, to about one unit in the last place.
    #[inline(always)]
    fn recip(self) -> Self {
        Self::splat(T::ONE) / self
    }

    /// Absolute value.
    fn abs(self) -> Self;

    /// The smaller one; the second where either is NaN.
    fn min(self, other: Self) -> Self;

    /// The larger one; the second where either is NaN.
    fn max(self, other: Self) -> Self;

    /// Magnitude of `self`, sign of `sign`.
    fn copysign(self, sign: Self) -> Self;

    /// `self < other`, false for NaN.
    fn lt(self, other: Self) -> Self::Mask;

    /// `yes` where the mask holds, `no` elsewhere.
    fn select(mask: Self::Mask, yes: Self, no: Self) -> Self;

    /// Both masks.
    fn both(a: Self::Mask, b: Self::Mask) -> Self::Mask;

    /// Returns whether the mask holds in some lane.
    fn any(mask: Self::Mask) -> bool;

    /// Returns whether the mask holds in all lanes.
    fn all(mask: Self::Mask) -> bool;

    /// Splits positive normal numbers: `(m, k)` with `self = m · 2^k`, `√½ ≤ m < √2`, `k` integer.
    fn split(self) -> (Self, Self);

    /// Two to the power of integers −127 < n < 128 (f32), −1023 < n < 1024 (f64).
    fn two_to_the(n: Self) -> Self;

    /// Lanes from the front of `x`; missing ones repeat the last entry (or are zero).
    #[inline(always)]
    fn load(x: &[T]) -> Self {
        Self::load_or(x, x.last().copied().unwrap_or(T::ZERO))
    }

    /// Lanes from the front of `x`; missing ones are `fill`.
    #[inline(always)]
    fn load_or(x: &[T], fill: T) -> Self {
        const { assert!(Self::LANES <= MAX_LANES) };
        if x.len() >= Self::LANES {
            // SAFETY: there are enough.
            return unsafe { Self::read(x.as_ptr()) };
        }
        load_few(x, fill)
    }

    /// Lanes to the front of `out`, as many as fit.
    #[inline(always)]
    fn store(self, out: &mut [T]) {
        if out.len() >= Self::LANES {
            // SAFETY: there is room.
            return unsafe { self.write(out.as_mut_ptr()) };
        }
        store_few(&self, out);
    }

    /// The lanes, and zeros behind them.
    #[inline(always)]
    fn lanes(self) -> [T; MAX_LANES] {
        const { assert!(Self::LANES <= MAX_LANES) };
        let mut lanes = [T::ZERO; MAX_LANES];
        // SAFETY: no register has more than MAX_LANES lanes.
        unsafe { self.write(lanes.as_mut_ptr()) };
        lanes
    }

    /// Sum of all lanes, always in the same order.
    #[inline(always)]
    fn sum(self) -> T {
        let mut lanes = self.lanes();
        let mut width = Self::LANES;
        while width > 1 {
            width /= 2;
            for k in 0..width {
                lanes[k] = lanes[k] + lanes[k + width];
            }
        }
        lanes[0]
    }

    /// Transposes [`CHUNK`] stored registers: number `l` of row `s`, at `rows[s · stride + l]`, goes
    /// to `out[starts[l] + s]`. Lanes that would leave `out` may be dropped.
    #[inline(always)]
    fn transpose_into(rows: &[T], stride: usize, out: &mut [T], starts: &[usize]) {
        transpose_plain(rows, stride, CHUNK, out, starts.get(..Self::LANES).unwrap_or(&[]));
    }
}

/// [`Lanes::load_or`] of fewer numbers than there are lanes. Out of the way of kernels.
#[cold]
#[inline(never)]
fn load_few<T: Element, V: Lanes<T>>(x: &[T], fill: T) -> V {
    let mut lanes = [fill; MAX_LANES];
    for (lane, x) in lanes.iter_mut().zip(x) {
        *lane = *x;
    }
    // SAFETY: no register has more than MAX_LANES lanes.
    unsafe { V::read(lanes.as_ptr()) }
}

/// [`Lanes::store`] to fewer places than there are lanes.
#[cold]
#[inline(never)]
fn store_few<T: Element, V: Lanes<T>>(lanes: &V, out: &mut [T]) {
    for (out, lane) in out.iter_mut().zip(lanes.lanes()) {
        *out = lane;
    }
}

/// A transposition of any number of rows, one column for each of `starts`.
#[inline(always)]
pub(crate) fn transpose_plain<T: Copy>(
    rows: &[T],
    stride: usize,
    count: usize,
    out: &mut [T],
    starts: &[usize],
) {
    for (s, row) in rows.chunks(stride).take(count).enumerate() {
        for (x, start) in row.iter().zip(starts) {
            if let Some(slot) = out.get_mut(start + s) {
                *slot = *x;
            }
        }
    }
}
