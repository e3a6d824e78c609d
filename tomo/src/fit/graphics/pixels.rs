//! Kernels from nodes on the device to points of a batch, and from their emission to pixels, residuals and back.

use super::axis::AxisSlope;
use super::bytes::{floats, read, words};
use super::fall::{FallTable, of_node};
use super::kernels::{ROW, compiled, grid};
use crate::fit::forward::forward_model::ForwardModel;
use kerrlight_geodesic::gpu::{Bound, Buffer, Commands, Compute, GpuError};
use kerrlight_geodesic::wgsl;

/// Capacity of a device.
#[derive(Clone, Copy, Debug)]
pub struct Room {
    /// Nodes of all rays.
    pub nodes: usize,
    /// (ray, frame) pairs at a time.
    pub pairs: usize,
    /// Their nodes.
    pub points: usize,
    /// Cells of the mask along each axis; 0 without one.
    pub cells: usize,
    /// Steps whose losses are kept.
    pub records: usize,
    /// If the axis is learnt: whether weights depend on it.
    pub axis: Option<bool>,
}

/// A node as shaders see it.
#[derive(Clone, Copy, Debug)]
pub struct Node {
    /// x, y, z, M.
    pub place: [f32; 3],
    /// Weight of emission in its pixel.
    pub weight: f32,
    /// Angle that it is turned by in a unit of time, that of its delay, the delay and nothing; where matter falls, what
    /// [`of_node`] says of it about the delay.
    pub motion: [f32; 4],
}

/// All nodes of a forward model; whether a field is `carried` by matter, that may fall.
pub fn nodes(model: &ForwardModel<f32>, is_carried: bool) -> impl Iterator<Item = Node> {
    let origins = model.fall.as_ref().filter(|_| is_carried).map(|fall| fall.parts().1);
    let motion = move |k: usize| {
        let delay = model.delay.get(k).copied().unwrap_or(0.0);
        let Some(origins) = origins else {
            return [model.rate[k], model.phase.get(k).copied().unwrap_or(0.0), delay, 0.0];
        };
        let [high, low, azimuth] = of_node(&origins[k]);
        [high, low, delay, azimuth]
    };
    (0..model.points()).map(move |k| Node {
        place: [0, 1, 2].map(|c| model.position[c][k]),
        weight: model.weight[k],
        motion: motion(k),
    })
}

/// A ray in a frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pair {
    /// Its nodes.
    pub nodes: [u32; 2],
    /// Time of the frame since the reference time, M.
    pub time: f32,
    /// The pixel in the data; 0 where residuals are made elsewhere.
    pub datum: f32,
}

/// Gathering of pairs into points.
#[derive(Clone, Copy, Debug, Default)]
pub struct Gathering {
    /// The axis that matter turns about.
    pub axis: [f32; 3],
    /// Nothing shines before, M since the reference time.
    pub earliest: Option<f32>,
    /// Cells and half the width (M) of the mask, if it is used.
    pub mask: Option<(u32, f32)>,
    /// True if the field is one of places and times of emission.
    pub events: bool,
    /// dL/dpixel of a residual of 1.
    pub slope: f32,
    /// The record that squares and points are added to.
    pub record: u32,
}

/// Points of a batch; fields read places and cotangents, and write values and slopes.
#[derive(Debug)]
pub struct Points {
    /// x, y, z and t.
    pub places: Buffer,
    /// Emission.
    pub values: Buffer,
    /// Slopes of the last function.
    pub bends: Buffer,
    /// dL/demission.
    pub cotangents: Buffer,
    /// Number of points: known to the device alone.
    pub extent: Buffer,
    /// If the axis is learnt, dL/dplace, which fields write.
    pub of_places: Buffer,
    /// Largest number of points.
    pub room: usize,
}

