// A ray under way: Taylor series, points on them, crossings, the end.

// The series about the present point, and the length of the step for which they hold.
fn kerr_expand(ray: KerrRay, walk: KerrWalk, quadratures: bool, series: ptr<function, KerrSeries>) {
    let two = ray.radial.x;
    let three = 1.5 * ray.radial.y;
    let four = 2.0 * ray.radial.z;
    var square: array<f32, KERR_TERMS>; // of v
    var high: array<f32, KERR_TERMS>;   // of cos theta
    (*series).v[0] = walk.v;
    (*series).v[1] = walk.dv;
    (*series).n[0] = walk.n;
    (*series).n[1] = walk.dn;
    for (var k = 0u; k + 2u < KERR_TERMS; k++) {
        var v2 = 0.0;
        var u2 = 0.0;
        for (var j = 0u; j <= k; j++) {
            v2 += (*series).v[j] * (*series).v[k - j];
            u2 += (*series).n[j].z * (*series).n[k - j].z;
        }
        square[k] = v2;
        high[k] = u2;
        var v3 = 0.0;
        var bend = vec3<f32>(0.0);
        for (var j = 0u; j <= k; j++) {
            v3 += square[j] * (*series).v[k - j];
            bend += high[j] * (*series).n[k - j];
        }
        let by = 1.0 / f32((k + 1u) * (k + 2u));
        (*series).v[k + 2u] = (two * (*series).v[k] + three * v2 + four * v3) * by;
        let pull = -ray.angular * (*series).n[k] - 2.0 * ray.tilt * bend;
        (*series).n[k + 2u] = (pull + vec3<f32>(0.0, 0.0, ray.tilt * (*series).n[k].z)) * by;
    }
    var h = kerr_step_length(walk, series);
    if quadratures {
        var inverse: array<f32, KERR_TERMS>; // of g
        var around: array<f32, KERR_TERMS>;  // w^2
        var g: array<f32, KERR_TERMS>;
        (*series).azimuth[0] = walk.azimuth;
        (*series).time[0] = walk.time;
        for (var k = 0u; k + 2u < KERR_TERMS; k++) {
            var w2 = square[k] + 2.0 * ray.centre * (*series).v[k];
            if k == 0u {
                let w = walk.v + ray.centre;
                w2 = w * w;
            }
            around[k] = w2;
            g[k] = ray.gauge * w2 + walk.leg * f32(k + 1u) * (*series).v[k + 1u];
            if k == 0u {
                g[0] += 1.0;
            }
            var rest = select(0.0, 1.0, k == 0u);
            for (var j = 1u; j <= k; j++) {
                rest -= g[j] * inverse[k - j];
            }
            inverse[k] = rest / g[0];
            var product = 0.0;
            for (var j = 0u; j <= k; j++) {
                product += around[j] * inverse[k - j];
            }
            let one = select(0.0, 1.0, k == 0u);
            let turn = one * ray.azimuth.x - ray.azimuth.y * product;
            let delay = ray.time.x * (inverse[k] + ray.tilt * product) + one * ray.time.y + ray.tilt * high[k];
            (*series).azimuth[k + 1u] = turn / f32(k + 1u);
            (*series).time[k + 1u] = delay / f32(k + 1u);
        }
        let last = KERR_TERMS - 2u;
        let size = abs((*series).azimuth[last]) + abs((*series).time[last]);
        h = min(h, kerr_root_length(KERR_TOLERANCE * 4.0, size, f32(last)));
    }
    (*series).h = h;
}

// (tolerance/size)^(1/order)
fn kerr_root_length(tolerance: f32, size: f32, order: f32) -> f32 {
    return exp2(log2(tolerance / max(size, 1e-30)) / order);
}

fn kerr_step_length(walk: KerrWalk, series: ptr<function, KerrSeries>) -> f32 {
    let scale = max(max(abs(walk.v), abs(walk.dv)), 1e-20);
    var h = 1.0;
    for (var k = KERR_ORDER - 1u; k <= KERR_ORDER; k++) {
        let turn = abs((*series).n[k]);
        let size = max(abs((*series).v[k]) / scale, max(turn.x, max(turn.y, turn.z)));
        h = min(h, kerr_root_length(KERR_TOLERANCE, size, f32(k)));
    }
    return h;
}

// Value and derivative of the radial series. Written out, here and below: software devices count the turns of loops.
fn kerr_radial(series: ptr<function, KerrSeries>, x: f32) -> vec2<f32> {
    var p = vec2<f32>((*series).v[10], 0.0);
    p = kerr_horner(p, x, (*series).v[9]);
    p = kerr_horner(p, x, (*series).v[8]);
    p = kerr_horner(p, x, (*series).v[7]);
    p = kerr_horner(p, x, (*series).v[6]);
    p = kerr_horner(p, x, (*series).v[5]);
    p = kerr_horner(p, x, (*series).v[4]);
    p = kerr_horner(p, x, (*series).v[3]);
    p = kerr_horner(p, x, (*series).v[2]);
    p = kerr_horner(p, x, (*series).v[1]);
    p = kerr_horner(p, x, (*series).v[0]);
    return p;
}

