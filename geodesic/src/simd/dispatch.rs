//! Chooses the widest lanes that the machine has, at run time.

use super::lanes::Real;

/// Something to be done with lanes of any width.
///
/// `run` and all that it calls must be `#[inline(always)]`, so that it is
/// compiled anew inside each function with its own instruction set.
pub trait Task {
    /// Result.
    type Output;
    /// Does it.
    fn run<V: Real>(self) -> Self::Output;
}

/// Instruction sets to choose from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Width {
    /// One number at a time.
    Scalar,
    /// Two lanes, SSE2, which every x86-64 machine has.
    Sse2,
    /// Four lanes, AVX2 and FMA.
    Avx2,
    /// Eight lanes, AVX-512 F and DQ.
    Avx512,
}

impl Width {
    /// Whether this machine can run it.
    pub fn available(self) -> bool {
        match self {
            Self::Scalar => true,
            Self::Sse2 => cfg!(target_arch = "x86_64"),
            #[cfg(target_arch = "x86_64")]
            Self::Avx2 => is_x86_feature_detected!("avx2") && is_x86_feature_detected!("fma"),
            #[cfg(target_arch = "x86_64")]
            Self::Avx512 => {
                is_x86_feature_detected!("avx512f") && is_x86_feature_detected!("avx512dq")
            }
            #[allow(unreachable_patterns)]
            _ => false,
        }
    }

    /// The widest one that this machine can run.
    pub fn best() -> Self {
        let widths = [Self::Avx512, Self::Avx2, Self::Sse2];
        widths.into_iter().find(|width| width.available()).unwrap_or(Self::Scalar)
    }
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2,fma")]
fn run_avx2<T: Task>(task: T) -> T::Output {
    task.run::<super::lanes::avx2::F64x4>()
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx512f,avx512dq")]
fn run_avx512<T: Task>(task: T) -> T::Output {
    task.run::<super::lanes::avx512::F64x8>()
}

/// Runs the task at the given width, or at the next narrower one that every machine of its kind
/// has.
pub fn dispatch<T: Task>(width: Width, task: T) -> T::Output {
    #[cfg(target_arch = "x86_64")]
    {
        if width == Width::Avx512 && width.available() {
            // SAFETY: the features were just detected.
            return unsafe { run_avx512(task) };
        }
        if width == Width::Avx2 && width.available() {
            // SAFETY: the features were just detected.
            return unsafe { run_avx2(task) };
        }
        // A machine without what was asked for does what every one can.
        if width != Width::Scalar {
            return task.run::<super::lanes::sse2::F64x2>();
        }
    }
    task.run::<f64>()
}
