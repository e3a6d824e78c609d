//! The kernels of this folder's shaders, and how many workgroups they run on.

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

/// Workgroups in a row of the grid: fewer than any device allows.
pub const ROW: u32 = 32_768;

/// Arranges so many workgroups in rows.
pub fn grid(workgroups: usize) -> [u32; 2] {
    let count = workgroups as u32;
    [count.min(ROW), count.div_ceil(ROW)]
}
