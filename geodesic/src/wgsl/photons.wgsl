// Null geodesics of Kerr in floats, backward from the observer: G = c = M = 1, w = 1/r, Mino time tau (dtau =
// ds/Sigma), n = (sin theta cos phi, sin theta sin phi, cos theta) less frame dragging.
//
//     w'' = A w + (3/2) B w^2 + 2 C w^3            n'' = -(K + 2 a^2 u^2) n + a^2 u z
//
// in the scaled time s = b tau with b = sqrt(max(1, K)), by Taylor series. Rays that come near a photon orbit are
// followed in v = b (w - w0), the distance from the minimum of W = (dw/dtau)^2, which is found with twice the
// precision: its sign decides the fate, and floats keep their digits next to it.

// Terms of a series, and the relative error of a step that its length is chosen for.
const KERR_TERMS: u32 = 11u;
const KERR_TOLERANCE: f32 = 3e-8;
const KERR_MOST_STEPS: u32 = 250u;

// Outcomes.
const KERR_CAPTURED: u32 = 0u;
const KERR_ESCAPED: u32 = 1u;
const KERR_LOST: u32 = 3u;

// Flags: what of a ray cannot be trusted.
const KERR_NEAR_CRITICAL: u32 = 1u;  // the minimum of W is 0 within its rounding
const KERR_GRAZING: u32 = 2u;        // the ray leaves the observer at its turning point
const KERR_OUT_OF_STEPS: u32 = 4u;
const KERR_NO_PHOTON: u32 = 8u;      // none arrives there
const KERR_MORE_CROSSINGS: u32 = 16u; // than there is room for (the others are right)

// |W| at its minimum, in units of 1, below which a ray is near-critical.
const KERR_TRUST: f32 = 1e-9;

// (dw/dtau)^2 at the observer below which a ray starts too close to its turning point.
const KERR_LEAST_SPEED: f32 = 1e-10;

struct KerrHole {
    spin: vec2<f32>,     // a = spin.x + spin.y
    horizon: vec2<f32>,  // 1/r+
    outer: f32,          // r+
    inner: f32,          // r-
    gap: f32,            // r+ - r-
    veil: u32,           // 0
}

// Where a picture is taken from.
struct KerrPlace {
    sin_i: vec2<f32>,
    cos_i: vec2<f32>,
    inverse_radius: vec2<f32>,  // 0 at infinity
    end: f32,                   // 1/r at which rays that escape end
    azimuth: f32,
}

// A camera's lens: (energy at infinity, p_r, p_phi / sin theta, p_theta) as a linear map of (|d|, 1, x, y), d the
// direction forward + x right + y up; four rows, each a sum of two floats.
struct KerrLens {
    high: array<vec4<f32>, 4>,
    low: array<vec4<f32>, 4>,
}

// A photon: its constants of motion (wide), and where its backward ray starts.
struct KerrPhoton {
    quad: vec2<f32>,     // A
    cubic: vec2<f32>,    // B
    quartic: vec2<f32>,  // C
    angular: vec2<f32>,  // K = eta + lambda^2
    around: f32,         // p_phi / sin theta at the start
    polar: f32,          // p_theta at the start
    inward: f32,         // 1, or -1 if the backward ray starts away from the hole
}

// A ray: the coefficients of its equations, all scaled by b, and what becomes of it.
struct KerrRay {
    b: f32,
    centre: f32,           // b w0, or 0
    height: f32,           // W at v = 0
    radial: vec3<f32>,     // coefficients of v^2, v^3, v^4 in W
    angular: f32,          // K/b^2
    tilt: f32,             // a^2/b^2
    gauge: f32,            // (a^2 - a lambda)/b^2
    azimuth: vec2<f32>,    // constant and factor of w^2/g
    time: vec2<f32>,       // (B/2)/b^2 and a (lambda - a)/b^2
    lambda: f32,
    eta: f32,
    turns: bool,           // whether W has a root between infinity and the horizon
    outcome: u32,
    flags: u32,
    last: f32,             // v at the end
    sense: f32,            // in which the ray turns about the axis
}

