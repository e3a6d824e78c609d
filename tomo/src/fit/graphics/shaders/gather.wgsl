// Nodes of (ray, frame) pairs, turned back to the reference time, without those that are dark; light summed along rays.
// A workgroup has a pair.

struct Node {
    place: vec4<f32>,  // x, y, z in M, and the weight in the pixel
    // Turn a unit of time, turn that belongs to the delay, delay; of matter that falls when it is by the table (two floats),
    // delay, azimuth.
    motion: vec4<f32>,
}

struct Pair {
    first: u32, // nodes first .. last
    last: u32,
    time: f32,  // of the frame since the reference time, M
    datum: f32, // the pixel in the data
}

struct Task {
    axis: vec3<f32>,
    earliest: f32,   // nothing shines before, if FROM_A_TIME
    pairs: u32,
    flags: u32,
    cells: u32,      // of the mask along each axis
    half_width: f32, // of the mask's cube, M
    per_length: f32, // its cells a unit of length
    slope: f32,      // dloss/dpixel of a residual of 1
    row: u32,        // workgroups in a row of the grid
    into: u32,       // where the loss of this step is kept
    cells_of_fall: u32,
    least: f32,      // radius of the region, M
    largest: f32,
    spare: u32,
}

const FROM_A_TIME = 1u;
const MASKED = 2u;
const EVENTS = 4u;
const FALLS = 8u;
const AXIS_IS_LEARNT = 16u;

@group(0) @binding(0) var<uniform> task: Task;
@group(0) @binding(1) var<storage, read> nodes: array<Node>;
@group(0) @binding(2) var<storage, read> pairs: array<Pair>;
@group(0) @binding(3) var<storage, read> mask: array<u32>;
@group(0) @binding(4) var<storage, read_write> counts: array<u32>;
// Pair k has the points starts[k] .. starts[k + 1]; behind the last one, how many there are.
@group(0) @binding(5) var<storage, read_write> starts: array<u32>;
@group(0) @binding(6) var<storage, read_write> places: array<vec4<f32>>;
@group(0) @binding(7) var<storage, read_write> weights: array<f32>;
@group(0) @binding(8) var<storage, read_write> values: array<f32>;
@group(0) @binding(9) var<storage, read_write> fluxes: array<f32>;
@group(0) @binding(10) var<storage, read_write> squares: array<f32>;
@group(0) @binding(11) var<storage, read_write> slopes: array<f32>;
@group(0) @binding(12) var<storage, read_write> cotangents: array<f32>;
// Of each step the sum of squares and the bits of the number of points.
@group(0) @binding(13) var<storage, read_write> records: array<vec2<f32>>;
@group(0) @binding(14) var<storage, read_write> extent: array<u32>;
// Cells of a fall: when they begin (two floats), cells per time, nothing, coefficients of radius and azimuth; then radius,
// azimuth and angular velocity at both ends, and when the last cell ends (two floats).
@group(0) @binding(15) var<storage, read> fall: array<f32>;
// If the axis is learnt: of each point its node.
@group(0) @binding(16) var<storage, read_write> origins: array<u32>;

var<workgroup> shared_counts: array<u32, 256>;
var<workgroup> shared_sums: array<f32, 256>;

struct Seen {
    place: vec4<f32>, // x, y, z at the reference time and t; of events where and when the light was emitted
    shines: bool,
}

fn in_mask(place: vec3<f32>) -> bool {
    let at = (place + task.half_width) * task.per_length;
    let most = f32(task.cells);
    if !(all(at >= vec3<f32>(0.0)) && all(at <= vec3<f32>(most))) {
        return false;
    }
    // The upper faces belong to the last cells.
    let cell = min(vec3<u32>(at), vec3<u32>(task.cells - 1u));
    let index = (cell.x * task.cells + cell.y) * task.cells + cell.z;
    return ((mask[index / 32u] >> (index % 32u)) & 1u) == 1u;
}

