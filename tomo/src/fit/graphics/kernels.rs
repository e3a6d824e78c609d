//! The kernels of this folder's shaders.

use kerrlight_geodesic::gpu::{Compute, GpuError, Kernel};

/// Compiles entry points of a shader.
///
/// # Errors
/// What the compiler says.
pub fn compiled(device: &Compute, source: &str, entries: &[&str]) -> Result<Vec<Kernel>, GpuError> {
    // SAFETY: loops of these shaders count up to a number that stays, or halve one.
    unsafe { device.kernels_whose_loops_end(source, entries) }
}