// Where a ray is.
struct KerrWalk {
    v: f32,
    dv: f32,            // dv/ds = dw/dtau
    n: vec3<f32>,
    dn: vec3<f32>,      // dn/ds
    heading: vec2<f32>, // horizontal direction
    turned: f32,        // azimuth without frame dragging
    azimuth: f32,
    time: f32,
    s: f32,
    leg: f32,           // 1 inward, -1 outward
    azimuth_start: f32,
    time_start: f32,
}

// The series of a step.
struct KerrSeries {
    v: array<f32, KERR_TERMS>,
    n: array<vec3<f32>, KERR_TERMS>,
    azimuth: array<f32, KERR_TERMS>,
    time: array<f32, KERR_TERMS>,
    h: f32,
}

// A point of a ray.
struct KerrPoint {
    inverse_radius: f32,
    rate: f32,            // dw/dtau, positive on the way in
    n: vec3<f32>,         // without frame dragging; its third component is cos theta
    velocity: vec3<f32>,  // dn/dtau
    azimuth: f32,         // continuous along the ray
    delay: f32,           // t_o - t less the tortoise coordinate of the observer (at infinity: less r_o + 2 ln r_o)
    mino_time: f32,
}

fn kerr_photon(hole: KerrHole, place: KerrPlace, around: vec2<f32>, polar: vec2<f32>, inward: f32) -> KerrPhoton {
    let a = hole.spin;
    let a2 = kerr_mul(a, a);
    let c2 = kerr_mul(place.cos_i, place.cos_i);
    let polar2 = kerr_mul(polar, polar);
    let tilt = kerr_sub(around, kerr_mul(a, place.sin_i));
    let angular = kerr_sub(kerr_add(kerr_mul(around, around), polar2), kerr_mul(a2, c2));
    let carter = kerr_add(polar2, kerr_mul(tilt, tilt));
    let apart = kerr_mul(kerr_sub(around, a), kerr_add(around, a));
    let eta = kerr_add(polar2, kerr_mul(c2, apart));
    return KerrPhoton(
        kerr_sub(a2, angular),
        kerr_scale(carter, 2.0),
        -kerr_mul(a2, eta),
        angular,
        around.x,
        polar.x,
        inward,
    );
}

// The photon that arrives at (alpha, beta) of Bardeen's screen, in M, each the sum of two floats.
fn kerr_on_screen(hole: KerrHole, place: KerrPlace, alpha: vec2<f32>, beta: vec2<f32>) -> KerrPhoton {
    kerr_veil = hole.veil;
    return kerr_photon(hole, place, -alpha, beta, 1.0);
}

fn kerr_row(lens: KerrLens, row: u32, norm: vec2<f32>, x: vec2<f32>, y: vec2<f32>) -> vec2<f32> {
    let high = lens.high[row];
    let low = lens.low[row];
    let first = kerr_add(kerr_mul(vec2<f32>(high.x, low.x), norm), vec2<f32>(high.y, low.y));
    let across = kerr_mul(vec2<f32>(high.z, low.z), x);
    return kerr_add(first, kerr_add(across, kerr_mul(vec2<f32>(high.w, low.w), y)));
}

// The photon that arrives at (x, y) of a camera's picture plane at distance 1. Where none of positive energy does,
// kerr_begin flags it.
fn kerr_through_lens(
    hole: KerrHole,
    place: KerrPlace,
    lens: KerrLens,
    x: vec2<f32>,
    y: vec2<f32>,
) -> KerrPhoton {
    kerr_veil = hole.veil;
    let norm = kerr_sqrt(kerr_add(kerr_wide(1.0), kerr_add(kerr_mul(x, x), kerr_mul(y, y))));
    let energy = kerr_row(lens, 0u, norm, x, y);
    let along = kerr_row(lens, 1u, norm, x, y);
    let around = kerr_div(kerr_row(lens, 2u, norm, x, y), energy);
    let polar = kerr_div(kerr_row(lens, 3u, norm, x, y), energy);
    let inward = select(-1.0, 1.0, along.x > 0.0);
    return kerr_photon(hole, place, around, polar, select(0.0, inward, energy.x > 0.0));
}

