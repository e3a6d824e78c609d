//! Grids on the device: voxels, and features that a network turns into emission.

use super::adam::Learning;
use super::bytes::words;
use super::kernels::{self, Block, Field, Task, compiled};
use super::network::Network;
use super::pixels::Points;
use kerrlight_geodesic::gpu::{Buffer, Compute, GpuError, Kernel};

/// Numbers on the nodes of a box.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Level {
    /// Coordinates of the first node, M.
    pub low: [f32; 3],
    /// Nodes along each axis.
    pub nodes: [usize; 3],
    /// Cells a unit of length.
    pub per_length: [f32; 3],
    /// Numbers on a node.
    pub planes: usize,
    /// Start in the parameters: plane after plane.
    pub offset: usize,
}

/// Grids of several resolutions.
#[derive(Clone, Debug, PartialEq)]
pub struct Levels {
    /// The grids.
    pub all: Vec<Level>,
    /// Activation of voxels: 0 sigmoid, 1 softplus, 2 none.
    pub activation: u32,
}

/// Invocations in a row of the grid of workgroups, 64 each.
const ROW: usize = 64 * kernels::ROW as usize;
const SHADER: &str = include_str!("shaders/grid.wgsl");
const ACTIVATIONS: &str = include_str!("shaders/activations.wgsl");
const ENTRIES: [&str; 9] = [
    "voxels",
    "voxels_back",
    "features",
    "gate",
    "begin",
    "largest",
    "scatter",
    "settle",
    "places_back",
];

impl Levels {
    /// Numbers of a point.
    pub fn columns(&self) -> usize {
        self.all.iter().map(|level| level.planes).sum()
    }

    /// Parameters.
    pub fn parameters(&self) -> usize {
        self.all.iter().map(|level| level.planes * level.nodes.iter().product::<usize>()).sum()
    }

    fn uniforms(&self, device: &Compute) -> Result<Vec<Buffer>, GpuError> {
        let mut column = 0;
        let uniform = |level: &Level| {
            let Level { low, nodes, per_length, planes, offset } = *level;
            let [x, y, z] = low.map(f32::to_bits);
            let [a, b, c] = per_length.map(f32::to_bits);
            let (columns, total) = (self.columns(), self.parameters());
            let [i, j, k] = nodes.map(|n| n as u32);
            let first = [x, y, z, planes as u32, a, b, c, offset as u32];
            let then = [column as u32, columns as u32, total as u32, self.activation];
            let rest = [i, j, k, ROW as u32];
            column += planes;
            device.uniform(&words(&[&first[..], &then, &rest].concat()))
        };
        self.all.iter().map(uniform).collect()
    }

    fn kernels(&self, device: &Compute) -> Result<Vec<Kernel>, GpuError> {
        compiled(device, &[ACTIVATIONS, SHADER].join("\n"), &ENTRIES)
    }

    /// Where kernels add slopes up.
    fn sums(&self, device: &Compute) -> Result<[Buffer; 2], GpuError> {
        Ok([device.storage(4)?, device.storage(8 * self.parameters() as u64)?])
    }

    /// Voxels with an activation that read these parameters and add to this gradient; with `of_places` they find dL/dplace,
    /// too.
    ///
    /// # Errors
    /// If the device has no room, or fails.
    pub fn voxels(
        &self,
        device: &Compute,
        points: &Points,
        learning: &Learning,
        of_places: bool,
    ) -> Result<Field, GpuError> {
        let (kernels, sums) = (&self.kernels(device)?, &self.sums(device)?);
        let uniforms = &self.uniforms(device)?;
        let block = &device.uniform(&words(&[0, points.room as u32, 0, 0]))?;
        let slopes = &device.storage(4 * points.room as u64)?;
        // Kernels of voxels are not bound to rows.
        let rows = slopes;
        let binding =
            Binding { device, kernels, block, points, rows, slopes, sums, learning, of_places };
        let there = [0, 1, 2, 3, 4, 6, 7];
        let forward = vec![binding.bind(0, &uniforms[0], &there, points.room)?];
        let mut backward = vec![binding.bind(1, &uniforms[0], &[0, 1, 2, 7, 8, 9], points.room)?];
        backward.extend(binding.scattered(self, uniforms, points.room)?);
        Ok(Field { stride: points.room.max(1), blocks: vec![Block { forward, backward }] })
    }

