//! Runs a task on an instruction set that has been found at run time.

use super::register::{Element, InstructionSet, Sealed, Task};
#[cfg(target_arch = "x86_64")]
use super::x86::{F32x4, F32x8, F32x16, F64x2, F64x4, F64x8};

/// Runs the task on the instruction set `set`, or on the portable one where the machine lacks it.
#[inline]
pub fn dispatch<T: Element, K: Task<T>>(set: InstructionSet, task: K) -> K::Output {
    T::dispatch(set, task)
}

macro_rules! element {
    ($element:ident, $rounder:literal, [$sse2:ty, $avx2:ty, $avx512:ty], else $portable:ty) => {
        impl Sealed for $element {}

        impl Element for $element {
            const ZERO: Self = 0.0;
            const ONE: Self = 1.0;
            const ROUNDER: Self = $rounder;

            #[cfg(target_arch = "x86_64")]
            fn dispatch<K: Task<Self>>(set: InstructionSet, task: K) -> K::Output {
                #[target_feature(enable = "avx2,fma")]
                fn on_avx2<K: Task<$element>>(task: K) -> K::Output {
                    task.run::<$avx2>()
                }

                #[target_feature(enable = "avx512f,avx512dq,avx2,fma")]
                fn on_avx512<K: Task<$element>>(task: K) -> K::Output {
                    task.run::<$avx512>()
                }

                match set {
                    // SAFETY: it was just detected.
                    InstructionSet::Avx512 if set.available() => unsafe { on_avx512(task) },
                    // SAFETY: it was just detected.
                    InstructionSet::Avx2 if set.available() => unsafe { on_avx2(task) },
                    #[cfg(test)]
                    InstructionSet::Scalar => task.run::<$element>(),
                    _ => task.run::<$sse2>(),
                }
            }

            #[cfg(not(target_arch = "x86_64"))]
            fn dispatch<K: Task<Self>>(_: InstructionSet, task: K) -> K::Output {
                task.run::<$portable>()
            }
        }
    };
}

element!(f32, 12_582_912.0, [F32x4, F32x8, F32x16], else super::portable::Array<f32, 4>);
// Kernels of rays are too long for the compiler to keep arrays of doubles in registers.
element!(f64, 6_755_399_441_055_744.0, [F64x2, F64x4, F64x8], else f64);
