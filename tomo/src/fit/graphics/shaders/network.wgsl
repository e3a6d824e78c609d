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
    skips: u32,   // 1: a layer takes the encoded point behind units
}

@group(0) @binding(0) var<uniform> block: Block;
@group(0) @binding(1) var<uniform> layer: Layer;
@group(0) @binding(2) var<uniform> encoding: Encoding;
@group(0) @binding(3) var<storage, read> extent: array<u32>;
@group(0) @binding(4) var<storage, read> places: array<vec4<f32>>;
@group(0) @binding(5) var<storage, read> parameters: array<f32>;
@group(0) @binding(6) var<storage, read_write> rows: array<f32>;
@group(0) @binding(6) var<storage, read_write> rows_of_four: array<vec4<f32>>;
@group(0) @binding(7) var<storage, read_write> values: array<f32>;
@group(0) @binding(8) var<storage, read_write> bends: array<f32>;
@group(0) @binding(9) var<storage, read> cotangents: array<f32>;
@group(0) @binding(10) var<storage, read_write> above: array<f32>;
@group(0) @binding(10) var<storage, read_write> above_of_four: array<vec4<f32>>;
@group(0) @binding(11) var<storage, read_write> below: array<f32>;
@group(0) @binding(11) var<storage, read_write> below_of_four: array<vec4<f32>>;
@group(0) @binding(12) var<storage, read_write> parts: array<f32>;
@group(0) @binding(13) var<storage, read_write> behind_units: array<f32>;
@group(0) @binding(14) var<storage, read_write> of_places: array<vec4<f32>>;

// Products of matrices: result[i][j] = sum over k of left[k][i] right[k][j]. A workgroup has a tile of the result, a lane
// 4 i's by 8 j's of it. It goes through k in slabs, which lie in the workgroup's memory as vectors of four, side by side.
// How many lanes share an i or a j, LEFT_LANES by RIGHT_LANES, and the depth of a SLAB stand before this text.
const LANES = 256u;
const LEFT = 4u * LEFT_LANES;
const RIGHT = 8u * RIGHT_LANES;
const FOURS = 2u * RIGHT_LANES;
const START_OF_RIGHT = SLAB * LEFT_LANES;
// Points of a partial sum of gradients.
const SPAN = 512u;

var<workgroup> slabs: array<vec4<f32>, SLAB * (LEFT_LANES + FOURS)>;
var<workgroup> sums: array<f32, LANES>;

// Points in this block.
fn here() -> u32 {
    // Blocks behind the last point have none: a difference of unsigned numbers must not wrap.
    return min(max(extent[0], block.first) - block.first, block.stride);
}

fn column(input: u32) -> u32 {
    return select(layer.tail + input - layer.units, layer.base + input, input < layer.units);
}

fn activation(input: u32, point: u32) -> f32 {
    return rows[column(input) * block.stride + point];
}

// All inputs but the one, whose weights are biases.
fn proper_inputs() -> u32 {
    return layer.inputs - 1u;
}

fn weight(input: u32, output: u32) -> f32 {
    if input >= proper_inputs() || output >= layer.outputs {
        return 0.0;
    }
    return parameters[layer.offset + input * layer.outputs + output];
}

fn bias(output: u32) -> vec4<f32> {
    if output >= layer.outputs {
        return vec4<f32>(0.0);
    }
    return vec4<f32>(parameters[layer.offset + proper_inputs() * layer.outputs + output]);
}

// The fours of a slab that a lane fetches: every 256th one, at most two of each matrix.
struct Part {
    left: array<vec4<f32>, 2>,
    right: array<vec4<f32>, 2>,
}

// k and four of the n-th one. Lanes side by side fetch what lies side by side: fours of a row, or `across` the rows.
fn spot(n: u32, row: u32, across: bool) -> vec2<u32> {
    if across {
        return vec2<u32>(n % SLAB, n / SLAB);
    }
    return vec2<u32>(n / row, n % row);
}

// Fours are turned about by k, so that lanes that differ in k write to other banks.
fn place(k: u32, four: u32) -> u32 {
    return four ^ (k & 7u);
}

fn lay(lane: u32, part: Part, left_across: bool, right_across: bool) {
    for (var m = 0u; m < 2u; m++) {
        let n = lane + LANES * m;
        if n < SLAB * LEFT_LANES {
            let at = spot(n, LEFT_LANES, left_across);
            slabs[LEFT_LANES * at.x + place(at.x, at.y)] = part.left[m];
        }
        if n < SLAB * FOURS {
            let at = spot(n, FOURS, right_across);
            slabs[START_OF_RIGHT + FOURS * at.x + place(at.x, at.y)] = part.right[m];
        }
    }
}

