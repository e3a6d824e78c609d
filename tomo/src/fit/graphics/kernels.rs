//! The kernels of this folder's shaders, how many workgroups they run on, and in which order.

use kerrlight_geodesic::gpu::{Bound, Commands, Compute, GpuError, Kernel};

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

/// A kernel and how many workgroups it runs on.
pub type Task = (Bound, [u32; 2]);

/// Runs kernels one after the other.
pub fn run(commands: &mut Commands, tasks: &[Task]) {
    tasks.iter().for_each(|(bound, groups)| commands.dispatch(bound, *groups));
}

/// The kernels of a block of points.
#[derive(Debug)]
pub struct Block {
    /// Emission, and its slopes.
    pub forward: Vec<Task>,
    /// The gradient.
    pub backward: Vec<Task>,
}

/// A representation on the device, block of points by block of points.
#[derive(Debug)]
pub struct Field {
    /// Points of a block.
    pub stride: usize,
    /// All blocks.
    pub blocks: Vec<Block>,
}

impl Field {
    /// Emission of so many points at most, and its slopes.
    pub fn forward(&self, commands: &mut Commands, points: usize) {
        self.used(points).for_each(|block| run(commands, &block.forward));
    }

    /// Adds the gradient of so many points at most, after [`forward`](Self::forward) and with cotangents.
    pub fn backward(&self, commands: &mut Commands, points: usize) {
        for block in self.used(points) {
            // Blocks share their memory: what all but the last have left there is gone.
            if points > self.stride {
                run(commands, &block.forward);
            }
            run(commands, &block.backward);
        }
    }

    fn used(&self, points: usize) -> impl Iterator<Item = &Block> {
        self.blocks.iter().take(points.div_ceil(self.stride))
    }
}
