//! A fully connected network on the device, block of points by block of points.

use super::adam::Learning;
use super::bytes::words;
use super::kernels::{Block, Field, Task, compiled};
use super::pixels::Points;
use super::shape::{Front, Layer, Shape, Tiling};
use kerrlight_geodesic::gpu::{Bound, Buffer, Compute, GpuError, Kernel};
use kerrlight_geodesic::wgsl;

/// Points of spans: those of the shader.
const SPAN: usize = 512;
/// A multiple of the points of all tiles.
const GRAIN: usize = 256;
/// The most points of a block.
const BLOCK: usize = 1 << 16;

const SHADER: &str = include_str!("shaders/network.wgsl");
const ACTIVATIONS: &str = include_str!("shaders/activations.wgsl");
const ENTRIES: [&str; 9] = [
    "encode",
    "forward",
    "emit",
    "emit_back",
    "emit_weights",
    "weights_back",
    "units_back",
    "add_up",
    "encode_back",
];

/// A network, with what those kernels are bound to that give it its inputs.
#[derive(Debug)]
pub struct Network {
    /// Its blocks.
    pub field: Field,
    /// The points of each block.
    pub uniforms: Vec<Buffer>,
    /// Activations, of all blocks by turns.
    pub rows: Buffer,
    /// Slopes of given inputs.
    pub of_inputs: Buffer,
}

/// Buffers that all blocks share.
#[derive(Debug)]
struct Memory {
    encoding: Buffer,
    layers: Vec<Buffer>,
    /// Activations.
    rows: Buffer,
    /// Slopes of what a layer gives and takes, by turns.
    slopes: [Buffer; 2],
    parts: Buffer,
    /// If slopes of places are wanted: what a layer takes of the encoded point behind units, and its slopes.
    behind_units: Option<(Buffer, Buffer)>,
}

/// Buffers that kernels are bound to, and where.
struct Binding<'a> {
    device: &'a Compute,
    kernels: &'a [Kernel],
    block: &'a Buffer,
    memory: &'a Memory,
    points: &'a Points,
    learning: &'a Learning,
}

impl Network {
    /// A network that reads these parameters and adds to this gradient; `most` is the most points of a block, if fewer
    /// than usual. With `of_places` it finds dL/dplace of encoded points, too.
    ///
    /// # Errors
    /// If the device has no room, or fails.
    pub fn new(
        device: &Compute,
        shape: &Shape,
        points: &Points,
        learning: &Learning,
        most: Option<usize>,
        of_places: bool,
    ) -> Result<Self, GpuError> {
        // Activations of a block lie in one buffer, in whole tiles, as kernels write them.
        let fits = device.largest_buffer() as usize / (4 * shape.columns()) / GRAIN * GRAIN;
        if fits == 0 {
            return Err(GpuError::OutOfMemory { bytes: 4 * (shape.columns() * GRAIN) as u64 });
        }
        let wanted = most.unwrap_or(BLOCK).min(points.room).next_multiple_of(GRAIN);
        let stride = wanted.min(fits);
        let constants = Tiling::of(shape.width).constants();
        let source = [&constants, wgsl::FUNCTIONS, ACTIVATIONS, SHADER].join("\n");
        let kernels = compiled(device, &source, &ENTRIES)?;
        let memory = Memory::new(device, shape, stride, of_places)?;
        let count = shape.parameters();
        let (mut blocks, mut uniforms) = (Vec::new(), Vec::new());
        for k in 0..points.room.div_ceil(stride).max(1) {
            let numbers = [k * stride, stride, shape.start, count].map(|x| x as u32);
            let block = device.uniform(&words(&numbers))?;
            let (kernels, memory) = (&kernels[..], &memory);
            let binding = Binding { device, kernels, block: &block, memory, points, learning };
            let forward = binding.forward(shape, stride)?;
            let backward = binding.backward(shape, stride)?;
            blocks.push(Block { forward, backward });
            uniforms.push(block);
        }
        let Memory { rows, slopes: [even, odd], .. } = memory;
        // Slopes change buffers at every layer.
        let of_inputs = if shape.hidden.is_multiple_of(2) { even } else { odd };
        Ok(Self { field: Field { stride, blocks }, uniforms, rows, of_inputs })
    }
}

