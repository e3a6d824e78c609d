// Adam (Kingma & Ba 2015), a parameter an invocation.

struct Adam {
    beta: vec2<f32>,
    rest: vec2<f32>,     // 1 - beta
    unbiased: vec2<f32>, // 1/(1 - beta^steps)
    rate: f32,
    epsilon: f32,
    count: u32,
    row: u32,            // invocations in a row of the grid
    positive: u32,       // 1: parameters are held at zero or above
}

@group(0) @binding(0) var<uniform> rule: Adam;
@group(0) @binding(1) var<storage, read> gradient: array<f32>;
@group(0) @binding(2) var<storage, read_write> means: array<f32>;
@group(0) @binding(3) var<storage, read_write> mean_squares: array<f32>;
@group(0) @binding(4) var<storage, read_write> parameters: array<f32>;
// A bit for each parameter: 1 where something else takes the step.
@group(0) @binding(5) var<storage, read> left_out: array<u32>;

@compute @workgroup_size(64)
fn learn(@builtin(global_invocation_id) at: vec3<u32>) {
    let k = at.y * rule.row + at.x;
    if k >= rule.count || (left_out[k / 32u] >> (k % 32u) & 1u) == 1u {
        return;
    }
    let g = gradient[k];
    let m = fma(means[k], rule.beta.x, g * rule.rest.x);
    let v = fma(mean_squares[k], rule.beta.y, g * g * rule.rest.y);
    let root = sqrt(v * rule.unbiased.y) + rule.epsilon;
    let x = parameters[k] - rule.rate * (m * rule.unbiased.x) / root;
    means[k] = m;
    mean_squares[k] = v;
    parameters[k] = select(x, 0.0, rule.positive == 1u && x < 0.0);
}
