// A ray under way: Taylor series, points on them, crossings, the end.

// The series about the present point, and the length of the step for which they hold. All is written out: in
// a loop the numbers would lie in memory instead of registers, and rays take eight times as long.
fn kerr_expand(ray: KerrRay, walk: KerrWalk, quadratures: bool, series: ptr<function, KerrSeries>) {
    // Of v: the powers s = v^2 and c = v^3; of the direction n: z = cos^2 theta and b = z n.
    let radial = vec3<f32>(ray.radial.x, 1.5 * ray.radial.y, 2.0 * ray.radial.z);
    let v0 = walk.v;
    let v1 = walk.dv;
    let n0 = walk.n;
    let n1 = walk.dn;
    let s0 = v0 * v0;
    let z0 = n0.z * n0.z;
    let c0 = s0 * v0;
    let b0 = z0 * n0;
    let v2 = dot(radial, vec3<f32>(v0, s0, c0)) * (1.0 / 2.0);
    let n2 = kerr_bent(ray, n0, b0) * (1.0 / 2.0);
    let s1 = 2.0 * v0 * v1;
    let z1 = 2.0 * n0.z * n1.z;
    let c1 = s0 * v1 + s1 * v0;
    let b1 = z0 * n1 + z1 * n0;
    let v3 = dot(radial, vec3<f32>(v1, s1, c1)) * (1.0 / 6.0);
    let n3 = kerr_bent(ray, n1, b1) * (1.0 / 6.0);
    let s2 = 2.0 * v0 * v2 + v1 * v1;
    let z2 = 2.0 * n0.z * n2.z + n1.z * n1.z;
    let c2 = s0 * v2 + s1 * v1 + s2 * v0;
    let b2 = z0 * n2 + z1 * n1 + z2 * n0;
    let v4 = dot(radial, vec3<f32>(v2, s2, c2)) * (1.0 / 12.0);
    let n4 = kerr_bent(ray, n2, b2) * (1.0 / 12.0);
    let s3 = 2.0 * (v0 * v3 + v1 * v2);
    let z3 = 2.0 * (n0.z * n3.z + n1.z * n2.z);
    let c3 = s0 * v3 + s1 * v2 + s2 * v1 + s3 * v0;
    let b3 = z0 * n3 + z1 * n2 + z2 * n1 + z3 * n0;
    let v5 = dot(radial, vec3<f32>(v3, s3, c3)) * (1.0 / 20.0);
    let n5 = kerr_bent(ray, n3, b3) * (1.0 / 20.0);
    let s4 = 2.0 * (v0 * v4 + v1 * v3) + v2 * v2;
    let z4 = 2.0 * (n0.z * n4.z + n1.z * n3.z) + n2.z * n2.z;
    let c4 = s0 * v4 + s1 * v3 + s2 * v2 + s3 * v1 + s4 * v0;
    let b4 = z0 * n4 + z1 * n3 + z2 * n2 + z3 * n1 + z4 * n0;
    let v6 = dot(radial, vec3<f32>(v4, s4, c4)) * (1.0 / 30.0);
    let n6 = kerr_bent(ray, n4, b4) * (1.0 / 30.0);
    let s5 = 2.0 * (v0 * v5 + v1 * v4 + v2 * v3);
    let z5 = 2.0 * (n0.z * n5.z + n1.z * n4.z + n2.z * n3.z);
    let c5 = s0 * v5 + s1 * v4 + s2 * v3 + s3 * v2 + s4 * v1 + s5 * v0;
    let b5 = z0 * n5 + z1 * n4 + z2 * n3 + z3 * n2 + z4 * n1 + z5 * n0;
    let v7 = dot(radial, vec3<f32>(v5, s5, c5)) * (1.0 / 42.0);
    let n7 = kerr_bent(ray, n5, b5) * (1.0 / 42.0);
    let s6 = 2.0 * (v0 * v6 + v1 * v5 + v2 * v4) + v3 * v3;
    let z6 = 2.0 * (n0.z * n6.z + n1.z * n5.z + n2.z * n4.z) + n3.z * n3.z;
    let c6 = s0 * v6 + s1 * v5 + s2 * v4 + s3 * v3 + s4 * v2 + s5 * v1 + s6 * v0;
    let b6 = z0 * n6 + z1 * n5 + z2 * n4 + z3 * n3 + z4 * n2 + z5 * n1 + z6 * n0;
    let v8 = dot(radial, vec3<f32>(v6, s6, c6)) * (1.0 / 56.0);
    let n8 = kerr_bent(ray, n6, b6) * (1.0 / 56.0);
    let s7 = 2.0 * (v0 * v7 + v1 * v6 + v2 * v5 + v3 * v4);
    let z7 = 2.0 * (n0.z * n7.z + n1.z * n6.z + n2.z * n5.z + n3.z * n4.z);
    let c7 = s0 * v7 + s1 * v6 + s2 * v5 + s3 * v4 + s4 * v3 + s5 * v2 + s6 * v1 + s7 * v0;
    let b7 = z0 * n7 + z1 * n6 + z2 * n5 + z3 * n4 + z4 * n3 + z5 * n2 + z6 * n1 + z7 * n0;
    let v9 = dot(radial, vec3<f32>(v7, s7, c7)) * (1.0 / 72.0);
    let n9 = kerr_bent(ray, n7, b7) * (1.0 / 72.0);
    let s8 = 2.0 * (v0 * v8 + v1 * v7 + v2 * v6 + v3 * v5) + v4 * v4;
    let z8 = 2.0 * (n0.z * n8.z + n1.z * n7.z + n2.z * n6.z + n3.z * n5.z) + n4.z * n4.z;
    let c8 = s0 * v8 + s1 * v7 + s2 * v6 + s3 * v5 + s4 * v4 + s5 * v3 + s6 * v2 + s7 * v1 + s8 * v0;
    let b8 = z0 * n8 + z1 * n7 + z2 * n6 + z3 * n5 + z4 * n4 + z5 * n3 + z6 * n2 + z7 * n1 + z8 * n0;
    let v10 = dot(radial, vec3<f32>(v8, s8, c8)) * (1.0 / 90.0);
    let n10 = kerr_bent(ray, n8, b8) * (1.0 / 90.0);
    (*series).v = array<f32, KERR_TERMS>(v0, v1, v2, v3, v4, v5, v6, v7, v8, v9, v10);
    (*series).n = array<vec3<f32>, KERR_TERMS>(n0, n1, n2, n3, n4, n5, n6, n7, n8, n9, n10);
    let scale = max(max(abs(v0), abs(v1)), 1e-20);
    let before = max(abs(v9) / scale, kerr_largest(n9));
    let last = max(abs(v10) / scale, kerr_largest(n10));
    var h = min(1.0, kerr_root_length(KERR_TOLERANCE, before, 9.0));
    h = min(h, kerr_root_length(KERR_TOLERANCE, last, 10.0));
    if quadratures {
        let s = array<f32, 9>(s0, s1, s2, s3, s4, s5, s6, s7, s8);
        let z = array<f32, 9>(z0, z1, z2, z3, z4, z5, z6, z7, z8);
        let size = kerr_integrate(ray, walk, s, z, series);
        h = min(h, kerr_root_length(KERR_TOLERANCE * 4.0, size, 9.0));
    }
    (*series).h = h;
}

