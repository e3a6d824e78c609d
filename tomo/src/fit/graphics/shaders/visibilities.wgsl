// Visibilities of images, what data say of them, and back to pixels: V(u, v) = p sum I exp(2 pi i (u l + v m)), p the
// transform of a pixel. Rows of the grid of workgroups are frames of the piece.

struct Task {
    frames: u32,        // of the piece
    rays: u32,          // of a frame
    most_seen: u32,     // the most visibilities of a frame
    most_closures: u32, // the most closure quantities of a frame
    terms: u32,
    into: u32,          // the record that losses of terms are added to
    spare: vec2<u32>,
}

// A visibility of the model and, but for those of closure quantities, its datum.
struct Seen {
    uv: vec2<f32>,    // wavelengths
    pulse: f32,       // transform of a pixel
    kind: u32,
    datum: vec2<f32>, // Jy
    weight: f32,      // 1/sigma^2
    term: u32,
    first_use: u32,   // in closure quantities: uses first .. last
    last_use: u32,
    spare: vec2<u32>,
}

struct Closure {
    first_leg: u32,
    last_leg: u32,
    first: u32,  // of its scan, among those of its frame
    count: u32,  // of its scan
    row: u32,    // where its row of the inverse covariance begins
    term: u32,
    datum: f32,
    is_phase: u32,
}

// A visibility in a closure quantity, either counted from the first of its frame.
struct Leg {
    index: u32,
    sign: f32,
}

// What is compared of a visibility.
const FLUX = 0u;
const VISIBILITY = 1u;
const AMPLITUDE = 2u;
const CLOSED = 3u;

// Amplitudes at or below this have no phase and no logarithm: the square root of the least normal float.
const FAINTEST = 1.0842022e-19;
// The residual of the logarithm of a closure quantity that a model has not.
const DARK = 100.0;

@group(0) @binding(0) var<uniform> task: Task;
// East and north of rays, rad.
@group(0) @binding(1) var<storage, read> places: array<vec2<f32>>;
@group(0) @binding(2) var<storage, read> fluxes: array<f32>;
@group(0) @binding(3) var<storage, read> seen: array<Seen>;
// Of each frame of the piece, seen first .. last and closures first .. last.
@group(0) @binding(4) var<storage, read> frames: array<vec4<u32>>;
@group(0) @binding(5) var<storage, read_write> model: array<vec2<f32>>;
@group(0) @binding(6) var<storage, read_write> of_model: array<vec2<f32>>;
// Of each frame chi^2 of visibilities, then of closure quantities.
@group(0) @binding(7) var<storage, read_write> squares: array<f32>;
// What terms are multiplied by in the loss.
@group(0) @binding(8) var<storage, read> factors: array<f32>;
@group(0) @binding(9) var<storage, read> closures: array<Closure>;
@group(0) @binding(10) var<storage, read> legs: array<Leg>;
@group(0) @binding(11) var<storage, read> uses: array<Leg>;
@group(0) @binding(12) var<storage, read> inverses: array<f32>;
@group(0) @binding(13) var<storage, read_write> residuals: array<f32>;
// Of closure quantities the inverse covariance times residuals; 0 where a visibility is dark.
@group(0) @binding(14) var<storage, read_write> pulls: array<f32>;
@group(0) @binding(15) var<storage, read_write> slopes: array<f32>;
@group(0) @binding(16) var<storage, read_write> losses: array<f32>;

var<workgroup> shared_parts: array<vec2<f32>, 64>;
var<workgroup> shared_sums: array<f32, 256>;
var<workgroup> shared_uv: array<vec2<f32>, 64>;
var<workgroup> shared_slopes: array<vec2<f32>, 64>;

// exp(2 pi i (u l + v m)): the fma makes up for the rounding of u l, and whole turns are taken off
// before 2 pi rounds them.
fn wave(uv: vec2<f32>, place: vec2<f32>) -> vec2<f32> {
    let product = uv.x * place.x;
    let turns = product + fma(uv.y, place.y, fma(uv.x, place.x, -product));
    return kerr_cos_sin((turns - round(turns)) * (2.0 * KERR_PI));
}

// |z| where squares would underflow.
fn size(z: vec2<f32>) -> f32 {
    let most = max(abs(z.x), abs(z.y));
    if most == 0.0 {
        return 0.0;
    }
    return most * length(z / most);
}

@compute @workgroup_size(64)
fn look(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let ends = frames[group.y];
    let index = ends.x + group.x;
    if index >= ends.y {
        return;
    }
    let its = seen[index];
    let first = group.y * task.rays;
    var own = vec2<f32>(0.0);
    if its.kind == FLUX {
        for (var ray = lane; ray < task.rays; ray += 64u) {
            own.x += fluxes[first + ray];
        }
    } else {
        for (var ray = lane; ray < task.rays; ray += 64u) {
            own += fluxes[first + ray] * wave(its.uv, places[ray]);
        }
    }
    shared_parts[lane] = own;
    for (var half = 32u; half > 0u; half /= 2u) {
        workgroupBarrier();
        if lane < half {
            shared_parts[lane] += shared_parts[lane + half];
        }
    }
    if lane == 0u {
        model[group.y * task.most_seen + group.x] = its.pulse * shared_parts[0];
    }
}

