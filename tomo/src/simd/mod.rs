//! One source for every width of vector registers, chosen at run time.
//!
//! Kernels are written once, for [`Lanes`], and compiled anew inside functions that carry the
//! instruction set's `#[target_feature]`; a build for any machine therefore uses what the machine
//! at hand has.
//!
//! Private to the crate: a register of an instruction set that the machine lacks must not come into
//! being.

#[cfg(target_arch = "x86_64")]
mod avx2;
#[cfg(target_arch = "x86_64")]
mod avx512;
mod lanes;
pub mod math;
mod portable;
mod scalar;

pub use lanes::{Lanes, MAX_LANES};
#[cfg(test)]
pub use portable::Array;
pub use scalar::Float;

/// Instruction sets that kernels are compiled for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum InstructionSet {
    /// What every machine of the target has (x86-64: SSE2, no fused multiply-add).
    Portable,
    /// AVX2 and FMA.
    Avx2,
    /// AVX-512 F.
    Avx512,
}

impl InstructionSet {
    /// All of them, the widest last.
    pub const ALL: [Self; 3] = [Self::Portable, Self::Avx2, Self::Avx512];

    /// Whether this machine can run it.
    pub fn available(self) -> bool {
        match self {
            Self::Portable => true,
            #[cfg(target_arch = "x86_64")]
            Self::Avx2 => is_x86_feature_detected!("avx2") && is_x86_feature_detected!("fma"),
            #[cfg(target_arch = "x86_64")]
            Self::Avx512 => is_x86_feature_detected!("avx512f") && Self::Avx2.available(),
            #[allow(unreachable_patterns)]
            _ => false,
        }
    }

    /// The widest that this machine can run.
    pub fn best() -> Self {
        let widest = Self::ALL.into_iter().rev().find(|set| set.available());
        widest.unwrap_or(Self::Portable)
    }

    /// Numbers `T` in two registers, the width of a panel of the matrix kernels.
    pub fn panel<T: Float>(self) -> usize {
        dispatch::<T, _>(self, PanelWidth)
    }
}

struct PanelWidth;

impl<T: Float> Task<T> for PanelWidth {
    type Output = usize;
    #[inline(always)]
    fn run<V: Lanes<T>, const ROWS: usize>(self) -> usize {
        2 * V::LANES
    }
}

/// Something to be done with lanes of any width.
///
/// `run` and all that it calls must be `#[inline(always)]`, so that it is compiled anew inside each
/// function with its own instruction set.
pub trait Task<T: Float> {
    /// Result.
    type Output;
    /// Does it. `ROWS` × 2 registers of sums leave room for the operands of a matrix product.
    fn run<V: Lanes<T>, const ROWS: usize>(self) -> Self::Output;
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2,fma")]
fn run_avx2<T: Float, K: Task<T>>(task: K) -> K::Output {
    task.run::<T::Avx2, 6>()
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx512f,avx2,fma")]
fn run_avx512<T: Float, K: Task<T>>(task: K) -> K::Output {
    task.run::<T::Avx512, 12>()
}

/// Runs the task with the instruction set `set`, or with the portable one where the machine lacks it.
pub fn dispatch<T: Float, K: Task<T>>(set: InstructionSet, task: K) -> K::Output {
    #[cfg(target_arch = "x86_64")]
    {
        if set == InstructionSet::Avx512 && set.available() {
            // SAFETY: the features were just detected.
            return unsafe { run_avx512(task) };
        }
        if set == InstructionSet::Avx2 && set.available() {
            // SAFETY: the features were just detected.
            return unsafe { run_avx2(task) };
        }
    }
    task.run::<T::Portable, 6>()
}