    /// Features that read these parameters and add to this gradient, for a network that is given them; with `of_places`
    /// they find dL/dplace, too.
    ///
    /// # Errors
    /// If the device has no room, or fails.
    pub fn features(
        &self,
        device: &Compute,
        network: Network,
        points: &Points,
        learning: &Learning,
        of_places: bool,
    ) -> Result<Field, GpuError> {
        let (kernels, sums) = (&self.kernels(device)?, &self.sums(device)?);
        let uniforms = &self.uniforms(device)?;
        let Network { mut field, uniforms: blocks, rows, of_inputs } = network;
        let (rows, slopes, stride) = (&rows, &of_inputs, field.stride);
        for (tasks, block) in field.blocks.iter_mut().zip(&blocks) {
            let binding =
                Binding { device, kernels, block, points, rows, slopes, sums, learning, of_places };
            let features = uniforms
                .iter()
                .map(|level| binding.bind(2, level, &[0, 1, 2, 3, 4, 5], stride))
                .collect::<Result<Vec<Task>, GpuError>>()?;
            tasks.forward.splice(..0, features);
            tasks.forward.push(binding.bind(3, &uniforms[0], &[0, 1, 2, 3, 6, 7], stride)?);
            tasks.backward.extend(binding.scattered(self, uniforms, stride)?);
        }
        Ok(field)
    }
}

/// Buffers that kernels of a block of points are bound to.
struct Binding<'a> {
    device: &'a Compute,
    kernels: &'a [Kernel],
    block: &'a Buffer,
    points: &'a Points,
    rows: &'a Buffer,
    slopes: &'a Buffer,
    sums: &'a [Buffer; 2],
    learning: &'a Learning,
    of_places: bool,
}

impl Binding<'_> {
    fn bind(
        &self,
        entry: usize,
        level: &Buffer,
        bindings: &[u32],
        invocations: usize,
    ) -> Result<Task, GpuError> {
        let Points { places, values, bends, cotangents, extent, of_places, .. } = self.points;
        let all = [
            self.block,
            level,
            extent,
            places,
            &self.learning.parameters,
            self.rows,
            values,
            bends,
            cotangents,
            self.slopes,
            &self.sums[0],
            &self.sums[1],
            &self.learning.gradient,
            of_places,
        ];
        let buffers: Vec<_> = bindings.iter().map(|k| (*k, all[*k as usize])).collect();
        let bound = self.device.bind(&self.kernels[entry], &buffers)?;
        let rows = invocations.div_ceil(ROW).max(1);
        Ok((bound, [invocations.min(ROW).div_ceil(64) as u32, rows as u32]))
    }

    /// Adds slopes of so many points to the gradient.
    fn scattered(
        &self,
        levels: &Levels,
        uniforms: &[Buffer],
        points: usize,
    ) -> Result<Vec<Task>, GpuError> {
        let first = &uniforms[0];
        // The largest slope comes first: it sets the scale of the whole numbers that are added.
        let mut tasks =
            vec![self.bind(4, first, &[10], 1)?, self.bind(5, first, &[0, 1, 2, 9, 10], points)?];
        for level in uniforms {
            tasks.push(self.bind(6, level, &[0, 1, 2, 3, 9, 10, 11], points)?);
            if self.of_places {
                tasks.push(self.bind(8, level, &[0, 1, 2, 3, 4, 9, 13], points)?);
            }
        }
        tasks.push(self.bind(7, first, &[0, 1, 10, 11, 12], levels.parameters())?);
        Ok(tasks)
    }
}
