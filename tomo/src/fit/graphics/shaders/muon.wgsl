// Muon (Jordan et al. 2024): matrices step along the orthogonal matrix nearest to their mean gradient, which an iteration
// X <- aX + bXX'X + c(XX')^2 X finds. The products are those of 16 x 16 tiles.

struct Muon {
    keep: f32,   // decay rate of the mean gradient
    rest: f32,   // 1 - keep
    factor: f32, // minus the learning rate times the scale
    spare: f32,
    quintic: vec4<f32>, // a, b, c of the iteration
}

// A matrix among the parameters, and where its work is: X, the next X, X'X or XX' (whichever is smaller), and what X is
// multiplied with.
struct Matrix {
    offset: u32,
    rows: u32,
    columns: u32,
    side: u32, // the smaller of the two
    places: vec4<u32>,
}

// Which of the two is X, and the other one the next.
struct Turn {
    current: u32,
    next: u32,
}

@group(0) @binding(0) var<uniform> rule: Muon;
@group(0) @binding(1) var<storage, read> matrices: array<Matrix>;
@group(0) @binding(2) var<uniform> turn: Turn;
@group(0) @binding(3) var<storage, read> gradient: array<f32>;
@group(0) @binding(4) var<storage, read_write> means: array<f32>;
@group(0) @binding(5) var<storage, read_write> parameters: array<f32>;
@group(0) @binding(6) var<storage, read_write> work: array<f32>;

const TILE: u32 = 16u;
const GROUP: u32 = 256u;
// One over a smaller number may be none.
const SMALLEST = 1e-37;

// Renews the mean gradient; X is where it will be after one more step of the same gradient.
@compute @workgroup_size(64)
fn look_ahead(@builtin(global_invocation_id) at: vec3<u32>) {
    let matrix = matrices[at.y];
    if at.x >= matrix.rows * matrix.columns {
        return;
    }
    let k = matrix.offset + at.x;
    let g = rule.rest * gradient[k];
    let mean = fma(rule.keep, means[k], g);
    means[k] = mean;
    work[matrix.places.x + at.x] = fma(rule.keep, mean, g);
}

var<workgroup> squares: array<f32, GROUP>;

// X over the root of the sum of its squares; zero stays zero.
@compute @workgroup_size(GROUP)
fn normalise(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) at: u32) {
    let matrix = matrices[group.y];
    let count = matrix.rows * matrix.columns;
    // The largest number first: squares of small gradients are no floats.
    var largest = 0.0;
    for (var k = at; k < count; k += GROUP) {
        largest = max(largest, abs(work[matrix.places.x + k]));
    }
    squares[at] = largest;
    workgroupBarrier();
    for (var half = GROUP / 2u; half > 0u; half /= 2u) {
        if at < half {
            squares[at] = max(squares[at], squares[at + half]);
        }
        workgroupBarrier();
    }
    largest = squares[0];
    // All have read before `squares` is used again.
    workgroupBarrier();
    let unit = select(1.0 / largest, 0.0, largest < SMALLEST);
    var sum = 0.0;
    for (var k = at; k < count; k += GROUP) {
        let x = work[matrix.places.x + k] * unit;
        sum = fma(x, x, sum);
    }
    squares[at] = sum;
    workgroupBarrier();
    for (var half = GROUP / 2u; half > 0u; half /= 2u) {
        if at < half {
            squares[at] += squares[at + half];
        }
        workgroupBarrier();
    }
    let scale = select(unit / sqrt(squares[0]), 0.0, largest < SMALLEST);
    for (var k = at; k < count; k += GROUP) {
        work[matrix.places.x + k] *= scale;
    }
}

// A matrix in `work`: the number at (i, j) is that at place + i * steps.x + j * steps.y.
struct Operand {
    place: u32,
    steps: vec2<u32>,
}

var<workgroup> left_tile: array<f32, 256>;
var<workgroup> right_tile: array<f32, 256>;

fn entry(operand: Operand, at: vec2<u32>, size: vec2<u32>) -> f32 {
    if at.x >= size.x || at.y >= size.y {
        return 0.0;
    }
    return work[operand.place + at.x * operand.steps.x + at.y * operand.steps.y];
}

