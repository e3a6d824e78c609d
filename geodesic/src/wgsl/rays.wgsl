// Whole rays: outcome, equatorial crossings, direction of escape, samples. One invocation a ray.

struct KerrEnd {
    exit: vec3<f32>,     // where the ray goes, if it escapes
    outcome: u32,
    flags: u32,
    crossings: u32,      // of the equatorial plane, along the whole ray
    mino_time: f32,      // of the whole ray
    error: f32,          // estimate: relative in r, radians in azimuth
    lambda: f32,
    eta: f32,
    steps: u32,
    turning: f32,        // Mino time of the radial turning point; negative if there is none
    within: vec2<f32>,   // Mino times of entry into the sphere and of leaving it; negative if it is not met
    pad: vec2<u32>,
}

struct KerrCrossing {
    radius: f32,
    azimuth: f32,
    mino_time: f32,
    delay: f32,
    rate: f32,           // dw/dtau
    polar_rate: f32,     // d cos theta/dtau
    error: f32,          // estimate: relative in r, radians in azimuth
    pad: f32,
}

@group(0) @binding(2) var<storage, read_write> kerr_end_of: array<KerrEnd>;
@group(0) @binding(3) var<storage, read_write> kerr_crossing_of: array<KerrCrossing>;
@group(0) @binding(4) var<storage, read_write> kerr_sample_of: array<vec4<f32>>;

// What rounding makes of the ray: that of every step, and of the minimum of W.
fn kerr_error(ray: KerrRay, steps: u32) -> f32 {
    let rounding = 1e-7 * f32(steps + 4u);
    return select(rounding, rounding + 1e-12 / max(abs(ray.height), 1e-20), ray.centre > 0.0);
}

// Traces ray `k`; if `total` is not 0, writes its samples instead, of which it is the Mino time of the whole.
fn kerr_follow(k: u32, total: f32) -> KerrEnd {
    let hole = kerr_task.hole;
    var walk: KerrWalk;
    var series: KerrSeries;
    var ray = kerr_begin(hole, kerr_task.place, kerr_arrive(kerr_points[k]), &walk);
    let quadratures = kerr_task.quadratures != 0u;
    var end = KerrEnd(vec3<f32>(0.0), ray.outcome, ray.flags, 0u, 0.0, 0.0, ray.lambda, ray.eta, 0u, -1.0, vec2<f32>(-1.0), vec2<u32>(0u));
    if ray.outcome == KERR_LOST {
        return end;
    }
    let count = kerr_task.samples;
    let ends = kerr_sample_ends(ray, count);
    var next = 0u;
    var done = false;
    while end.steps < KERR_MOST_STEPS {
        kerr_expand(ray, walk, quadratures, &series);
        var x = 0.0;
        done = kerr_ends(ray, walk, &series, &x);
        if total > 0.0 {
            while next < count {
                let share = ends.x + (ends.y - ends.x) * f32(next) / f32(max(count, 2u) - 1u);
                let at = share * total * ray.b - walk.s;
                if at > x && !done {
                    break;
                }
                let point = kerr_point(hole, ray, walk, &series, clamp(at, 0.0, x));
                let sin_theta = length(point.n.xy);
                let theta = kerr_angle(sin_theta, point.n.z);
                kerr_sample_of[k * count + next] = vec4<f32>(1.0 / point.inverse_radius, theta, point.azimuth, point.delay);
                next++;
            }
        } else {
            kerr_cross(k, ray, walk, &series, x, &end);
            kerr_reach(ray, walk, &series, x, &end);
        }
        end.steps++;
        if done {
            break;
        }
        kerr_advance(hole, ray, &walk, &series, x);
    }
    if done {
        let x = kerr_end_step(ray, &series);
        let last = kerr_point(hole, ray, walk, &series, x);
        let turn = kerr_cos_sin(last.azimuth - kerr_angle(last.n.y, last.n.x));
        let n = last.n;
        end.exit = normalize(vec3<f32>(turn.x * n.x - turn.y * n.y, turn.y * n.x + turn.x * n.y, n.z));
        end.mino_time = last.mino_time;
    } else {
        end.flags |= KERR_OUT_OF_STEPS;
        end.mino_time = walk.s / ray.b;
    }
    end.error = kerr_error(ray, end.steps);
    if (end.within.x >= 0.0) && (end.within.y < 0.0) {
        end.within.y = end.mino_time;
    }
    return end;
}