// How long after the time at a place of the table.
fn since(at: vec2<f32>, elapsed: f32, place: u32) -> f32 {
    // The high parts first: those of close times differ by an exact number.
    return (at.x - fall[place]) + (at.y - fall[place + 1u]) - elapsed;
}

// Radius and azimuth at the end of a fall that begins at `place`, where matter stays on a circle.
fn beyond(place: u32, time: f32) -> vec2<f32> {
    return vec2<f32>(fall[place], fma(fall[place + 2u], time, fall[place + 1u]));
}

fn coefficients(place: u32, part: f32) -> f32 {
    var sum = fall[place + 5u];
    for (var k = 5u; k > 0u; k--) {
        sum = fma(sum, part, fall[place + k - 1u]);
    }
    return sum;
}

// Radius and azimuth of matter a time before it was at a place of the table.
fn fallen(at: vec2<f32>, elapsed: f32) -> vec2<f32> {
    let ends = 16u * task.cells_of_fall;
    if since(at, elapsed, 0u) < 0.0 {
        return beyond(ends, since(at, elapsed, 0u));
    }
    if since(at, elapsed, ends + 8u) >= 0.0 {
        return beyond(ends + 4u, since(at, elapsed, ends + 8u));
    }
    var low = 0u;
    var high = task.cells_of_fall;
    while high - low > 1u {
        let middle = (low + high) / 2u;
        if since(at, elapsed, 16u * middle) >= 0.0 {
            low = middle;
        } else {
            high = middle;
        }
    }
    let cell = 16u * low;
    let part = since(at, elapsed, cell) * fall[cell + 2u];
    return vec2<f32>(coefficients(cell + 4u, part), coefficients(cell + 10u, part));
}

// Later than any time, and below what stands for that at nodes whose matter stays at its radius.
const NEVER: f32 = 1e29;

// What a node is stretched by and turned by to where its matter was; a stretch of 0 where that is outside of the region.
fn carried(node: Node, frame: f32) -> vec2<f32> {
    if (task.flags & FALLS) == 0u {
        return vec2<f32>(1.0, node.motion.x * frame + node.motion.y);
    }
    let elapsed = frame - node.motion.z;
    let radius = length(node.place.xyz);
    var before = vec2<f32>(radius, -node.motion.w * elapsed);
    if node.motion.x < NEVER {
        before = fallen(node.motion.xy, elapsed) - vec2<f32>(0.0, node.motion.w);
    }
    let inside = before.x >= task.least && before.x <= task.largest;
    return select(vec2<f32>(0.0), vec2<f32>(before.x / radius, before.y), inside);
}

fn seen(index: u32, frame: f32) -> Seen {
    let node = nodes[index];
    let time = frame - node.motion.z;
    let carry = carried(node, frame);
    let x = node.place.xyz * carry.x;
    let turn = kerr_cos_sin(carry.y);
    let along = (1.0 - turn.x) * dot(task.axis, x);
    let pulled = turn.x * x + turn.y * cross(task.axis, x) + along * task.axis;
    let in_time = (task.flags & FROM_A_TIME) == 0u || time >= task.earliest;
    let unmasked = (task.flags & MASKED) == 0u || in_mask(pulled);
    let place = select(pulled, x, (task.flags & EVENTS) != 0u);
    return Seen(vec4<f32>(place, time), in_time && unmasked && carry.x > 0.0);
}

@compute @workgroup_size(64)
fn count(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let pair = group.y * task.row + group.x;
    if pair >= task.pairs {
        return;
    }
    let its = pairs[pair];
    var own = 0u;
    for (var k = its.first + lane; k < its.last; k += 64u) {
        own += select(0u, 1u, seen(k, its.time).shines);
    }
    shared_counts[lane] = own;
    for (var half = 32u; half > 0u; half /= 2u) {
        workgroupBarrier();
        if lane < half {
            shared_counts[lane] += shared_counts[lane + half];
        }
    }
    if lane == 0u {
        counts[pair] = shared_counts[0];
    }
}

