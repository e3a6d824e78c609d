//! Rays on a graphics device (feature `wgpu`): the shaders of [`wgsl`](crate::wgsl), run through Vulkan, Metal or
//! DirectX 12.
//!
//! A software device serves as well, for tests: Mesa's llvmpipe, in the package `mesa-vulkan-drivers` of Debian, Ubuntu
//! and Fedora. It is slower than the rest of this crate on the same processor.

mod bytes;
mod compute;
mod device;
mod error;
mod kernel;
mod paths;
mod sums;
mod times;
mod tracer;

pub use compute::{Bound, Buffer, Commands, Compute, Kernel};
pub use device::{Adapter, Needs, adapter, adapters};
pub use error::GpuError;
pub use times::KernelTime;
pub use tracer::GpuTracer;
