// Places on rays at given Mino times. One invocation a ray.

struct KerrNode {
    inverse_radius: f32,
    cos_theta: f32,
    azimuth: f32,
    delay: f32,
    rate: f32,        // dw/dtau
    polar_rate: f32,  // d cos theta/dtau
    pad: vec2<f32>,
}

@group(0) @binding(2) var<storage, read> kerr_span_of: array<vec2<u32>>;  // first time of each ray, and their number
@group(0) @binding(3) var<storage, read> kerr_time_of: array<f32>;        // ascending along each ray
@group(0) @binding(4) var<storage, read_write> kerr_node_of: array<KerrNode>;

@compute @workgroup_size(64)
fn kerr_place(@builtin(global_invocation_id) id: vec3<u32>) {
    let k = id.y * kerr_task.row + id.x;
    if k >= kerr_task.rays {
        return;
    }
    let hole = kerr_task.hole;
    let span = kerr_span_of[k];
    var walk: KerrWalk;
    var series: KerrSeries;
    let ray = kerr_begin(hole, kerr_task.place, kerr_arrive(kerr_points[k]), &walk);
    var next = 0u;
    for (var step = 0u; (step < KERR_MOST_STEPS) && (next < span.y); step++) {
        kerr_expand(ray, walk, kerr_task.quadratures != 0u, &series);
        var x = 0.0;
        let done = kerr_ends(ray, walk, &series, &x);
        while next < span.y {
            let at = kerr_time_of[span.x + next] * ray.b - walk.s;
            if (at > x) && !done {
                break;
            }
            let p = kerr_point(hole, ray, walk, &series, clamp(at, 0.0, x));
            kerr_node_of[span.x + next] = KerrNode(
                p.inverse_radius,
                p.n.z,
                p.azimuth,
                p.delay,
                p.rate,
                p.velocity.z,
                vec2<f32>(0.0),
            );
            next++;
        }
        if done {
            break;
        }
        kerr_advance(hole, ray, &walk, &series, x);
    }
}
