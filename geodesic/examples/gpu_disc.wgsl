// A disc and a sky, put behind `kerrlight_geodesic::wgsl::library()`: what a renderer adds to the tracer.

struct Picture {
    hole: KerrHole,
    place: KerrPlace,
    lens: KerrLens,
    size: vec2<u32>,
    tangent: f32,   // of half the field of view
    inner: f32,     // edges of the disc, in M
    outer: f32,
    pad0: f32,
    pad1: f32,
    pad2: f32,
}

@group(0) @binding(0) var<uniform> picture: Picture;
@group(0) @binding(1) var<storage, read_write> pixels: array<vec4<f32>>;

// The frequency of light from a circular orbit at r, as a camera at rest far away sees it.
fn redshift(r: f32, lambda: f32) -> f32 {
    let a = picture.hole.spin.x;
    let root = pow(r, 1.5);
    let clock = sqrt(1.0 - 3.0 / r + 2.0 * a / root) / (1.0 + a / root);
    return clock / (1.0 - lambda / (root + a));
}

fn disc(point: KerrPoint, lambda: f32) -> vec3<f32> {
    let r = 1.0 / point.inverse_radius;
    let g = redshift(r, lambda);
    let spiral = 0.75 + 0.25 * sin(12.0 * log(r) + 2.0 * point.azimuth);
    let warm = vec3<f32>(1.0, 0.45, 0.15) * pow(vec3<f32>(g), vec3<f32>(3.0, 4.5, 6.0));
    return warm * spiral * pow(picture.inner / r, 2.0) * 1.5;
}

fn sky(direction: vec3<f32>) -> vec3<f32> {
    let turns = kerr_angle(direction.y, direction.x) / (2.0 * KERR_PI);
    let height = kerr_angle(direction.z, length(direction.xy)) / KERR_PI;
    let line = min(abs(fract(24.0 * turns) - 0.5), abs(fract(12.0 * height) - 0.5));
    return mix(vec3<f32>(0.25, 0.4, 0.7), vec3<f32>(0.01, 0.02, 0.05), smoothstep(0.0, 0.06, line));
}

// What is seen at a place of the picture plane.
fn look(x: vec2<f32>, y: vec2<f32>) -> vec4<f32> {
    var walk: KerrWalk;
    var series: KerrSeries;
    let photon = kerr_through_lens(picture.hole, picture.place, picture.lens, x, y);
    let ray = kerr_begin(picture.hole, picture.place, photon, &walk);
    for (var i = 0u; i < KERR_MOST_STEPS; i++) {
        kerr_expand(ray, walk, true, &series);
        var h = 0.0;
        let done = kerr_ends(ray, walk, &series, &h);
        if kerr_above(walk.n, walk.dn) != (kerr_height(&series, h).x > 0.0) {
            let at = kerr_solve(&series, true, 0.0, 0.0, h);
            let point = kerr_point(picture.hole, ray, walk, &series, at);
            let r = 1.0 / point.inverse_radius;
            if (r > picture.inner) && (r < picture.outer) {
                return vec4<f32>(disc(point, ray.lambda), r);
            }
        }
        if done {
            let last = kerr_point(picture.hole, ray, walk, &series, h);
            let flat = kerr_cos_sin(last.azimuth) * length(last.n.xy);
            return vec4<f32>(select(vec3<f32>(0.0), sky(vec3<f32>(flat, last.n.z)), ray.outcome == KERR_ESCAPED), 0.0);
        }
        kerr_advance(picture.hole, ray, &walk, &series, h);
    }
    return vec4<f32>(0.0);
}

@compute @workgroup_size(8, 8)
fn paint(@builtin(global_invocation_id) id: vec3<u32>) {
    if any(id.xy >= picture.size) {
        return;
    }
    let middle = 0.5 * vec2<f32>(picture.size);
    let place = (vec2<f32>(id.xy) + 0.5 - middle) * picture.tangent / middle.x;
    pixels[id.y * picture.size.x + id.x] = look(vec2<f32>(place.x, 0.0), vec2<f32>(-place.y, 0.0));
}
