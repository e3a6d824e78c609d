// Numbers on the nodes of grids, interpolated linearly along each axis, and the way back. What points add to nodes is
// summed as whole numbers of 64 bits: such sums do not depend on their order.

struct Block {
    first: u32,   // point of the batch
    stride: u32,  // points that there is room for
    network: u32,
    count: u32,
}

struct Level {
    low: vec3<f32>,        // coordinates of the first node
    planes: u32,           // numbers on a node
    per_length: vec3<f32>, // cells a unit of length
    offset: u32,           // of the first plane in the parameters
    column: u32,           // of the first plane in the activations
    columns: u32,          // of all levels
    total: u32,            // parameters on nodes of all levels
    activation: u32,
    nodes: vec3<u32>,      // along each axis
    row: u32,              // invocations in a row of the grid
}

@group(0) @binding(0) var<uniform> block: Block;
@group(0) @binding(1) var<uniform> level: Level;
@group(0) @binding(2) var<storage, read> extent: array<u32>;
@group(0) @binding(3) var<storage, read> places: array<vec4<f32>>;
@group(0) @binding(4) var<storage, read> parameters: array<f32>;
@group(0) @binding(5) var<storage, read_write> rows: array<f32>;
@group(0) @binding(6) var<storage, read_write> values: array<f32>;
@group(0) @binding(7) var<storage, read_write> bends: array<f32>;
@group(0) @binding(8) var<storage, read> cotangents: array<f32>;
@group(0) @binding(9) var<storage, read_write> slopes: array<f32>;
@group(0) @binding(10) var<storage, read_write> peak: atomic<u32>;
@group(0) @binding(11) var<storage, read_write> sums: array<atomic<u32>>;
@group(0) @binding(12) var<storage, read_write> gradient: array<f32>;
@group(0) @binding(13) var<storage, read_write> of_places: array<vec4<f32>>;

struct Located {
    corner: u32,
    within: vec3<f32>,
    inside: bool,
}

fn here() -> u32 {
    // Blocks behind the last point have none: a difference of unsigned numbers must not wrap.
    return min(max(extent[0], block.first) - block.first, block.stride);
}

fn locate(place: vec3<f32>) -> Located {
    let most = vec3<f32>(level.nodes - 1u);
    let u = (place - level.low) * level.per_length;
    let inside = all(u >= vec3<f32>(0.0)) && all(u <= most);
    let held = clamp(u, vec3<f32>(0.0), most);
    let cell = clamp(round(held - 0.5), vec3<f32>(0.0), most - 1.0);
    let whole = min(vec3<u32>(cell), level.nodes - 2u);
    let corner = (whole.x * level.nodes.y + whole.y) * level.nodes.z + whole.z;
    return Located(corner, held - cell, inside);
}

// Node number k of a cell, x slowest, and its weight.
fn node(at: Located, k: u32) -> u32 {
    let n = level.nodes;
    return at.corner + ((k >> 2u) * n.y + ((k >> 1u) & 1u)) * n.z + (k & 1u);
}

fn share(at: Located, k: u32) -> f32 {
    let x = select(1.0 - at.within.x, at.within.x, (k & 4u) != 0u);
    let y = select(1.0 - at.within.y, at.within.y, (k & 2u) != 0u);
    let z = select(1.0 - at.within.z, at.within.z, (k & 1u) != 0u);
    return x * y * z;
}

fn size() -> u32 {
    return level.nodes.x * level.nodes.y * level.nodes.z;
}

fn interpolated(at: Located, plane: u32) -> f32 {
    let start = level.offset + plane * size();
    var c: array<f32, 8>;
    for (var k = 0u; k < 8u; k++) {
        c[k] = parameters[start + node(at, k)];
    }
    let z = at.within.z;
    let low = mix_of(fma(z, c[1] - c[0], c[0]), fma(z, c[3] - c[2], c[2]), at.within.y);
    let high = mix_of(fma(z, c[5] - c[4], c[4]), fma(z, c[7] - c[6], c[6]), at.within.y);
    return mix_of(low, high, at.within.x);
}

fn mix_of(a: f32, b: f32, part: f32) -> f32 {
    return fma(part, b - a, a);
}

// Emission of voxels.
@compute @workgroup_size(64)
fn voxels(@builtin(global_invocation_id) at: vec3<u32>) {
    let point = at.y * level.row + at.x;
    if point >= here() {
        return;
    }
    let found = locate(places[block.first + point].xyz);
    let both = activate(level.activation, interpolated(found, 0u));
    values[block.first + point] = select(0.0, both.x, found.inside);
    bends[block.first + point] = select(0.0, both.y, found.inside);
}

// Slopes of voxels' numbers.
@compute @workgroup_size(64)
fn voxels_back(@builtin(global_invocation_id) at: vec3<u32>) {
    let point = at.y * level.row + at.x;
    if point >= here() {
        return;
    }
    slopes[point] = cotangents[block.first + point] * bends[block.first + point];
}

// Features of a level: inputs of a network, behind which there is a one.
@compute @workgroup_size(64)
fn features(@builtin(global_invocation_id) at: vec3<u32>) {
    let point = at.y * level.row + at.x;
    if point >= here() {
        return;
    }
    let found = locate(places[block.first + point].xyz);
    for (var plane = 0u; plane < level.planes; plane++) {
        rows[(level.column + plane) * block.stride + point] = interpolated(found, plane);
    }
    rows[level.columns * block.stride + point] = 1.0;
}