// The same of the series of cos theta.
fn kerr_height(series: ptr<function, KerrSeries>, x: f32) -> vec2<f32> {
    var p = vec2<f32>((*series).n[10].z, 0.0);
    p = kerr_horner(p, x, (*series).n[9].z);
    p = kerr_horner(p, x, (*series).n[8].z);
    p = kerr_horner(p, x, (*series).n[7].z);
    p = kerr_horner(p, x, (*series).n[6].z);
    p = kerr_horner(p, x, (*series).n[5].z);
    p = kerr_horner(p, x, (*series).n[4].z);
    p = kerr_horner(p, x, (*series).n[3].z);
    p = kerr_horner(p, x, (*series).n[2].z);
    p = kerr_horner(p, x, (*series).n[1].z);
    p = kerr_horner(p, x, (*series).n[0].z);
    return p;
}

fn kerr_horner(p: vec2<f32>, x: f32, next: f32) -> vec2<f32> {
    return vec2<f32>(fma(p.x, x, next), fma(p.y, x, p.x));
}

// Direction, its derivative, and the quadratures of azimuth and time.
struct KerrSum {
    n: vec3<f32>,
    dn: vec3<f32>,
    quadratures: vec2<f32>,
}

fn kerr_sum(series: ptr<function, KerrSeries>, x: f32) -> KerrSum {
    var sum = KerrSum((*series).n[10], vec3<f32>(0.0), vec2<f32>(0.0));
    sum = kerr_next(sum, x, series, 9u);
    sum = kerr_next(sum, x, series, 8u);
    sum = kerr_next(sum, x, series, 7u);
    sum = kerr_next(sum, x, series, 6u);
    sum = kerr_next(sum, x, series, 5u);
    sum = kerr_next(sum, x, series, 4u);
    sum = kerr_next(sum, x, series, 3u);
    sum = kerr_next(sum, x, series, 2u);
    sum = kerr_next(sum, x, series, 1u);
    sum = kerr_next(sum, x, series, 0u);
    return sum;
}

fn kerr_next(sum: KerrSum, x: f32, series: ptr<function, KerrSeries>, k: u32) -> KerrSum {
    let quadratures = vec2<f32>((*series).azimuth[k], (*series).time[k]);
    return KerrSum(sum.n * x + (*series).n[k], sum.dn * x + sum.n, sum.quadratures * x + quadratures);
}

// Where between `start` and `stop` the radial series (or, if polar, that of cos theta) has a value that lies between
// those there.
fn kerr_solve(series: ptr<function, KerrSeries>, polar: bool, value: f32, start: f32, stop: f32) -> f32 {
    var low = start;
    var high = stop;
    let h = stop - start;
    var first = kerr_radial(series, start).x;
    if polar {
        first = kerr_height(series, start).x;
    }
    let below = first < value;
    var x = 0.5 * (start + stop);
    for (var i = 0u; i < 24u; i++) {
        var at = kerr_radial(series, x);
        if polar {
            at = kerr_height(series, x);
        }
        if (at.x < value) == below {
            low = x;
        } else {
            high = x;
        }
        let next = x - (at.x - value) / at.y;
        if abs(next - x) <= 1e-6 * h {
            return clamp(next, start, stop);
        }
        x = select(0.5 * (low + high), next, (next > low) && (next < high));
    }
    return x;
}

// Where in the step the radius turns, if it does; else its end.
fn kerr_turning(series: ptr<function, KerrSeries>, x: f32) -> f32 {
    let rises = (*series).v[1] > 0.0;
    if (kerr_radial(series, x).y > 0.0) == rises {
        return x;
    }
    var low = 0.0;
    var high = x;
    for (var i = 0u; i < 22u; i++) {
        let middle = 0.5 * (low + high);
        if (kerr_radial(series, middle).y > 0.0) == rises {
            low = middle;
        } else {
            high = middle;
        }
    }
    return 0.5 * (low + high);
}

// The angle about the axis from one horizontal direction to another, in the sense of the ray.
fn kerr_turn(sense: f32, from_: vec2<f32>, to: vec2<f32>) -> f32 {
    let angle = kerr_angle(from_.x * to.y - from_.y * to.x, dot(from_, to));
    return select(angle, angle + 2.0 * KERR_PI * sense, angle * sense < -0.5 * KERR_PI);
}