fn kerr_end_step(ray: KerrRay, series: ptr<function, KerrSeries>) -> f32 {
    return kerr_end_point(ray, series, (*series).h, ray.outcome == KERR_CAPTURED);
}

// First and last sample as shares of the whole ray: both ends, but for those at infinity.
fn kerr_sample_ends(ray: KerrRay, count: u32) -> vec2<f32> {
    let n = f32(count);
    if kerr_task.place.inverse_radius.x > 0.0 {
        return vec2<f32>(0.0, 1.0);
    }
    if ray.outcome == KERR_CAPTURED {
        return vec2<f32>(1.0 / n, 1.0);
    }
    return vec2<f32>(1.0 / (n + 1.0), n / (n + 1.0));
}

// Takes the crossing of the equatorial plane within the step, if there is one.
fn kerr_cross(
    k: u32,
    ray: KerrRay,
    walk: KerrWalk,
    series: ptr<function, KerrSeries>,
    x: f32,
    end: ptr<function, KerrEnd>,
) {
    let at = kerr_height(series, x);
    let above = select(at.x > 0.0, at.y > 0.0, at.x == 0.0);
    if above == kerr_above(walk.n, walk.dn) {
        return;
    }
    let number = (*end).crossings;
    (*end).crossings = number + 1u;
    if number >= kerr_task.crossings {
        (*end).flags |= KERR_MORE_CROSSINGS;
        return;
    }
    let point = kerr_point(kerr_task.hole, ray, walk, series, kerr_solve(series, true, 0.0, 0.0, x));
    kerr_crossing_of[k * kerr_task.crossings + number] = KerrCrossing(
        1.0 / point.inverse_radius,
        point.azimuth,
        point.mino_time,
        point.delay,
        point.rate,
        point.velocity.z,
        kerr_error(ray, (*end).steps),
        0.0,
    );
}

// Takes where the step turns, enters the sphere and leaves it.
fn kerr_reach(ray: KerrRay, walk: KerrWalk, series: ptr<function, KerrSeries>, x: f32, end: ptr<function, KerrEnd>) {
    if kerr_task.sphere <= 0.0 {
        return;
    }
    let edge = ray.b * kerr_task.sphere - ray.centre;
    let turning = kerr_turning(series, x);
    if turning < x {
        (*end).turning = (walk.s + turning) / ray.b;
    }
    if (walk.s == 0.0) && (walk.v >= edge) {
        (*end).within.x = 0.0;
    }
    kerr_pass(ray, walk, series, edge, vec2<f32>(0.0, turning), end);
    if turning < x {
        kerr_pass(ray, walk, series, edge, vec2<f32>(turning, x), end);
    }
}

// Takes whether the ray enters the sphere or leaves it on a part of the step on which the radius does not turn.
fn kerr_pass(
    ray: KerrRay,
    walk: KerrWalk,
    series: ptr<function, KerrSeries>,
    edge: f32,
    part: vec2<f32>,
    end: ptr<function, KerrEnd>,
) {
    let before = kerr_radial(series, part.x).x >= edge;
    let after = kerr_radial(series, part.y).x >= edge;
    if before == after {
        return;
    }
    let time = (walk.s + kerr_solve(series, false, edge, part.x, part.y)) / ray.b;
    if after {
        (*end).within.x = time;
    } else {
        (*end).within.y = time;
    }
}

@compute @workgroup_size(64)
fn kerr_trace(@builtin(global_invocation_id) id: vec3<u32>) {
    let k = id.y * kerr_task.row + id.x;
    if k < kerr_task.rays {
        kerr_end_of[k] = kerr_follow(k, 0.0);
    }
}

@compute @workgroup_size(64)
fn kerr_sample(@builtin(global_invocation_id) id: vec3<u32>) {
    let k = id.y * kerr_task.row + id.x;
    if k < kerr_task.rays {
        let total = kerr_end_of[k].mino_time;
        if total > 0.0 {
            _ = kerr_follow(k, total);
        }
    }
}
