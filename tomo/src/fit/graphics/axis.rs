//! The slope of the loss along the axis that matter turns about, where that is learnt.

use super::bytes::{floats, read};
use super::kernels::{compiled, grid};
use kerrlight_geodesic::gpu::{Bound, Buffer, Commands, Compute, GpuError};

const SHADER: &str = include_str!("shaders/axis.wgsl");
const ENTRIES: [&str; 3] = ["turned_back", "weighed_back", "add_axis"];

/// Its kernels and memory.
#[derive(Debug)]
pub struct AxisSlope {
    of_weights: Option<Buffer>,
    sum: Buffer,
    tasks: [Bound; 3],
}

impl AxisSlope {
    /// Appends to the text of a shader and its bindings; so many pairs, and so many nodes if their weights depend on the
    /// axis.
    ///
    /// # Errors
    /// If the device has no room, or fails.
    pub fn new(
        device: &Compute,
        text: &str,
        bindings: &[Buffer],
        of_places: &Buffer,
        pairs: usize,
        nodes: Option<usize>,
    ) -> Result<Self, GpuError> {
        let kernels = compiled(device, &[text, SHADER].join("\n"), &ENTRIES)?;
        let of_pairs = device.storage(16 * pairs as u64)?;
        let of_weights = device.storage(16 * nodes.unwrap_or(0) as u64)?;
        let sum = device.storage(16)?;
        let bind = |entry: usize, numbers: &[u32]| {
            let buffer = |k: u32| match k {
                17 => of_places,
                18 => &of_pairs,
                19 => &of_weights,
                20 => &sum,
                _ => &bindings[k as usize],
            };
            let buffers: Vec<_> = numbers.iter().map(|k| (*k, buffer(*k))).collect();
            device.bind(&kernels[entry], &buffers)
        };
        let tasks = [
            bind(0, &[0, 1, 2, 5, 15, 16, 17, 18])?,
            bind(1, &[0, 5, 8, 11, 16, 18, 19])?,
            bind(2, &[0, 18, 20])?,
        ];
        Ok(Self { of_weights: nodes.map(|_| of_weights), sum, tasks })
    }

    /// Puts slopes of the nodes' weights there.
    ///
    /// # Errors
    /// If the device fails.
    pub fn load(&self, device: &Compute, slopes: &[[f32; 4]]) -> Result<(), GpuError> {
        let Some(of_weights) = &self.of_weights else { return Ok(()) };
        device.write(of_weights, &floats(slopes.as_flattened()))
    }

    /// Prepares a step.
    pub fn begin(&self, commands: &mut Commands) {
        commands.clear(&self.sum);
    }

    /// Adds the slope of so many pairs, whose points have theirs.
    pub fn add(&self, commands: &mut Commands, pairs: usize) {
        let [turned, weighed, all] = &self.tasks;
        commands.dispatch(turned, grid(pairs));
        if self.of_weights.is_some() {
            commands.dispatch(weighed, grid(pairs));
        }
        commands.dispatch(all, [1, 1]);
    }

    /// The sum since the last [`begin`](Self::begin), in the space around the sphere.
    ///
    /// # Errors
    /// If the device fails.
    pub fn sum(&self, device: &Compute) -> Result<[f64; 3], GpuError> {
        let sum = device.read_as(&[&self.sum], read)?.pop().unwrap_or_default();
        Ok([0, 1, 2].map(|k| sum.get(k).copied().map_or(0.0, f64::from)))
    }
}
