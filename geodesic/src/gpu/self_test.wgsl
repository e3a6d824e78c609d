struct KerrSelfTest {
    veil: u32,
    pad0: u32,
    pad1: u32,
    pad2: u32,
}

@group(0) @binding(0) var<uniform> kerr_test: KerrSelfTest;
@group(0) @binding(1) var<storage, read> kerr_pairs: array<vec2<f32>>;
@group(0) @binding(2) var<storage, read_write> kerr_results: array<vec4<f32>>;

@compute @workgroup_size(64)
fn kerr_self_test(@builtin(global_invocation_id) id: vec3<u32>) {
    kerr_veil = kerr_test.veil;
    if id.x < arrayLength(&kerr_pairs) {
        let pair = kerr_pairs[id.x];
        kerr_results[id.x] = vec4<f32>(kerr_two_sum(pair.x, pair.y), kerr_two_product(pair.x, pair.y));
    }
}