/// The kernels about pixels, and what they work on.
#[derive(Debug)]
pub struct Pixels {
    /// The points.
    pub points: Points,
    /// Slope with the axis, where it is learnt.
    pub axis: Option<AxisSlope>,
    task: Buffer,
    nodes: Buffer,
    pairs: Buffer,
    mask: Buffer,
    fall: Option<FallTable>,
    /// Light of pairs.
    pub fluxes: Buffer,
    /// dL/dpixel of pairs.
    pub slopes: Buffer,
    /// Records: sums of squares, and points.
    pub records: Buffer,
    forward: [Bound; 3],
    sums: [Bound; 2],
    spread: Bound,
}

const SHADER: &str = include_str!("shaders/gather.wgsl");
const ENTRIES: [&str; 6] = ["count", "scan", "collect", "sum_rays", "tally", "spread"];

impl Pixels {
    /// Room, and nothing in it.
    ///
    /// # Errors
    /// If the device has no room, or fails.
    pub fn new(device: &Compute, room: Room, fall: Option<FallTable>) -> Result<Self, GpuError> {
        let table = fall.as_ref().map_or(&[][..], |fall| &fall.numbers);
        let all = buffers(device, room, table.len())?;
        device.write(&all[15], &floats(table))?;
        let source = [wgsl::FUNCTIONS, SHADER].join("\n");
        let kernels = compiled(device, &source, &ENTRIES)?;
        let bind = |entry: usize, bindings: &[u32]| {
            let buffers: Vec<_> = bindings.iter().map(|k| (*k, &all[*k as usize])).collect();
            device.bind(&kernels[entry], &buffers)
        };
        let forward = [
            bind(0, &[0, 1, 2, 3, 4, 15])?,
            bind(1, &[0, 4, 5, 14])?,
            bind(2, &[0, 1, 2, 3, 5, 6, 7, 15, 16])?,
        ];
        let sums = [bind(3, &[0, 2, 5, 7, 8, 9, 10, 11])?, bind(4, &[0, 10, 13, 14])?];
        let spread = bind(5, &[0, 5, 7, 11, 12])?;
        let bends = device.storage(4 * room.points as u64)?;
        let of_places = device.storage(room.axis.map_or(0, |_| 16 * room.points as u64))?;
        let axis = room.axis.map(|is_shifted| {
            let nodes = is_shifted.then_some(room.nodes);
            AxisSlope::new(device, &source, &all, &of_places, room.pairs, nodes)
        });
        let axis = axis.transpose()?;
        let [task, nodes, pairs, mask, _, _, places, _, values, fluxes, _, slopes, rest @ ..] = all;
        let [cotangents, records, extent, _, _] = rest;
        let points =
            Points { places, values, bends, cotangents, extent, of_places, room: room.points };
        Ok(Self {
            points,
            axis,
            task,
            nodes,
            pairs,
            mask,
            fall,
            fluxes,
            slopes,
            records,
            forward,
            sums,
            spread,
        })
    }

    /// Puts the nodes of all rays there.
    ///
    /// # Errors
    /// If the device fails.
    pub fn load(
        &self,
        device: &Compute,
        nodes: impl Iterator<Item = Node>,
    ) -> Result<(), GpuError> {
        let numbers = nodes.flat_map(|Node { place: [x, y, z], weight, motion }| {
            let [a, b, c, d] = motion;
            [x, y, z, weight, a, b, c, d]
        });
        device.write(&self.nodes, &floats(&numbers.collect::<Vec<f32>>()))
    }

    /// Puts the mask there: a bit a cell.
    ///
    /// # Errors
    /// If the device fails.
    pub fn load_mask(
        &self,
        device: &Compute,
        cells: impl Iterator<Item = bool>,
    ) -> Result<(), GpuError> {
        let mut bits: Vec<u32> = Vec::new();
        for (k, lit) in cells.enumerate() {
            if k % 32 == 0 {
                bits.push(0);
            }
            bits[k / 32] |= u32::from(lit) << (k % 32);
        }
        device.write(&self.mask, &words(&bits))
    }