@compute @workgroup_size(64)
fn compare(@builtin(global_invocation_id) at: vec3<u32>) {
    let ends = frames[at.y];
    let index = ends.x + at.x;
    if index >= ends.y {
        return;
    }
    let its = seen[index];
    let k = at.y * task.most_seen + at.x;
    let v = model[k];
    let factor = 2.0 * factors[its.term] * its.weight;
    var slope = vec2<f32>(0.0);
    var square = 0.0;
    if its.kind == VISIBILITY || its.kind == FLUX {
        let residual = v - its.datum;
        slope = factor * residual;
        square = its.weight * dot(residual, residual);
    } else if its.kind == AMPLITUDE {
        let amplitude = size(v);
        let residual = amplitude - its.datum.x;
        square = its.weight * residual * residual;
        if amplitude > FAINTEST {
            slope = (v / amplitude) * (factor * residual);
        }
    }
    of_model[k] = slope;
    squares[at.y * (task.most_seen + task.most_closures) + at.x] = square;
}

fn is_dark(its: Closure, first: u32) -> bool {
    var dark = false;
    for (var leg = its.first_leg; leg < its.last_leg; leg++) {
        dark = dark || !(size(model[first + legs[leg].index]) > FAINTEST);
    }
    return dark;
}

@compute @workgroup_size(64)
fn close(@builtin(global_invocation_id) at: vec3<u32>) {
    let ends = frames[at.y];
    let index = ends.z + at.x;
    if index >= ends.w {
        return;
    }
    let its = closures[index];
    let first = at.y * task.most_seen;
    var residual = -its.datum;
    for (var leg = its.first_leg; leg < its.last_leg; leg++) {
        let v = model[first + legs[leg].index];
        if its.is_phase == 1u {
            residual += legs[leg].sign * kerr_angle(v.y, v.x);
        } else {
            residual += legs[leg].sign * log(size(v));
        }
    }
    if its.is_phase == 1u {
        residual -= round(residual / (2.0 * KERR_PI)) * (2.0 * KERR_PI);
        // Rounding may leave a little more than half a turn.
        residual = clamp(residual, -KERR_PI, KERR_PI);
    }
    // After the sum, which is no number where a visibility is zero.
    if is_dark(its, first) {
        residual = select(DARK, KERR_PI, its.is_phase == 1u);
    }
    residuals[at.y * task.most_closures + at.x] = residual;
}

@compute @workgroup_size(64)
fn pull(@builtin(global_invocation_id) at: vec3<u32>) {
    let ends = frames[at.y];
    let index = ends.z + at.x;
    if index >= ends.w {
        return;
    }
    let its = closures[index];
    let first = at.y * task.most_closures;
    var sum = 0.0;
    for (var k = 0u; k < its.count; k++) {
        sum += inverses[its.row + k] * residuals[first + its.first + k];
    }
    let to = at.y * (task.most_seen + task.most_closures) + task.most_seen + at.x;
    squares[to] = residuals[first + at.x] * sum;
    pulls[first + at.x] = select(sum, 0.0, is_dark(its, at.y * task.most_seen));
}

// d arg V = Re(conj(iV) dV)/|V|^2, d ln|V| = Re(conj(V) dV)/|V|^2.
@compute @workgroup_size(64)
fn open(@builtin(global_invocation_id) at: vec3<u32>) {
    let ends = frames[at.y];
    let index = ends.x + at.x;
    if index >= ends.y {
        return;
    }
    let its = seen[index];
    if its.kind != CLOSED {
        return;
    }
    let k = at.y * task.most_seen + at.x;
    let v = model[k];
    let amplitude = size(v);
    if !(amplitude > FAINTEST) {
        return;
    }
    var sum = vec2<f32>(0.0);
    for (var j = its.first_use; j < its.last_use; j++) {
        let closure = uses[j].index;
        let along = select(v, vec2<f32>(-v.y, v.x), closures[ends.z + closure].is_phase == 1u);
        let pulled = uses[j].sign * pulls[at.y * task.most_closures + closure];
        sum += (along / amplitude) * (2.0 * factors[its.term] * pulled / amplitude);
    }
    of_model[k] = sum;
}

// A lane has a ray.
@compute @workgroup_size(64)
fn shine(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let ends = frames[group.y];
    let ray = group.x * 64u + lane;
    // Lanes behind the last ray go along: barriers need all of them.
    let place = places[min(ray, task.rays - 1u)];
    var sum = 0.0;
    for (var begin = ends.x; begin < ends.y; begin += 64u) {
        workgroupBarrier();
        let index = begin + lane;
        if index < ends.y {
            shared_uv[lane] = seen[index].uv;
            shared_slopes[lane] =
                seen[index].pulse * of_model[group.y * task.most_seen + index - ends.x];
        }
        workgroupBarrier();
        for (var k = 0u; k < min(64u, ends.y - begin); k++) {
            sum += dot(shared_slopes[k], wave(shared_uv[k], place));
        }
    }
    if ray < task.rays {
        slopes[group.y * task.rays + ray] += sum;
    }
}

// A workgroup has a term.
@compute @workgroup_size(256)
fn add_losses(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    var own = 0.0;
    for (var frame = 0u; frame < task.frames; frame++) {
        let ends = frames[frame];
        let first = frame * (task.most_seen + task.most_closures);
        for (var k = ends.x + lane; k < ends.y; k += 256u) {
            own += select(0.0, squares[first + k - ends.x], seen[k].term == group.x);
        }
        for (var k = ends.z + lane; k < ends.w; k += 256u) {
            let square = squares[first + task.most_seen + k - ends.z];
            own += select(0.0, square, closures[k].term == group.x);
        }
    }
    shared_sums[lane] = own;
    for (var half = 128u; half > 0u; half /= 2u) {
        workgroupBarrier();
        if lane < half {
            shared_sums[lane] += shared_sums[lane + half];
        }
    }
    if lane == 0u {
        losses[task.into * task.terms + group.x] += shared_sums[0];
    }
}