fn kerr_potential(p: KerrPhoton, w: vec2<f32>) -> vec2<f32> {
    let inner = kerr_add(p.quad, kerr_mul(w, kerr_add(p.cubic, kerr_mul(w, p.quartic))));
    return kerr_add(kerr_wide(1.0), kerr_mul(kerr_mul(w, w), inner));
}

// Prepares a ray and puts it at the observer.
fn kerr_begin(hole: KerrHole, place: KerrPlace, p: KerrPhoton, walk: ptr<function, KerrWalk>) -> KerrRay {
    kerr_veil = hole.veil;
    let a = hole.spin.x;
    let b = sqrt(max(1.0, p.angular.x));
    let b2 = b * b;
    let half = 0.5 * p.cubic.x;
    let lambda = place.sin_i.x * p.around;
    var ray: KerrRay;
    ray.b = b;
    ray.angular = p.angular.x / b2;
    ray.tilt = a * a / b2;
    ray.gauge = a * (a - lambda) / b2;
    ray.azimuth = vec2<f32>(a / b, a * (half / b2) / b);
    ray.time = vec2<f32>(half / b2, a * (lambda - a) / b2);
    ray.lambda = lambda;
    ray.eta = p.angular.x - lambda * lambda;
    ray.flags = select(0u, KERR_NO_PHOTON, p.inward == 0.0 || !(p.angular.x < 3e37));
    ray.sense = select(1.0, -1.0, p.around > 0.0);
    kerr_find_barrier(hole, place, p, &ray);
    kerr_start(hole, place, p, &ray, walk);
    if (ray.flags & KERR_NO_PHOTON) != 0u {
        ray.outcome = KERR_LOST;
    }
    return ray;
}

// The minimum of W between infinity and the horizon, and with it the fate of the ray.
fn kerr_find_barrier(hole: KerrHole, place: KerrPlace, p: KerrPhoton, ray: ptr<function, KerrRay>) {
    let b = (*ray).b;
    let scaled = vec3<f32>(p.quad.x / (b * b), p.cubic.x / (b * b) / b, p.quartic.x / (b * b) / (b * b));
    (*ray).centre = 0.0;
    (*ray).height = 1.0;
    (*ray).radial = scaled;
    (*ray).turns = false;
    var outside = true;
    let end = b * hole.horizon.x;
    let discriminant = 9.0 * scaled.y * scaled.y - 32.0 * scaled.x * scaled.z;
    if scaled.x < 0.0 && discriminant >= 0.0 {
        let top = -4.0 * scaled.x / (3.0 * scaled.y + sqrt(discriminant));
        if top <= 1.1 * end {
            // W at the minimum, which one step of Newton's method brings to the last digit of a wide number.
            let near = top / b;
            let wide = kerr_wide(near);
            let slope = kerr_mul(wide, kerr_add(
                kerr_scale(p.quad, 2.0),
                kerr_mul(wide, kerr_add(kerr_mul(p.cubic, kerr_wide(3.0)), kerr_mul(wide, kerr_scale(p.quartic, 4.0)))),
            ));
            let bend = 2.0 * p.quad.x + near * (6.0 * p.cubic.x + 12.0 * near * p.quartic.x);
            let w0 = kerr_quick_sum(near, -slope.x / bend);
            let height = kerr_potential(p, w0);
            let start = place.inverse_radius;
            outside = kerr_sub(start, w0).x < 0.0;
            (*ray).turns = height.x < 0.0 && kerr_sub(w0, hole.horizon).x < 0.0;
            if abs(height.x) < 0.5 {
                let two = kerr_add(p.quad, kerr_mul(w0, kerr_add(
                    kerr_mul(p.cubic, kerr_wide(3.0)),
                    kerr_mul(w0, kerr_mul(p.quartic, kerr_wide(6.0))),
                )));
                let three = kerr_add(p.cubic, kerr_mul(w0, kerr_scale(p.quartic, 4.0)));
                (*ray).centre = b * w0.x;
                (*ray).height = height.x;
                (*ray).radial = vec3<f32>(two.x / (b * b), three.x / (b * b) / b, scaled.z);
            }
            if abs(height.x) < KERR_TRUST {
                (*ray).flags |= KERR_NEAR_CRITICAL;
            }
        }
    }
    let falls = select(p.inward > 0.0, !outside, (*ray).turns);
    (*ray).outcome = select(KERR_ESCAPED, KERR_CAPTURED, falls);
    (*ray).last = select(b * place.end, end, falls) - (*ray).centre;
}