    /// Puts the pairs of what runs next there.
    ///
    /// # Errors
    /// If the device fails.
    pub fn set(&self, device: &Compute, pairs: &[Pair], how: &Gathering) -> Result<(), GpuError> {
        let each = |p: &Pair| [p.nodes[0], p.nodes[1], p.time.to_bits(), p.datum.to_bits()];
        device.write(&self.pairs, &words(&pairs.iter().flat_map(each).collect::<Vec<u32>>()))?;
        let [x, y, z] = how.axis.map(f32::to_bits);
        let flag = |set: bool, flag: u32| if set { flag } else { 0 };
        let flags = flag(how.earliest.is_some(), 1)
            | flag(how.mask.is_some(), 2)
            | flag(how.events, 4)
            | flag(self.fall.is_some(), 8)
            | flag(self.axis.is_some(), 16);
        let (falling, [least, largest]) =
            self.fall.as_ref().map_or((0, [0.0; 2]), |fall| (fall.cells as u32, fall.limits));
        // Not used without its flag, but nothing may be divided by 0.
        let (cells, half) = how.mask.unwrap_or((1, 1.0));
        let per_length = cells as f32 / (2.0 * half);
        let task = [
            [x, y, z, how.earliest.unwrap_or(0.0).to_bits()],
            [pairs.len() as u32, flags, cells, half.to_bits()],
            [per_length.to_bits(), how.slope.to_bits(), ROW, how.record],
            [falling, least.to_bits(), largest.to_bits(), 0],
        ];
        device.write(&self.task, &words(task.as_flattened()))
    }

    /// Gathers so many pairs into points.
    pub fn gather(&self, commands: &mut Commands, pairs: usize) {
        let [count, scan, collect] = &self.forward;
        commands.dispatch(count, grid(pairs));
        commands.dispatch(scan, [1, 1]);
        commands.dispatch(collect, grid(pairs));
    }

    /// Sums emission into pixels, and the squares of their residuals.
    pub fn sum(&self, commands: &mut Commands, pairs: usize) {
        commands.dispatch(&self.sums[0], grid(pairs));
        commands.dispatch(&self.sums[1], [1, 1]);
    }

    /// Spreads dL/dpixel to dL/demission.
    pub fn spread(&self, commands: &mut Commands, pairs: usize) {
        commands.dispatch(&self.spread, grid(pairs));
    }

    /// Light of so many pairs.
    ///
    /// # Errors
    /// If the device fails.
    pub fn fluxes(&self, device: &Compute, pairs: usize) -> Result<Vec<f32>, GpuError> {
        let mut fluxes = device.read_as(&[&self.fluxes], read)?.pop().unwrap_or_default();
        fluxes.truncate(pairs);
        Ok(fluxes)
    }

    /// Puts dL/dpixel of each pair there.
    ///
    /// # Errors
    /// If the device fails.
    pub fn set_slopes(&self, device: &Compute, slopes: &[f32]) -> Result<(), GpuError> {
        device.write(&self.slopes, &floats(slopes))
    }

    /// Forgets the records.
    pub fn forget(&self, commands: &mut Commands) {
        commands.clear(&self.records);
    }
}

/// The buffers of all bindings, in their order.
fn buffers(device: &Compute, room: Room, of_fall: usize) -> Result<[Buffer; 17], GpuError> {
    let Room { nodes, pairs, points, cells, records, axis } = room;
    let storage = |bytes: usize| device.storage(bytes as u64);
    let of_pairs = || storage(4 * pairs);
    Ok([
        device.uniform(&[0; 64])?,
        storage(32 * nodes)?,
        storage(16 * pairs)?,
        storage(4 * cells.pow(3).div_ceil(32))?,
        of_pairs()?,
        storage(4 * (pairs + 1))?,
        storage(16 * points)?,
        storage(4 * points)?,
        storage(4 * points)?,
        of_pairs()?,
        of_pairs()?,
        of_pairs()?,
        storage(4 * points)?,
        storage(8 * records)?,
        storage(4)?,
        storage(4 * of_fall)?,
        storage(axis.map_or(0, |_| 4 * points))?,
    ])
}