// Nothing shines outside of the grid.
@compute @workgroup_size(64)
fn gate(@builtin(global_invocation_id) at: vec3<u32>) {
    let point = at.y * level.row + at.x;
    if point >= here() || locate(places[block.first + point].xyz).inside {
        return;
    }
    values[block.first + point] = 0.0;
    bends[block.first + point] = 0.0;
}

// What interpolation gains along each axis, per cell.
fn gain(at: Located, plane: u32) -> vec3<f32> {
    let start = level.offset + plane * size();
    var sum = vec3<f32>(0.0);
    for (var k = 0u; k < 8u; k++) {
        let upper = (vec3<u32>(k >> 2u, k >> 1u, k) & vec3<u32>(1u)) == vec3<u32>(1u);
        let shares = select(1.0 - at.within, at.within, upper);
        let signs = select(vec3<f32>(-1.0), vec3<f32>(1.0), upper);
        sum += parameters[start + node(at, k)] * signs * shares.yxx * shares.zzy;
    }
    return sum;
}

// From the slopes of a level's numbers to those of places, which the first level begins.
@compute @workgroup_size(64)
fn places_back(@builtin(global_invocation_id) at: vec3<u32>) {
    let point = at.y * level.row + at.x;
    if point >= here() {
        return;
    }
    let found = locate(places[block.first + point].xyz);
    var sum = vec3<f32>(0.0);
    for (var plane = 0u; plane < level.planes; plane++) {
        sum += slopes[(level.column + plane) * block.stride + point] * gain(found, plane);
    }
    var before = vec4<f32>(0.0);
    if level.column > 0u {
        before = of_places[block.first + point];
    }
    of_places[block.first + point] = before + vec4<f32>(sum * level.per_length, 0.0);
}

// Before a sum.
@compute @workgroup_size(1)
fn begin() {
    atomicStore(&peak, 0u);
}

// The bits of the largest slope: those of positive floats have their order.
@compute @workgroup_size(64)
fn largest(@builtin(global_invocation_id) at: vec3<u32>) {
    let point = at.y * level.row + at.x;
    if point >= here() {
        return;
    }
    var most = 0u;
    for (var column = 0u; column < level.columns; column++) {
        most = max(most, bitcast<u32>(abs(slopes[column * block.stride + point])));
    }
    atomicMax(&peak, most);
}

// Numbers are multiplied by 2^scale(): all points of the block may add the largest one.
fn scale() -> i32 {
    let exponent = i32(atomicLoad(&peak) >> 23u) - 126;
    // Sums stay below 2^61 of the 2^63 that a signed number of 64 bits has.
    return 61 - i32(32u - countLeadingZeros(block.stride)) - exponent;
}

// |x| 2^scale, cut, as low and high bits.
fn fixed(x: f32, scale: i32) -> vec2<u32> {
    let bits = bitcast<u32>(abs(x));
    let exponent = i32(bits >> 23u);
    // Floats that are not normal have no leading one to put back.
    if exponent == 0 {
        return vec2<u32>(0u);
    }
    let digits = (bits & 0x7fffffu) | 0x800000u;
    let shift = exponent - 150 + scale;
    if shift >= 32 {
        return vec2<u32>(0u, digits << u32(min(shift - 32, 31)));
    }
    if shift > 0 {
        return vec2<u32>(digits << u32(shift), digits >> u32(32 - shift));
    }
    return vec2<u32>(digits >> u32(min(-shift, 31)), 0u);
}

// What the points of a block add to the nodes of a level.
@compute @workgroup_size(64)
fn scatter(@builtin(global_invocation_id) at: vec3<u32>) {
    let point = at.y * level.row + at.x;
    if point >= here() {
        return;
    }
    let found = locate(places[block.first + point].xyz);
    let by = scale();
    for (var plane = 0u; plane < level.planes; plane++) {
        let slope = slopes[(level.column + plane) * block.stride + point];
        if slope == 0.0 {
            continue;
        }
        for (var k = 0u; k < 8u; k++) {
            let x = slope * share(found, k);
            var add = fixed(x, by);
            if x < 0.0 {
                add = ~add;
                add.x += 1u;
                add.y += select(0u, 1u, add.x == 0u);
            }
            let to = 2u * (level.offset + plane * size() + node(found, k));
            // Atomics have 32 bits: who makes the low word wrap carries one into the high word.
            let before = atomicAdd(&sums[to], add.x);
            let carry = select(0u, 1u, before + add.x < before);
            atomicAdd(&sums[to + 1u], add.y + carry);
        }
    }
}

fn power_of_two(exponent: i32) -> f32 {
    return bitcast<f32>(u32(clamp(exponent, -126, 127) + 127) << 23u);
}

// Adds the sums to the gradient, and forgets them.
@compute @workgroup_size(64)
fn settle(@builtin(global_invocation_id) at: vec3<u32>) {
    let k = at.y * level.row + at.x;
    if k >= level.total {
        return;
    }
    var low = atomicLoad(&sums[2u * k]);
    var high = atomicLoad(&sums[2u * k + 1u]);
    if low == 0u && high == 0u {
        return;
    }
    atomicStore(&sums[2u * k], 0u);
    atomicStore(&sums[2u * k + 1u], 0u);
    let negative = (high >> 31u) == 1u;
    if negative {
        low = ~low + 1u;
        high = ~high + select(0u, 1u, low == 0u);
    }
    let back = -scale();
    let whole = f32(high) * 4294967296.0 + f32(low);
    // In two factors, as 2^back alone may be no float.
    let sum = whole * power_of_two(back / 2) * power_of_two(back - back / 2);
    gradient[k] += select(sum, -sum, negative);
}