// Second derivative of the direction, of itself and of cos^2 theta times itself.
fn kerr_bent(ray: KerrRay, n: vec3<f32>, b: vec3<f32>) -> vec3<f32> {
    return vec3<f32>(0.0, 0.0, ray.tilt * n.z) - ray.angular * n - 2.0 * ray.tilt * b;
}

fn kerr_largest(x: vec3<f32>) -> f32 {
    let size = abs(x);
    return max(size.x, max(size.y, size.z));
}

// The series of azimuth and time, from those of v, s = v^2 and z = cos^2 theta: w^2, g, i = 1/g, p = w^2/g and the rates q. The
// size of their last terms.
fn kerr_integrate(
    ray: KerrRay,
    walk: KerrWalk,
    s: array<f32, 9>,
    z: array<f32, 9>,
    series: ptr<function, KerrSeries>,
) -> f32 {
    let v = (*series).v;
    let twice = 2.0 * ray.centre;
    let w = v[0] + ray.centre;
    let w0 = w * w;
    let g0 = ray.gauge * w0 + walk.leg * 1.0 * v[1] + 1.0;
    let i0 = 1.0 / g0;
    let p0 = w0 * i0;
    let q0 = kerr_rates(ray, vec3<f32>(i0, p0, z[0])) + vec2<f32>(ray.azimuth.x, ray.time.y);
    let w1 = s[1] + twice * v[1];
    let g1 = ray.gauge * w1 + walk.leg * 2.0 * v[2];
    let i1 = -i0 * (g1 * i0);
    let p1 = w0 * i1 + w1 * i0;
    let q1 = kerr_rates(ray, vec3<f32>(i1, p1, z[1]));
    let w2 = s[2] + twice * v[2];
    let g2 = ray.gauge * w2 + walk.leg * 3.0 * v[3];
    let i2 = -i0 * (g1 * i1 + g2 * i0);
    let p2 = w0 * i2 + w1 * i1 + w2 * i0;
    let q2 = kerr_rates(ray, vec3<f32>(i2, p2, z[2]));
    let w3 = s[3] + twice * v[3];
    let g3 = ray.gauge * w3 + walk.leg * 4.0 * v[4];
    let i3 = -i0 * (g1 * i2 + g2 * i1 + g3 * i0);
    let p3 = w0 * i3 + w1 * i2 + w2 * i1 + w3 * i0;
    let q3 = kerr_rates(ray, vec3<f32>(i3, p3, z[3]));
    let w4 = s[4] + twice * v[4];
    let g4 = ray.gauge * w4 + walk.leg * 5.0 * v[5];
    let i4 = -i0 * (g1 * i3 + g2 * i2 + g3 * i1 + g4 * i0);
    let p4 = w0 * i4 + w1 * i3 + w2 * i2 + w3 * i1 + w4 * i0;
    let q4 = kerr_rates(ray, vec3<f32>(i4, p4, z[4]));
    let w5 = s[5] + twice * v[5];
    let g5 = ray.gauge * w5 + walk.leg * 6.0 * v[6];
    let i5 = -i0 * (g1 * i4 + g2 * i3 + g3 * i2 + g4 * i1 + g5 * i0);
    let p5 = w0 * i5 + w1 * i4 + w2 * i3 + w3 * i2 + w4 * i1 + w5 * i0;
    let q5 = kerr_rates(ray, vec3<f32>(i5, p5, z[5]));
    let w6 = s[6] + twice * v[6];
    let g6 = ray.gauge * w6 + walk.leg * 7.0 * v[7];
    let i6 = -i0 * (g1 * i5 + g2 * i4 + g3 * i3 + g4 * i2 + g5 * i1 + g6 * i0);
    let p6 = w0 * i6 + w1 * i5 + w2 * i4 + w3 * i3 + w4 * i2 + w5 * i1 + w6 * i0;
    let q6 = kerr_rates(ray, vec3<f32>(i6, p6, z[6]));
    let w7 = s[7] + twice * v[7];
    let g7 = ray.gauge * w7 + walk.leg * 8.0 * v[8];
    let i7 = -i0 * (g1 * i6 + g2 * i5 + g3 * i4 + g4 * i3 + g5 * i2 + g6 * i1 + g7 * i0);
    let p7 = w0 * i7 + w1 * i6 + w2 * i5 + w3 * i4 + w4 * i3 + w5 * i2 + w6 * i1 + w7 * i0;
    let q7 = kerr_rates(ray, vec3<f32>(i7, p7, z[7]));
    let w8 = s[8] + twice * v[8];
    let g8 = ray.gauge * w8 + walk.leg * 9.0 * v[9];
    let i8 = -i0 * (g1 * i7 + g2 * i6 + g3 * i5 + g4 * i4 + g5 * i3 + g6 * i2 + g7 * i1 + g8 * i0);
    let p8 = w0 * i8 + w1 * i7 + w2 * i6 + w3 * i5 + w4 * i4 + w5 * i3 + w6 * i2 + w7 * i1 + w8 * i0;
    let q8 = kerr_rates(ray, vec3<f32>(i8, p8, z[8]));
    let third = 1.0 / 3.0;
    (*series).azimuth = array<f32, KERR_TERMS>(
        walk.azimuth, q0.x, 0.5 * q1.x, third * q2.x, 0.25 * q3.x, 0.2 * q4.x, 0.5 * third * q5.x, q6.x * (1.0 / 7.0),
        0.125 * q7.x, third * third * q8.x, 0.0,
    );
    (*series).time = array<f32, KERR_TERMS>(
        walk.time, q0.y, 0.5 * q1.y, third * q2.y, 0.25 * q3.y, 0.2 * q4.y, 0.5 * third * q5.y, q6.y * (1.0 / 7.0),
        0.125 * q7.y, third * third * q8.y, 0.0,
    );
    return (abs(q8.x) + abs(q8.y)) * third * third;
}

// Rates of azimuth and time of 1/g, w^2/g and cos^2 theta, but for what is constant.
fn kerr_rates(ray: KerrRay, x: vec3<f32>) -> vec2<f32> {
    return vec2<f32>(-ray.azimuth.y * x.y, ray.time.x * (x.x + ray.tilt * x.y) + ray.tilt * x.z);
}

// (tolerance/size)^(1/order)
fn kerr_root_length(tolerance: f32, size: f32, order: f32) -> f32 {
    return exp2(log2(tolerance / max(size, 1e-30)) / order);
}

// Value and derivative of the radial series.
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
