//! One layer of SIMD: kernels are written once and compiled for every instruction set.
//!
//! A kernel is a [`Task`]: a function generic over [`Lanes`], a register of `f32` or `f64`.
//! [`dispatch`] runs it on the [`InstructionSet`] of choice, which is found at run time, so that a
//! build for any machine uses what the machine at hand has.
//!
//! ```
//! use kerrlight_geodesic::simd::lanes::{InstructionSet, Lanes, Task, dispatch};
//!
//! struct Norm<'a>(&'a [f64]);
//!
//! impl Task<f64> for Norm<'_> {
//!     type Output = f64;
//!
//!     #[inline(always)]
//!     fn run<V: Lanes<f64>>(self) -> f64 {
//!         let mut sum = V::splat(0.0);
//!         for x in self.0.chunks(V::LANES) {
//!             let x = V::load_or(x, 0.0);
//!             sum = x.mul_add(x, sum);
//!         }
//!         sum.sum().sqrt()
//!     }
//! }
//!
//! assert_eq!(dispatch(InstructionSet::best(), Norm(&[3.0, 4.0])), 5.0);
//! ```
//!
//! Kernels and what they call are `#[inline(always)]`, and they loop: a closure given to `map`, `fold` or
//! `from_fn` is a function of its own, compiled without the instruction set, where each intrinsic is a call.
//!
//! # Soundness
//! The register types of x86-64 have no name outside this module. Code meets them only as the type
//! parameter of [`Task::run`], which [`dispatch`] calls after it has found the instruction set: the
//! type itself is the proof, and no value of it can come into being without it.
//!
//! ```compile_fail
//! use kerrlight_geodesic::simd::lanes::x86::F64x8; // private
//! ```

mod dispatch;
mod pair;
mod portable;
mod register;
#[cfg(target_arch = "x86_64")]
mod x86;

pub use dispatch::dispatch;
pub(crate) use pair::Pair;
pub use portable::Array;
pub(crate) use register::transpose_plain;
pub use register::{CHUNK, Element, InstructionSet, Lanes, MAX_LANES, Task};

#[cfg(test)]
mod tests;