// Number `at` of the product of a `size.x` x `size.y` matrix and a `size.y` x `size.z` one.
fn product(left: Operand, right: Operand, size: vec3<u32>, at: vec2<u32>, here: vec2<u32>) -> f32 {
    let mine = here.y * TILE + here.x;
    var sum = 0.0;
    for (var start = 0u; start < size.y; start += TILE) {
        left_tile[mine] = entry(left, vec2(at.y, start + here.x), size.xy);
        right_tile[mine] = entry(right, vec2(start + here.y, at.x), size.yz);
        workgroupBarrier();
        for (var k = 0u; k < TILE; k++) {
            sum = fma(left_tile[here.y * TILE + k], right_tile[k * TILE + here.x], sum);
        }
        workgroupBarrier();
    }
    return sum;
}

fn by_rows(place: u32, columns: u32) -> Operand {
    return Operand(place, vec2(columns, 1u));
}

fn transposed(operand: Operand) -> Operand {
    return Operand(operand.place, operand.steps.yx);
}

// Column and row of a number in tile `group.x` of a matrix with so many columns.
fn position(group: vec3<u32>, here: vec2<u32>, columns: u32) -> vec2<u32> {
    let across = (columns + TILE - 1u) / TILE;
    return vec2(group.x % across, group.x / across) * TILE + here;
}

@compute @workgroup_size(16, 16)
fn gram(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_id) local: vec3<u32>) {
    let matrix = matrices[group.y];
    let side = matrix.side;
    let at = position(group, local.xy, side);
    let x = by_rows(matrix.places[turn.current], matrix.columns);
    var sum = 0.0;
    // X'X or XX', whichever is smaller: X(X'X) = (XX')X.
    if matrix.rows > matrix.columns {
        sum = product(transposed(x), x, vec3(side, matrix.rows, side), at, local.xy);
    } else {
        sum = product(x, transposed(x), vec3(side, matrix.columns, side), at, local.xy);
    }
    if at.x < side && at.y < side {
        work[matrix.places.z + at.y * side + at.x] = sum;
    }
}

// bG + cGG.
@compute @workgroup_size(16, 16)
fn power(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_id) local: vec3<u32>) {
    let matrix = matrices[group.y];
    let side = matrix.side;
    let at = position(group, local.xy, side);
    let gram = by_rows(matrix.places.z, side);
    let sum = product(gram, gram, vec3(side), at, local.xy);
    if at.x < side && at.y < side {
        let k = at.y * side + at.x;
        work[matrix.places.w + k] = fma(rule.quintic.z, sum, rule.quintic.y * work[matrix.places.z + k]);
    }
}

// The next X.
@compute @workgroup_size(16, 16)
fn advance(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_id) local: vec3<u32>) {
    let matrix = matrices[group.y];
    let at = position(group, local.xy, matrix.columns);
    let x = by_rows(matrix.places[turn.current], matrix.columns);
    let power = by_rows(matrix.places.w, matrix.side);
    var sum = 0.0;
    if matrix.rows > matrix.columns {
        sum = product(x, power, vec3(matrix.rows, matrix.side, matrix.columns), at, local.xy);
    } else {
        sum = product(power, x, vec3(matrix.rows, matrix.side, matrix.columns), at, local.xy);
    }
    if at.x < matrix.columns && at.y < matrix.rows {
        let k = at.y * matrix.columns + at.x;
        work[matrix.places[turn.next] + k] = fma(rule.quintic.x, work[matrix.places[turn.current] + k], sum);
    }
}

// The step along what the iteration has led to.
@compute @workgroup_size(64)
fn step_along(@builtin(global_invocation_id) at: vec3<u32>) {
    let matrix = matrices[at.y];
    if at.x >= matrix.rows * matrix.columns {
        return;
    }
    let k = matrix.offset + at.x;
    parameters[k] = fma(rule.factor, work[matrix.places[turn.current] + at.x], parameters[k]);
}