impl Memory {
    fn new(
        device: &Compute,
        shape: &Shape,
        stride: usize,
        of_places: bool,
    ) -> Result<Self, GpuError> {
        let storage = |numbers: usize| device.storage(4 * numbers as u64);
        let (scales, dimension, degree) = match shape.front {
            Front::Encoded { scales, dimension, degree } => (scales, dimension, degree),
            Front::Given(_) => ([0.0; 4], 0, 0),
        };
        let [x, y, z, t] = scales.map(f32::to_bits);
        let (dimension, degree) = (dimension as u32, degree as u32);
        let skips = u32::from(shape.skip.is_some());
        let encoding = device.uniform(&words(&[x, y, z, t, dimension, degree, skips, 0]))?;
        let layers = shape.layers();
        let behind_units = (of_places && !shape.is_given()).then(|| {
            let layer = layers[shape.skip.unwrap_or(0)].of_encoded(shape.encoded());
            let room = if shape.skip.is_some() { shape.encoded() * stride } else { 0 };
            Ok((uniform(device, shape, layer, true)?, storage(room)?))
        });
        let layers = layers.into_iter().enumerate();
        let layers = layers.map(|(k, layer)| uniform(device, shape, layer, k == 0));
        let widest = shape.width.max(shape.encoded()) * stride;
        Ok(Self {
            encoding,
            layers: layers.collect::<Result<_, _>>()?,
            rows: storage(shape.columns() * stride)?,
            slopes: [storage(widest)?, storage(widest)?],
            // A sum for each span of points, added up in order: the same bytes whoever is first.
            parts: storage(shape.parameters() * stride.div_ceil(SPAN))?,
            behind_units: behind_units.transpose()?,
        })
    }
}

/// A layer as the shader sees it; `open`: what is before it is not rectified.
fn uniform(device: &Compute, shape: &Shape, layer: Layer, open: bool) -> Result<Buffer, GpuError> {
    let Layer { base, units, tail, inputs, outputs, into, offset } = layer;
    let numbers = [base, units, tail, inputs, outputs, into, offset].map(|x| x as u32);
    let rest = [shape.activation, shape.shift.to_bits(), u32::from(open), 0, 0];
    device.uniform(&words(&[&numbers[..], &rest].concat()))
}

