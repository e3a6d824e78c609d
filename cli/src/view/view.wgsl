// The view: a disc in front of a sky, a fragment a ray. The tracer stands before it.

struct View {
    hole: KerrHole,
    place: KerrPlace,
    lens: KerrLens,
    size: vec2<f32>,
    tangent: f32,   // of half the field of view
    inner: f32,     // edges of the disc, in M
    outer: f32,
    disc: f32,      // 1: there is a disc
    sky: f32,       // 1: there is a sky
    shift: f32,     // 1: light is shifted
}

@group(0) @binding(0) var<uniform> view: View;

@vertex
fn corner(@builtin(vertex_index) k: u32) -> @builtin(position) vec4<f32> {
    return vec4<f32>(f32(k & 1u) * 4.0 - 1.0, f32(k >> 1u) * 4.0 - 1.0, 0.0, 1.0);
}

// The frequency of light from a circular orbit at r, or from the innermost one, over that at infinity.
fn shift_of(r: f32, lambda: f32) -> f32 {
    let a = view.hole.spin.x;
    let root = pow(r, 1.5);
    let clock = sqrt(1.0 - 3.0 / r + 2.0 * a / root) / (1.0 + a / root);
    return clock / (1.0 - lambda / (root + a));
}

fn disc_light(point: KerrPoint, lambda: f32) -> vec3<f32> {
    let r = 1.0 / point.inverse_radius;
    var g = 1.0;
    if view.shift > 0.5 {
        g = shift_of(r, lambda);
    }
    let spiral = 0.75 + 0.25 * sin(12.0 * log(r) + 2.0 * point.azimuth);
    let warm = vec3<f32>(1.0, 0.45, 0.15) * pow(vec3<f32>(g), vec3<f32>(3.0, 4.5, 6.0));
    return warm * spiral * pow(view.inner / r, 2.0) * 1.5;
}

fn sky_light(direction: vec3<f32>) -> vec3<f32> {
    let turns = kerr_angle(direction.y, direction.x) / (2.0 * KERR_PI);
    let height = kerr_angle(direction.z, length(direction.xy)) / KERR_PI;
    let line = min(abs(fract(24.0 * turns) - 0.5), abs(fract(12.0 * height) - 0.5));
    return mix(vec3<f32>(0.25, 0.4, 0.7), vec3<f32>(0.01, 0.02, 0.05), smoothstep(0.0, 0.06, line));
}

fn look(x: f32, y: f32) -> vec3<f32> {
    var walk: KerrWalk;
    var series: KerrSeries;
    let photon = kerr_through_lens(view.hole, view.place, view.lens, vec2<f32>(x, 0.0), vec2<f32>(y, 0.0));
    let ray = kerr_begin(view.hole, view.place, photon, &walk);
    if ray.outcome == KERR_LOST {
        return vec3<f32>(0.0);
    }
    for (var i = 0u; i < KERR_MOST_STEPS; i++) {
        kerr_expand(ray, walk, true, &series);
        var h = 0.0;
        let done = kerr_ends(ray, walk, &series, &h);
        if (view.disc > 0.5) && (kerr_above(walk.n, walk.dn) != (kerr_height(&series, h).x > 0.0)) {
            let point = kerr_point(view.hole, ray, walk, &series, kerr_solve(&series, true, 0.0, 0.0, h));
            let r = 1.0 / point.inverse_radius;
            if (r > view.inner) && (r < view.outer) {
                return disc_light(point, ray.lambda);
            }
        }
        if done {
            if (ray.outcome == KERR_CAPTURED) || (view.sky < 0.5) {
                return vec3<f32>(0.0);
            }
            let last = kerr_point(view.hole, ray, walk, &series, h);
            return sky_light(vec3<f32>(kerr_cos_sin(last.azimuth) * length(last.n.xy), last.n.z));
        }
        kerr_advance(view.hole, ray, &walk, &series, h);
    }
    return vec3<f32>(0.0);
}

@fragment
fn paint(@builtin(position) at: vec4<f32>) -> @location(0) vec4<f32> {
    let place = (at.xy - 0.5 * view.size) * view.tangent * 2.0 / view.size.x;
    let light = look(place.x, -place.y);
    return vec4<f32>(pow(1.0 - exp(-light), vec3<f32>(1.0 / 2.2)), 1.0);
}
