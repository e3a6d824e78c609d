// The slope of the loss along the axis that matter turns about, behind the text of gather.wgsl. A workgroup has a pair.

@group(0) @binding(17) var<storage, read> of_places: array<vec4<f32>>;
@group(0) @binding(18) var<storage, read_write> of_axis: array<vec4<f32>>;   // of each pair
// Of each node's weight along the axis.
@group(0) @binding(19) var<storage, read> of_weights: array<vec4<f32>>;
@group(0) @binding(20) var<storage, read_write> axis_sum: array<vec4<f32>>;

var<workgroup> shared_vectors: array<vec3<f32>, 256>;

// The sum of what so many lanes have, in lane 0.
fn sum_of(own: vec3<f32>, lane: u32, lanes: u32) -> vec3<f32> {
    shared_vectors[lane] = own;
    for (var half = lanes / 2u; half > 0u; half /= 2u) {
        workgroupBarrier();
        if lane < half {
            shared_vectors[lane] += shared_vectors[lane + half];
        }
    }
    return shared_vectors[0];
}

// By way of places: of x turned about the axis, s (x times g) + (1 - c) ((axis g) x + (axis x) g) for a slope g.
@compute @workgroup_size(64)
fn turned_back(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let pair = group.y * task.row + group.x;
    if pair >= task.pairs {
        return;
    }
    let last = starts[pair + 1u];
    var own = vec3<f32>(0.0);
    for (var k = starts[pair] + lane; k < last; k += 64u) {
        let node = nodes[origins[k]];
        let carry = carried(node, pairs[pair].time);
        let x = node.place.xyz * carry.x;
        let g = of_places[k].xyz;
        let turn = kerr_cos_sin(carry.y);
        own += turn.y * cross(x, g) + (1.0 - turn.x) * (dot(task.axis, g) * x + dot(task.axis, x) * g);
    }
    let sum = sum_of(own, lane, 64u);
    if lane == 0u {
        of_axis[pair] = vec4<f32>(sum, 0.0);
    }
}

// By way of weights, in addition.
@compute @workgroup_size(64)
fn weighed_back(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let pair = group.y * task.row + group.x;
    if pair >= task.pairs {
        return;
    }
    let last = starts[pair + 1u];
    var own = vec3<f32>(0.0);
    for (var k = starts[pair] + lane; k < last; k += 64u) {
        own += values[k] * of_weights[origins[k]].xyz;
    }
    let sum = sum_of(own, lane, 64u);
    if lane == 0u {
        of_axis[pair] += vec4<f32>(slopes[pair] * sum, 0.0);
    }
}

// One workgroup adds up the pairs.
@compute @workgroup_size(256)
fn add_axis(@builtin(local_invocation_index) lane: u32) {
    var own = vec3<f32>(0.0);
    for (var k = lane; k < task.pairs; k += 256u) {
        own += of_axis[k].xyz;
    }
    let sum = sum_of(own, lane, 256u);
    if lane == 0u {
        axis_sum[0] += vec4<f32>(sum, 0.0);
    }
}