// Sums of the 256 counts up to each lane's own.
fn sums_so_far(own: u32, lane: u32, lanes: u32) -> u32 {
    shared_counts[lane] = own;
    workgroupBarrier();
    for (var reach = 1u; reach < lanes; reach *= 2u) {
        var sum = shared_counts[lane];
        if lane >= reach {
            sum += shared_counts[lane - reach];
        }
        // Nobody writes before all have read.
        workgroupBarrier();
        shared_counts[lane] = sum;
        workgroupBarrier();
    }
    return shared_counts[lane];
}

// One workgroup for all pairs.
@compute @workgroup_size(256)
fn scan(@builtin(local_invocation_index) lane: u32) {
    var before = 0u;
    for (var begin = 0u; begin < task.pairs; begin += 256u) {
        let pair = begin + lane;
        var own = 0u;
        if pair < task.pairs {
            own = counts[pair];
        }
        let sum = sums_so_far(own, lane, 256u);
        if pair < task.pairs {
            starts[pair] = before + sum - own;
        }
        before += shared_counts[255];
        workgroupBarrier();
    }
    if lane == 0u {
        starts[task.pairs] = before;
        extent[0] = before;
    }
}

@compute @workgroup_size(64)
fn collect(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let pair = group.y * task.row + group.x;
    if pair >= task.pairs {
        return;
    }
    let its = pairs[pair];
    var to = starts[pair];
    for (var begin = its.first; begin < its.last; begin += 64u) {
        let k = begin + lane;
        // Lanes behind the last node go along: barriers need all of them.
        var point = Seen(vec4<f32>(0.0), false);
        if k < its.last {
            point = seen(k, its.time);
        }
        let own = select(0u, 1u, point.shines);
        let sum = sums_so_far(own, lane, 64u);
        if point.shines {
            places[to + sum - 1u] = point.place;
            weights[to + sum - 1u] = nodes[k].place.w;
            if (task.flags & AXIS_IS_LEARNT) != 0u {
                origins[to + sum - 1u] = k;
            }
        }
        to += shared_counts[63];
        workgroupBarrier();
    }
}

// The light of each pair, and how far it is from the data.
@compute @workgroup_size(64)
fn sum_rays(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let pair = group.y * task.row + group.x;
    if pair >= task.pairs {
        return;
    }
    let last = starts[pair + 1u];
    var own = 0.0;
    for (var k = starts[pair] + lane; k < last; k += 64u) {
        own += weights[k] * values[k];
    }
    shared_sums[lane] = own;
    for (var half = 32u; half > 0u; half /= 2u) {
        workgroupBarrier();
        if lane < half {
            shared_sums[lane] += shared_sums[lane + half];
        }
    }
    if lane == 0u {
        let residual = shared_sums[0] - pairs[pair].datum;
        fluxes[pair] = shared_sums[0];
        squares[pair] = residual * residual;
        slopes[pair] = task.slope * residual;
    }
}

// From pixels back to points.
@compute @workgroup_size(64)
fn spread(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let pair = group.y * task.row + group.x;
    if pair >= task.pairs {
        return;
    }
    let last = starts[pair + 1u];
    for (var k = starts[pair] + lane; k < last; k += 64u) {
        cotangents[k] = slopes[pair] * weights[k];
    }
}

// One workgroup adds the squares of all pairs, and their points, to the record of the task.
@compute @workgroup_size(256)
fn tally(@builtin(local_invocation_index) lane: u32) {
    var own = 0.0;
    for (var k = lane; k < task.pairs; k += 256u) {
        own += squares[k];
    }
    shared_sums[lane] = own;
    for (var half = 128u; half > 0u; half /= 2u) {
        workgroupBarrier();
        if lane < half {
            shared_sums[lane] += shared_sums[lane + half];
        }
    }
    if lane == 0u {
        let before = records[task.into];
        let points = bitcast<u32>(before.y) + extent[0];
        records[task.into] = vec2<f32>(before.x + shared_sums[0], bitcast<f32>(points));
    }
}
