// A fully connected network on a block of points. Activations lie column by column: the encoded point, a one (whose
// weights are biases), the units of each layer. Products of matrices go through tiles in the workgroup's memory.

struct Block {
    first: u32,   // point of the batch
    stride: u32,  // points that there is room for
    network: u32, // where the network's parameters start
    count: u32,   // how many it has
}

struct Layer {
    base: u32,    // columns of the units before it
    units: u32,   // how many
    tail: u32,    // columns behind them: the encoded point and the one, or the one alone
    inputs: u32,  // all of them
    outputs: u32,
    into: u32,    // column of its own units
    offset: u32,  // of its parameters: inputs x outputs, row by row
    activation: u32,
    shift: f32,
    open: u32,    // 1: what is before it is not rectified
}

struct Encoding {
    scales: vec4<f32>,
    dimension: u32,
    degree: u32,
}

@group(0) @binding(0) var<uniform> block: Block;
@group(0) @binding(1) var<uniform> layer: Layer;
@group(0) @binding(2) var<uniform> encoding: Encoding;
@group(0) @binding(3) var<storage, read> extent: array<u32>;
@group(0) @binding(4) var<storage, read> places: array<vec4<f32>>;
@group(0) @binding(5) var<storage, read> parameters: array<f32>;
@group(0) @binding(6) var<storage, read_write> rows: array<f32>;
@group(0) @binding(7) var<storage, read_write> values: array<f32>;
@group(0) @binding(8) var<storage, read_write> bends: array<f32>;
@group(0) @binding(9) var<storage, read> cotangents: array<f32>;
@group(0) @binding(10) var<storage, read_write> above: array<f32>;
@group(0) @binding(11) var<storage, read_write> below: array<f32>;
@group(0) @binding(12) var<storage, read_write> parts: array<f32>;

// Sides of a tile and depth of a slab; points of a partial sum of gradients.
const TILE = 64u;
const SLAB = 16u;
const SPAN = 1024u;

var<workgroup> left: array<vec4<f32>, 256>;
var<workgroup> right: array<vec4<f32>, 256>;
var<workgroup> sums: array<f32, 64>;

// Points in this block.
fn here() -> u32 {
    return min(max(extent[0], block.first) - block.first, block.stride);
}

fn column(input: u32) -> u32 {
    return select(layer.tail + input - layer.units, layer.base + input, input < layer.units);
}

fn activation(input: u32, point: u32, points: u32) -> f32 {
    if input >= layer.inputs || point >= points {
        return 0.0;
    }
    return rows[column(input) * block.stride + point];
}

fn weight(input: u32, output: u32, inputs: u32) -> f32 {
    if input >= inputs || output >= layer.outputs {
        return 0.0;
    }
    return parameters[layer.offset + input * layer.outputs + output];
}

fn slope(output: u32, point: u32, points: u32) -> f32 {
    if output >= layer.outputs || point >= points {
        return 0.0;
    }
    return above[output * block.stride + point];
}

fn activations(input: u32, point: u32, points: u32) -> vec4<f32> {
    return vec4<f32>(
        activation(input, point, points), activation(input, point + 1u, points),
        activation(input, point + 2u, points), activation(input, point + 3u, points),
    );
}

// Four by four sums of a lane over a slab: component of `left` by column of the result.
fn multiplied(lane: u32, so_far: mat4x4<f32>) -> mat4x4<f32> {
    var result = so_far;
    for (var k = 0u; k < SLAB; k++) {
        let a = left[16u * k + lane % 16u];
        let b = right[16u * k + lane / 16u];
        result += mat4x4<f32>(b.x * a, b.y * a, b.z * a, b.w * a);
    }
    return result;
}

@compute @workgroup_size(64)
fn encode(@builtin(global_invocation_id) at: vec3<u32>) {
    let point = at.x;
    if point >= here() {
        return;
    }
    let place = places[block.first + point];
    var coordinates = place;
    if encoding.dimension == 4u {
        coordinates = place.wxyz;
    }
    coordinates *= encoding.scales;
    let dimension = encoding.dimension;
    for (var d = 0u; d < dimension; d++) {
        var x = coordinates[d];
        rows[d * block.stride + point] = x;
        for (var j = 0u; j < encoding.degree; j++) {
            let both = kerr_cos_sin(x);
            rows[(dimension * (1u + j) + d) * block.stride + point] = both.y;
            rows[(dimension * (1u + encoding.degree + j) + d) * block.stride + point] = both.x;
            x += x;
        }
    }
    rows[dimension * (1u + 2u * encoding.degree) * block.stride + point] = 1.0;
}

// Units of a hidden layer: workgroups are tiles of points by tiles of outputs.
@compute @workgroup_size(256)
fn forward(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let points = here();
    let p0 = group.x * TILE;
    let o0 = group.y * TILE;
    if p0 >= points {
        return;
    }
    var result = mat4x4<f32>();
    for (var k0 = 0u; k0 < layer.inputs; k0 += SLAB) {
        let k = k0 + lane / 16u;
        let p = p0 + 4u * (lane % 16u);
        let o = o0 + 4u * (lane % 16u);
        left[lane] = activations(k, p, points);
        right[lane] = vec4<f32>(
            weight(k, o, layer.inputs), weight(k, o + 1u, layer.inputs),
            weight(k, o + 2u, layer.inputs), weight(k, o + 3u, layer.inputs),
        );
        workgroupBarrier();
        result = multiplied(lane, result);
        workgroupBarrier();
    }
    let p = p0 + 4u * (lane % 16u);
    let o = o0 + 4u * (lane / 16u);
    for (var j = 0u; j < 4u; j++) {
        for (var i = 0u; i < 4u; i++) {
            if o + j < layer.outputs && p + i < points {
                let x = result[j][i];
                // In this order a number that is none stays so.
                rows[(layer.into + o + j) * block.stride + p + i] = select(x, 0.0, x <= 0.0);
            }
        }
    }
}