impl Binding<'_> {
    fn forward(&self, shape: &Shape, stride: usize) -> Result<Vec<Task>, GpuError> {
        let (layers, tiling) = (shape.layers(), Tiling::of(shape.width));
        let by_64 = stride.div_ceil(64) as u32;
        let mut tasks = Vec::new();
        if !shape.is_given() {
            tasks.push((self.bind(0, 0, 0, &[0, 2, 3, 4, 6])?, [by_64, 1]));
        }
        for (k, layer) in layers[..shape.hidden].iter().enumerate() {
            let groups = [tiling.left(stride), tiling.right(layer.outputs)];
            tasks.push((self.bind(1, k, 0, &[0, 1, 3, 5, 6])?, groups));
        }
        let output = self.bind(2, shape.hidden, 0, &[0, 1, 3, 5, 6, 7, 8])?;
        tasks.push((output, [by_64, 1]));
        Ok(tasks)
    }

    fn backward(&self, shape: &Shape, stride: usize) -> Result<Vec<Task>, GpuError> {
        let (layers, last, tiling) = (shape.layers(), shape.hidden, Tiling::of(shape.width));
        let (output, spans) = (layers[last], stride.div_ceil(SPAN) as u32);
        let to_units = [stride.div_ceil(4 * 64) as u32, output.units as u32];
        let mut tasks = vec![
            (self.bind(3, last, 0, &[0, 1, 3, 5, 6, 8, 9, 10])?, to_units),
            (self.bind(4, last, 0, &[0, 1, 3, 6, 8, 9, 12])?, [output.inputs as u32, spans]),
        ];
        tasks.extend(self.encoded_behind_units(shape, last, 0, stride)?);
        for (turn, (k, layer)) in layers[..last].iter().enumerate().rev().enumerate() {
            let tiles = tiling.right(layer.outputs) * tiling.left(layer.inputs - 1);
            tasks.push((self.bind(5, k, turn, &[0, 1, 3, 6, 10, 12])?, [tiles, spans]));
            // Slopes before the first layer serve given inputs, or places.
            if k > 0 || shape.is_given() || self.memory.behind_units.is_some() {
                let groups = [tiling.left(stride), tiling.right(layer.units)];
                tasks.push((self.bind(6, k, turn, &[0, 1, 3, 5, 6, 10, 11])?, groups));
            }
            tasks.extend(self.encoded_behind_units(shape, k, turn, stride)?);
        }
        tasks.extend(self.places(stride, last)?);
        tasks.push((self.add_up()?, [shape.parameters().div_ceil(64) as u32, 1]));
        Ok(tasks)
    }

    /// Slopes of the encoded point that this layer takes behind units, if it does and those of places are wanted.
    fn encoded_behind_units(
        &self,
        shape: &Shape,
        k: usize,
        turn: usize,
        stride: usize,
    ) -> Result<Option<Task>, GpuError> {
        let Self { device, kernels, block, points, learning, memory, .. } = self;
        let Points { bends, cotangents, extent, .. } = points;
        let parameters = &learning.parameters;
        let (rows, encoded) = (&memory.rows, shape.encoded());
        let Some((layer, slopes)) = memory.behind_units.as_ref().filter(|_| shape.skip == Some(k))
        else {
            return Ok(None);
        };
        if k == shape.hidden {
            let buffers = [block, layer, extent, parameters, rows, bends, cotangents, slopes];
            let bindings: Vec<_> = [0, 1, 3, 5, 6, 8, 9, 10].into_iter().zip(buffers).collect();
            let groups = [stride.div_ceil(4 * 64) as u32, encoded as u32];
            return Ok(Some((device.bind(&kernels[3], &bindings)?, groups)));
        }
        let [above, _] = self.by_turns(turn);
        let buffers = [block, layer, extent, parameters, rows, above, slopes];
        let bindings: Vec<_> = [0, 1, 3, 5, 6, 10, 11].into_iter().zip(buffers).collect();
        let tiling = Tiling::of(shape.width);
        let groups = [tiling.left(stride), tiling.right(encoded)];
        Ok(Some((device.bind(&kernels[6], &bindings)?, groups)))
    }

    /// Slopes of places, if they are wanted.
    fn places(&self, stride: usize, hidden: usize) -> Result<Option<Task>, GpuError> {
        let Self { device, kernels, block, points, memory, .. } = self;
        let Some((_, behind)) = &memory.behind_units else { return Ok(None) };
        let [_, encoded] = self.by_turns(hidden - 1);
        let (encoding, rows) = (&memory.encoding, &memory.rows);
        let buffers = [block, encoding, &points.extent, rows, encoded, behind, &points.of_places];
        let bindings: Vec<_> = [0, 2, 3, 6, 11, 13, 14].into_iter().zip(buffers).collect();
        Ok(Some((device.bind(&kernels[8], &bindings)?, [stride.div_ceil(64) as u32, 1])))
    }

    /// An entry point about a layer; slopes go from one of two buffers to the other, by turns.
    fn bind(
        &self,
        entry: usize,
        layer: usize,
        turn: usize,
        bindings: &[u32],
    ) -> Result<Bound, GpuError> {
        let Memory { encoding, layers, rows, parts, .. } = self.memory;
        let Points { places, values, bends, cotangents, extent, .. } = self.points;
        let [above, below] = self.by_turns(turn);
        let all = [
            self.block,
            &layers[layer],
            encoding,
            extent,
            places,
            &self.learning.parameters,
            rows,
            values,
            bends,
            cotangents,
            above,
            below,
            parts,
        ];
        let buffers: Vec<_> = bindings.iter().map(|k| (*k, all[*k as usize])).collect();
        self.device.bind(&self.kernels[entry], &buffers)
    }

    /// Slopes of what a layer gives and of what it takes.
    fn by_turns(&self, turn: usize) -> [&Buffer; 2] {
        [turn, turn + 1].map(|turn| &self.memory.slopes[turn % 2])
    }

    fn add_up(&self) -> Result<Bound, GpuError> {
        let Binding { block, points, memory, learning, .. } = *self;
        let gradient = &learning.gradient;
        let buffers = [(0, block), (3, &points.extent), (10, gradient), (12, &memory.parts)];
        self.device.bind(&self.kernels[7], &buffers)
    }
}
