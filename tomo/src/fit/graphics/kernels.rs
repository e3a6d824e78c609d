//! The kernels of this folder's shaders.

use kerrlight_geodesic::gpu::{Compute, GpuError, Kernel};

/// Compiles entry points of a shader.
///
/// # Errors
/// What the compiler says.
pub fn compiled(device: &Compute, source: &str, entries: &[&str]) -> Result<Vec<Kernel>, GpuError> {
    // SAFETY: indices of these shaders are kept below what there is room for, by their own conditions or since rooms
    // are multiples of tiles; loops count up to a number that stays, or halve one.
    unsafe { device.kernels_unchecked(source, entries) }
}