// The output layer: emission and its slope.
@compute @workgroup_size(64)
fn emit(@builtin(global_invocation_id) at: vec3<u32>) {
    let points = here();
    if at.x >= points {
        return;
    }
    var sum = 0.0;
    for (var k = 0u; k < layer.inputs; k++) {
        sum = fma(activation(k, at.x, points), parameters[layer.offset + k], sum);
    }
    let both = activate(layer.activation, sum + layer.shift);
    values[block.first + at.x] = both.x;
    bends[block.first + at.x] = both.y;
}

// Back through the output layer: rows of the grid are units.
@compute @workgroup_size(64)
fn emit_back(@builtin(global_invocation_id) at: vec3<u32>) {
    let points = here();
    if at.x >= points || at.y >= layer.units {
        return;
    }
    let slope = cotangents[block.first + at.x] * bends[block.first + at.x];
    let shines = activation(at.y, at.x, points) > 0.0;
    above[at.y * block.stride + at.x] = select(0.0, slope * parameters[layer.offset + at.y], shines);
}

// Gradient of the output layer: columns of the grid are inputs, rows are spans.
@compute @workgroup_size(64)
fn emit_weights(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let points = here();
    let first = group.y * SPAN;
    if first >= points {
        return;
    }
    var own = 0.0;
    for (var p = first + lane; p < min(first + SPAN, points); p += 64u) {
        let slope = cotangents[block.first + p] * bends[block.first + p];
        own = fma(activation(group.x, p, points), slope, own);
    }
    sums[lane] = own;
    for (var half = 32u; half > 0u; half /= 2u) {
        workgroupBarrier();
        if lane < half {
            sums[lane] += sums[lane + half];
        }
    }
    if lane == 0u {
        parts[group.y * block.count + layer.offset - block.network + group.x] = sums[0];
    }
}

// Gradient of a hidden layer's parameters: columns of the grid are tiles of inputs by outputs, rows are spans.
@compute @workgroup_size(256)
fn weights_back(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let points = here();
    let first = group.y * SPAN;
    if first >= points {
        return;
    }
    let across = (layer.outputs + TILE - 1u) / TILE;
    let i0 = (group.x / across) * TILE;
    let o0 = (group.x % across) * TILE;
    let last = min(first + SPAN, points);
    var result = mat4x4<f32>();
    for (var p0 = first; p0 < last; p0 += SLAB) {
        let p = p0 + lane % 16u;
        let to = 16u * (lane % 16u) + lane / 16u;
        let o = o0 + 4u * (lane / 16u);
        let i = i0 + 4u * (lane / 16u);
        left[to] = vec4<f32>(
            slope(o, p, last), slope(o + 1u, p, last), slope(o + 2u, p, last), slope(o + 3u, p, last),
        );
        right[to] = vec4<f32>(
            activation(i, p, last), activation(i + 1u, p, last),
            activation(i + 2u, p, last), activation(i + 3u, p, last),
        );
        workgroupBarrier();
        result = multiplied(lane, result);
        workgroupBarrier();
    }
    let o = o0 + 4u * (lane % 16u);
    let i = i0 + 4u * (lane / 16u);
    let start = group.y * block.count + layer.offset - block.network;
    for (var j = 0u; j < 4u; j++) {
        for (var k = 0u; k < 4u; k++) {
            if i + j < layer.inputs && o + k < layer.outputs {
                parts[start + (i + j) * layer.outputs + o + k] = result[j][k];
            }
        }
    }
}

// From the slopes of a layer's outputs to those of the units before it.
@compute @workgroup_size(256)
fn units_back(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let points = here();
    let p0 = group.x * TILE;
    let u0 = group.y * TILE;
    if p0 >= points {
        return;
    }
    var result = mat4x4<f32>();
    for (var k0 = 0u; k0 < layer.outputs; k0 += SLAB) {
        let k = k0 + lane / 16u;
        let p = p0 + 4u * (lane % 16u);
        let u = u0 + 4u * (lane % 16u);
        left[lane] = vec4<f32>(
            slope(k, p, points), slope(k, p + 1u, points),
            slope(k, p + 2u, points), slope(k, p + 3u, points),
        );
        right[lane] = vec4<f32>(
            weight(u, k, layer.units), weight(u + 1u, k, layer.units),
            weight(u + 2u, k, layer.units), weight(u + 3u, k, layer.units),
        );
        workgroupBarrier();
        result = multiplied(lane, result);
        workgroupBarrier();
    }
    let p = p0 + 4u * (lane % 16u);
    let u = u0 + 4u * (lane / 16u);
    for (var j = 0u; j < 4u; j++) {
        for (var i = 0u; i < 4u; i++) {
            if u + j < layer.units && p + i < points {
                let unit = rows[(layer.base + u + j) * block.stride + p + i];
                let shines = layer.open == 1u || unit > 0.0;
                below[(u + j) * block.stride + p + i] = select(0.0, result[j][i], shines);
            }
        }
    }
}

// Adds the partial sums of the spans to the gradient, in their order; `above` is the gradient of all parameters.
@compute @workgroup_size(64)
fn add_up(@builtin(global_invocation_id) at: vec3<u32>) {
    if at.x >= block.count {
        return;
    }
    var sum = above[block.network + at.x];
    let spans = (here() + SPAN - 1u) / SPAN;
    for (var span = 0u; span < spans; span++) {
        sum += parts[span * block.count + at.x];
    }
    above[block.network + at.x] = sum;
}