// (dw/dtau)^2
fn kerr_w(ray: KerrRay, v: f32) -> f32 {
    return ray.height + v * v * (ray.radial.x + v * (ray.radial.y + v * ray.radial.z));
}

fn kerr_start(
    hole: KerrHole,
    place: KerrPlace,
    p: KerrPhoton,
    ray: ptr<function, KerrRay>,
    walk: ptr<function, KerrWalk>,
) {
    let w = place.inverse_radius;
    let speed = kerr_potential(p, w);
    if speed.x < KERR_LEAST_SPEED {
        (*ray).flags |= select(KERR_GRAZING, KERR_NO_PHOTON, speed.x < 0.0);
    }
    let leg = select(-1.0, 1.0, p.inward > 0.0);
    (*walk).v = (*ray).b * w.x - (*ray).centre;
    (*walk).dv = leg * sqrt(max(speed.x, 0.0));
    (*walk).n = vec3<f32>(place.sin_i.x, 0.0, place.cos_i.x);
    (*walk).dn = vec3<f32>(-p.polar * place.cos_i.x, -p.around, p.polar * place.sin_i.x) / (*ray).b;
    (*walk).heading = kerr_heading((*walk).n, (*walk).dn);
    (*walk).turned = kerr_angle((*walk).heading.y, (*walk).heading.x);
    (*walk).azimuth = 0.0;
    (*walk).time = 0.0;
    (*walk).s = 0.0;
    (*walk).leg = leg;
    (*walk).azimuth_start = place.azimuth - leg * hole.spin.x * kerr_horizon_log(hole, w.x);
    (*walk).time_start = 0.0;
    if leg < 0.0 && w.x > 0.0 {
        (*walk).time_start = -2.0 * kerr_tortoise(hole, w.x);
    }
}

fn kerr_heading(n: vec3<f32>, dn: vec3<f32>) -> vec2<f32> {
    let on_axis = n.x == 0.0 && n.y == 0.0;
    return select(n.xy, dn.xy, on_axis);
}

// w/(1 - r- w) ln[(r - r+)/(r - r-)]/x with x = (r+ - r-) w/(1 - r- w), regular for r+ = r- and w = 0.
fn kerr_horizon_log(hole: KerrHole, w: f32) -> f32 {
    let far = 1.0 - hole.inner * w;
    let x = hole.gap * w / far;
    if x < 0.25 {
        let t = x / (2.0 - x);
        let s = t * t;
        let series = 1.0 + s * (0.333333333 + s * (0.2 + s * (0.142857143 + s * 0.111111111)));
        return -(w / far) * 2.0 * series / (2.0 - x);
    }
    let near = max(fma(-hole.outer, w, 1.0), 1e-7);
    return (w / far) * log(near / far) / x;
}

// r* with dr*/dr = (r^2 + a^2)/Delta.
fn kerr_tortoise(hole: KerrHole, w: f32) -> f32 {
    let regular = 2.0 * kerr_log_below_one(hole.inner * w) + 2.0 * hole.outer * kerr_horizon_log(hole, w);
    return 1.0 / w + (regular - 2.0 * log(w));
}