// The point after x of scaled Mino time from where the series were taken.
fn kerr_point(hole: KerrHole, ray: KerrRay, walk: KerrWalk, series: ptr<function, KerrSeries>, x: f32) -> KerrPoint {
    let radial = kerr_radial(series, x);
    let sum = kerr_sum(series, x);
    let n = sum.n;
    let dn = sum.dn;
    let w = max((radial.x + ray.centre) / ray.b, 0.0);
    let turned = walk.turned + kerr_turn(ray.sense, walk.heading, kerr_heading(n, dn));
    let closed = walk.leg * hole.spin.x * kerr_horizon_log(hole, w);
    var delay = 0.0;
    if w > 0.0 {
        delay = ray.b * sum.quadratures.y + (walk.time_start - walk.leg * kerr_tortoise(hole, w));
    }
    return KerrPoint(
        w,
        radial.y,
        n,
        dn * ray.b,
        turned + (sum.quadratures.x + (walk.azimuth_start + closed)),
        delay,
        (walk.s + x) / ray.b,
    );
}

// Goes on by x, and puts the state back on its constraints: (dw/dtau)^2 = W, |n| = 1, n.n' = 0, |n'|^2 = K + a^2 u^2.
fn kerr_advance(hole: KerrHole, ray: KerrRay, walk: ptr<function, KerrWalk>, series: ptr<function, KerrSeries>, x: f32) {
    let radial = kerr_radial(series, x);
    let sum = kerr_sum(series, x);
    var n = sum.n;
    var dn = sum.dn;
    n = n * (1.5 - 0.5 * dot(n, n));
    dn = dn - n * dot(n, dn);
    let speed = ray.angular + ray.tilt * n.z * n.z;
    let square = dot(dn, dn);
    if square > 1e-6 && speed > 0.0 {
        dn = dn * (0.5 + 0.5 * speed / square);
    }
    let heading = kerr_heading(n, dn);
    (*walk).turned += kerr_turn(ray.sense, (*walk).heading, heading);
    (*walk).heading = heading;
    (*walk).n = n;
    (*walk).dn = dn;
    (*walk).azimuth = sum.quadratures.x;
    (*walk).time = sum.quadratures.y;
    (*walk).s += x;
    let kept = kerr_project(ray, radial, (*walk).leg);
    (*walk).v = kept.x;
    (*walk).dv = kept.y;
    if (*walk).leg * kept.y < 0.0 {
        // On an outward leg g has -dw/dtau and the closed forms change sign; the constants take up the difference.
        let w = max((kept.x + ray.centre) / ray.b, 1e-30);
        (*walk).azimuth_start += 2.0 * (*walk).leg * hole.spin.x * kerr_horizon_log(hole, w);
        (*walk).time_start -= 2.0 * (*walk).leg * kerr_tortoise(hole, w);
        (*walk).leg = -(*walk).leg;
    }
}

// The nearest point with dv^2 = W(v).
fn kerr_project(ray: KerrRay, at: vec2<f32>, leg: f32) -> vec2<f32> {
    let w = kerr_w(ray, at.x);
    if !ray.turns {
        return vec2<f32>(at.x, leg * sqrt(max(w, 0.0)));
    }
    let slope = at.x * (2.0 * ray.radial.x + at.x * (3.0 * ray.radial.y + at.x * 4.0 * ray.radial.z));
    let gradient = vec2<f32>(-slope, 2.0 * at.y);
    let size = dot(gradient, gradient);
    if size == 0.0 {
        return at;
    }
    return at - gradient * ((at.y * at.y - w) / size);
}

// Whether the ray ends within the step; x is then where.
fn kerr_ends(ray: KerrRay, walk: KerrWalk, series: ptr<function, KerrSeries>, x: ptr<function, f32>) -> bool {
    let h = (*series).h;
    let at = kerr_radial(series, h);
    let falls = ray.outcome == KERR_CAPTURED;
    let below = at.x <= ray.last;
    let there = select(below && (at.y < 0.0), !below || (at.x == ray.last), falls);
    if !there {
        *x = h;
        return false;
    }
    *x = kerr_end_point(ray, series, h, falls);
    return true;
}

// On the way out the series may still be on its way in at the start of the step: the end is where it falls below.
fn kerr_end_point(ray: KerrRay, series: ptr<function, KerrSeries>, h: f32, falls: bool) -> f32 {
    let start = (*series).v[0];
    let before = select((start > ray.last), (start < ray.last), falls);
    if before {
        return kerr_solve(series, false, ray.last, 0.0, h);
    }
    return h;
}

// On which side of the equatorial plane a ray is, or is about to be.
fn kerr_above(n: vec3<f32>, dn: vec3<f32>) -> bool {
    return select(n.z > 0.0, dn.z > 0.0, n.z == 0.0);
}
