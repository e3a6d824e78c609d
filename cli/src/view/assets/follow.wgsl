// One ray with its numbers.

const CROSSINGS: u32 = 8u;
const POINTS: u32 = 2000u;

// 0: lambda, eta, outcome, flags. 1: points, crossings, largest 1/r, steps. 2 to 9: crossings (r, azimuth, delay,
// Mino time). 10 and on: points (x, y, z, delay).
@group(0) @binding(6) var<storage, read_write> trail: array<vec4<f32>>;

fn take(point: KerrPoint, count: ptr<function, u32>) {
    if (*count < POINTS) && (point.inverse_radius > view.march.x) {
        trail[2u + CROSSINGS + *count] = vec4<f32>(position(point), point.delay + view.delay);
        *count += 1u;
    }
}

@compute @workgroup_size(1)
fn follow() {
    var walk: KerrWalk;
    var series: KerrSeries;
    // The place of the picture stands where a panel has its size.
    let ray = kerr_begin(view.hole, view.place, arriving(view.size), &walk);
    var points = 0u;
    var crossings = 0u;
    var nearest = 0.0;
    var steps = 0u;
    var done = ray.outcome == KERR_LOST;
    for (; (steps < KERR_MOST_STEPS) && !done; steps++) {
        kerr_expand(ray, walk, true, &series);
        var h = 0.0;
        done = kerr_ends(ray, walk, &series, &h);
        if (kerr_above(walk.n, walk.dn) != (kerr_height(&series, h).x > 0.0)) && (crossings < CROSSINGS) {
            let p = kerr_point(view.hole, ray, walk, &series, kerr_solve(&series, true, 0.0, 0.0, h));
            trail[2u + crossings] = vec4<f32>(1.0 / p.inverse_radius, p.azimuth, p.delay + view.delay, p.mino_time);
            crossings++;
        }
        nearest = max(nearest, (kerr_radial(&series, kerr_turning(&series, h)).x + ray.centre) / ray.b);
        for (var k = 0.0; k < 12.0; k += 1.0) {
            take(kerr_point(view.hole, ray, walk, &series, h * k / 12.0), &points);
        }
        if done {
            take(kerr_point(view.hole, ray, walk, &series, h), &points);
        } else {
            kerr_advance(view.hole, ray, &walk, &series, h);
        }
    }
    trail[0] = vec4<f32>(ray.lambda, ray.eta, f32(ray.outcome), f32(ray.flags));
    trail[1] = vec4<f32>(f32(points), f32(crossings), nearest, f32(steps));
}