// A lane's sums: column j of `low` and `high` has its four i's.
struct Sums {
    low: mat4x4<f32>,
    high: mat4x4<f32>,
}

// Adds a slab.
fn multiplied(lane: u32, so_far: Sums) -> Sums {
    var result = so_far;
    let i = lane % LEFT_LANES;
    let j = lane / LEFT_LANES;
    for (var k = 0u; k < SLAB; k++) {
        let a = slabs[LEFT_LANES * k + place(k, i)];
        let b = slabs[START_OF_RIGHT + FOURS * k + place(k, j)];
        let c = slabs[START_OF_RIGHT + FOURS * k + place(k, j + RIGHT_LANES)];
        result.low += mat4x4<f32>(b.x * a, b.y * a, b.z * a, b.w * a);
        result.high += mat4x4<f32>(c.x * a, c.y * a, c.z * a, c.w * a);
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

// The first of a lane's outputs (or units) in its tile; those of `high` are half a tile further.
fn first_right(lane: u32) -> u32 {
    return 4u * (lane / LEFT_LANES);
}

fn forward_part(lane: u32, k0: u32, p0: u32, o0: u32) -> Part {
    var part = Part();
    for (var m = 0u; m < 2u; m++) {
        let n = lane + LANES * m;
        let a = spot(n, LEFT_LANES, false);
        if n < SLAB * LEFT_LANES && k0 + a.x < proper_inputs() {
            part.left[m] = rows_of_four[(column(k0 + a.x) * block.stride + p0) / 4u + a.y];
        }
        let b = spot(n, FOURS, false);
        if n < SLAB * FOURS {
            let k = k0 + b.x;
            let o = o0 + 4u * b.y;
            part.right[m] = vec4<f32>(weight(k, o), weight(k, o + 1u), weight(k, o + 2u), weight(k, o + 3u));
        }
    }
    return part;
}

// Units of a hidden layer: workgroups are tiles of points by tiles of outputs. The points of a tile beyond the last one
// are computed like the others, and read by nobody.
@compute @workgroup_size(256)
fn forward(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let p0 = group.x * LEFT;
    let o0 = group.y * RIGHT;
    if p0 >= here() {
        return;
    }
    let o = o0 + first_right(lane);
    var result = Sums(
        mat4x4<f32>(bias(o), bias(o + 1u), bias(o + 2u), bias(o + 3u)),
        mat4x4<f32>(
            bias(o + RIGHT / 2u), bias(o + RIGHT / 2u + 1u), bias(o + RIGHT / 2u + 2u), bias(o + RIGHT / 2u + 3u),
        ),
    );
    var part = forward_part(lane, 0u, p0, o0);
    for (var k0 = 0u; k0 < proper_inputs(); k0 += SLAB) {
        lay(lane, part, false, false);
        workgroupBarrier();
        // On its way while this slab is worked on.
        part = forward_part(lane, k0 + SLAB, p0, o0);
        result = multiplied(lane, result);
        workgroupBarrier();
    }
    let p = p0 + 4u * (lane % LEFT_LANES);
    for (var j = 0u; j < 4u; j++) {
        keep_units(o + j, p, result.low[j]);
        keep_units(o + RIGHT / 2u + j, p, result.high[j]);
    }
}

fn keep_units(output: u32, point: u32, x: vec4<f32>) {
    if output < layer.outputs {
        // In this order a number that is none stays so.
        let rectified = select(x, vec4<f32>(0.0), x <= vec4<f32>(0.0));
        rows_of_four[((layer.into + output) * block.stride + point) / 4u] = rectified;
    }
}

// The output layer: emission and its slope. Four lanes share a point.
@compute @workgroup_size(256)
fn emit(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let point = group.x * 64u + lane % 64u;
    let is_there = point < here();
    var sum = 0.0;
    if is_there {
        for (var k = lane / 64u; k < layer.inputs; k += 4u) {
            sum = fma(activation(k, point), parameters[layer.offset + k], sum);
        }
    }
    sums[lane] = sum;
    workgroupBarrier();
    if is_there && lane < 64u {
        let all = (sums[lane] + sums[lane + 64u]) + (sums[lane + 128u] + sums[lane + 192u]);
        let both = activate(layer.activation, all + layer.shift);
        values[block.first + point] = both.x;
        bends[block.first + point] = both.y;
    }
}

// Back through the output layer, four points a lane: rows of the grid are units.
@compute @workgroup_size(64)
fn emit_back(@builtin(global_invocation_id) at: vec3<u32>) {
    let points = here();
    let p = 4u * at.x;
    if p >= points || at.y >= layer.units {
        return;
    }
    var slopes = vec4<f32>(0.0);
    for (var k = 0u; k < 4u; k++) {
        if p + k < points {
            slopes[k] = cotangents[block.first + p + k] * bends[block.first + p + k];
        }
    }
    let units = rows_of_four[(column(at.y) * block.stride + p) / 4u];
    let shines = (units > vec4<f32>(0.0)) | vec4<bool>(layer.open == 1u);
    let back = slopes * parameters[layer.offset + at.y];
    above_of_four[(at.y * block.stride + p) / 4u] = select(vec4<f32>(0.0), back, shines);
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
        own = fma(activation(group.x, p), slope, own);
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

fn unit(i: u32, p: u32, last: u32) -> f32 {
    if i >= proper_inputs() || p >= last {
        return 0.0;
    }
    return activation(i, p);
}

fn slope(o: u32, p: u32, last: u32) -> f32 {
    if o >= layer.outputs || p >= last {
        return 0.0;
    }
    return above[o * block.stride + p];
}

fn weights_part(lane: u32, k0: u32, last: u32, i0: u32, o0: u32) -> Part {
    var part = Part();
    for (var m = 0u; m < 2u; m++) {
        let n = lane + LANES * m;
        let at = spot(n, 0u, true);
        let p = k0 + at.x;
        let i = i0 + 4u * at.y;
        let o = o0 + 4u * at.y;
        if n < SLAB * LEFT_LANES {
            part.left[m] = vec4<f32>(unit(i, p, last), unit(i + 1u, p, last), unit(i + 2u, p, last), unit(i + 3u, p, last));
        }
        if n < SLAB * FOURS {
            part.right[m] =
                vec4<f32>(slope(o, p, last), slope(o + 1u, p, last), slope(o + 2u, p, last), slope(o + 3u, p, last));
        }
    }
    return part;
}

// Gradient of a hidden layer's parameters: columns of the grid are tiles of inputs by tiles of outputs, rows are spans.
@compute @workgroup_size(256)
fn weights_back(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let points = here();
    let first = group.y * SPAN;
    if first >= points {
        return;
    }
    let tiles = (layer.outputs + RIGHT - 1u) / RIGHT;
    let i0 = (group.x / tiles) * LEFT;
    let o0 = (group.x % tiles) * RIGHT;
    let last = min(first + SPAN, points);
    var result = Sums(mat4x4<f32>(), mat4x4<f32>());
    // What a lane has seen of slopes: their sum is the gradient of biases.
    var seen = array<vec4<f32>, 2>();
    var part = weights_part(lane, first, last, i0, o0);
    for (var k0 = first; k0 < last; k0 += SLAB) {
        lay(lane, part, true, true);
        seen[0] += part.right[0];
        seen[1] += part.right[1];
        workgroupBarrier();
        part = weights_part(lane, k0 + SLAB, last, i0, o0);
        result = multiplied(lane, result);
        workgroupBarrier();
    }
    let start = group.y * block.count + layer.offset - block.network;
    for (var ii = 0u; ii < 4u; ii++) {
        lay_rows(lane, ii, result);
        workgroupBarrier();
        for (var n = lane; n < LEFT_LANES * RIGHT; n += LANES) {
            let i = i0 + 4u * (n / RIGHT) + ii;
            let o = o0 + n % RIGHT;
            if i < proper_inputs() && o < layer.outputs {
                parts[start + i * layer.outputs + o] = slabs[n / 4u][n % 4u];
            }
        }
        workgroupBarrier();
    }
    // Every tile of inputs has seen the same slopes: one of them is enough.
    if i0 == 0u {
        keep_biases(lane, o0, seen, start + proper_inputs() * layer.outputs);
    }
}

// One of each lane's four inputs with its outputs, so that a row of results can be written by lanes side by side.
fn lay_rows(lane: u32, ii: u32, x: Sums) {
    let to = (lane % LEFT_LANES) * FOURS + lane / LEFT_LANES;
    slabs[to] = vec4<f32>(x.low[0][ii], x.low[1][ii], x.low[2][ii], x.low[3][ii]);
    slabs[to + RIGHT_LANES] = vec4<f32>(x.high[0][ii], x.high[1][ii], x.high[2][ii], x.high[3][ii]);
}

// Adds up over k what lanes have seen.
fn keep_biases(lane: u32, o0: u32, seen: array<vec4<f32>, 2>, start: u32) {
    for (var m = 0u; m < 2u; m++) {
        if lane + LANES * m < SLAB * FOURS {
            slabs[lane + LANES * m] = seen[m];
        }
    }
    workgroupBarrier();
    let o = o0 + lane;
    if lane < RIGHT && o < layer.outputs {
        var sum = 0.0;
        for (var k = 0u; k < SLAB; k++) {
            sum += slabs[(lane / 4u) * SLAB + k][lane % 4u];
        }
        parts[start + o] = sum;
    }
}

fn units_part(lane: u32, k0: u32, p0: u32, u0: u32) -> Part {
    var part = Part();
    for (var m = 0u; m < 2u; m++) {
        let n = lane + LANES * m;
        let a = spot(n, LEFT_LANES, false);
        if n < SLAB * LEFT_LANES && k0 + a.x < layer.outputs {
            part.left[m] = above_of_four[((k0 + a.x) * block.stride + p0) / 4u + a.y];
        }
        let b = spot(n, FOURS, true);
        if n < SLAB * FOURS {
            let k = k0 + b.x;
            let u = u0 + 4u * b.y;
            part.right[m] = vec4<f32>(weight(u, k), weight(u + 1u, k), weight(u + 2u, k), weight(u + 3u, k));
        }
    }
    return part;
}

// From the slopes of a layer's outputs to those of the units before it.
@compute @workgroup_size(256)
fn units_back(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let p0 = group.x * LEFT;
    let u0 = group.y * RIGHT;
    if p0 >= here() {
        return;
    }
    var result = Sums(mat4x4<f32>(), mat4x4<f32>());
    var part = units_part(lane, 0u, p0, u0);
    for (var k0 = 0u; k0 < layer.outputs; k0 += SLAB) {
        lay(lane, part, false, true);
        workgroupBarrier();
        part = units_part(lane, k0 + SLAB, p0, u0);
        result = multiplied(lane, result);
        workgroupBarrier();
    }
    let p = p0 + 4u * (lane % LEFT_LANES);
    let u = u0 + first_right(lane);
    for (var j = 0u; j < 4u; j++) {
        keep_slopes(u + j, p, result.low[j]);
        keep_slopes(u + RIGHT / 2u + j, p, result.high[j]);
    }
}

fn keep_slopes(unit: u32, point: u32, x: vec4<f32>) {
    if unit < layer.units {
        let units = rows_of_four[((layer.base + unit) * block.stride + point) / 4u];
        let shines = (units > vec4<f32>(0.0)) | vec4<bool>(layer.open == 1u);
        below_of_four[(unit * block.stride + point) / 4u] = select(vec4<f32>(0.0), x, shines);
    }
}

// Adds the partial sums of the spans to the gradient, in their order, four lanes a parameter; `above` is the gradient of all
// parameters.
@compute @workgroup_size(256)
fn add_up(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let k = group.x * 64u + lane % 64u;
    let spans = (here() + SPAN - 1u) / SPAN;
    var sum = 0.0;
    if k < block.count {
        for (var span = lane / 64u; span < spans; span += 4u) {
            sum += parts[span * block.count + k];
        }
    }
    sums[lane] = sum;
    workgroupBarrier();
    if k < block.count && lane < 64u {
        let all = (sums[lane] + sums[lane + 64u]) + (sums[lane + 128u] + sums[lane + 192u]);
        above[block.network + k] += all;
    }
}

// Slope of a number of the encoded point, where it stands at the front, and behind units.
fn of_encoded(column: u32, point: u32) -> f32 {
    let at = column * block.stride + point;
    if encoding.skips == 1u {
        return below[at] + behind_units[at];
    }
    return below[at];
}

// From the slopes of the encoded point to those of its place.
@compute @workgroup_size(64)
fn encode_back(@builtin(global_invocation_id) at: vec3<u32>) {
    let point = at.x;
    if point >= here() {
        return;
    }
    let dimension = encoding.dimension;
    var slopes = vec4<f32>(0.0);
    for (var d = 0u; d < dimension; d++) {
        var sum = of_encoded(d, point);
        var rate = 1.0;
        for (var j = 0u; j < encoding.degree; j++) {
            let sine = dimension * (1u + j) + d;
            let cosine = dimension * (1u + encoding.degree + j) + d;
            sum += rate * rows[cosine * block.stride + point] * of_encoded(sine, point);
            sum -= rate * rows[sine * block.stride + point] * of_encoded(cosine, point);
            rate += rate;
        }
        slopes[d] = encoding.scales[d] * sum;
    }
    of_places[block.first + point] = slopes;
}
