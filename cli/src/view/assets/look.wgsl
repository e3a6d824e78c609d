// Light along rays, and pictures of it.

// The photon that is seen at a place of the picture, and by how much a camera's motion shifts it.
fn arriving(at: vec2<f32>) -> KerrPhoton {
    let x = vec2<f32>(at.x, 0.0);
    let y = vec2<f32>(at.y, 0.0);
    if view.camera > 0.5 {
        return kerr_through_lens(view.hole, view.place, view.lens, x, y);
    }
    return kerr_on_screen(view.hole, view.place, x, y);
}

fn blueshift(at: vec2<f32>) -> f32 {
    if view.camera < 0.5 {
        return 1.0;
    }
    let norm = sqrt(1.0 + dot(at, at));
    return norm / dot(view.lens.high[0], vec4<f32>(norm, 1.0, at));
}

// r n of a point.
fn position(point: KerrPoint) -> vec3<f32> {
    let around = kerr_cos_sin(point.azimuth) * length(point.n.xy);
    return vec3<f32>(around, point.n.z) / point.inverse_radius;
}

fn spotted(point: KerrPoint, lambda: f32) -> Spotted {
    let late = (point.delay + view.delay) * view.effects.w;
    let r = 1.0 / point.inverse_radius;
    return Spotted(position(point), r, lambda, point.velocity.z, point.rate, view.time - late);
}

// What is seen: light with and without the sky, and the share of it that comes through what is in front.
struct Seen {
    light: vec4<f32>,  // R, G, B, intensity
    sky: vec3<f32>,
    through: f32,
}

// The longest piece at a radius.
fn longest(r: f32) -> f32 {
    let matter = select(1e30, view.march.y, r < view.reach.x);
    return min(matter, select(1e30, view.gas_color.w * r, view.gas.x > 0.0));
}

// Light between two places of a step whose radius changes in one sense: two Gauss-Legendre nodes a piece.
fn between(
    ray: KerrRay,
    walk: KerrWalk,
    series: ptr<function, KerrSeries>,
    start: f32,
    stop: f32,
    seen: ptr<function, Seen>,
) {
    let a = view.hole.spin.x;
    let near = ray.b / (kerr_radial(series, start).x + ray.centre);
    let middle = ray.b / (kerr_radial(series, 0.5 * (start + stop)).x + ray.centre);
    let far = ray.b / (kerr_radial(series, stop).x + ray.centre);
    let length = (near * near + 4.0 * middle * middle + far * far) / 6.0 + a * a;
    let piece = longest(min(near, far));
    let pieces = clamp(ceil(length * (stop - start) / ray.b / piece), 1.0, 200.0);
    let h = (stop - start) / pieces;
    for (var k = 0.0; k < pieces; k += 0.5) {
        let odd = fract(k) > 0.25;
        let part = floor(k) + select(0.2113248654, 0.7886751346, odd);
        let at = spotted(kerr_point(view.hole, ray, walk, series, start + h * part), ray.lambda);
        let u = at.x.z / at.r;
        let weight = (at.r * at.r + a * a * u * u) * (0.5 * h / ray.b);
        let gas = gas_light(at);
        let depth = gas.depth * weight;
        // Of what shines evenly in something that absorbs (1 - exp(-depth))/depth comes out.
        let out = select((1.0 - exp(-depth)) / max(depth, 1e-30), 1.0 - 0.5 * depth, depth < 1e-3);
        (*seen).light += (*seen).through * out * weight * (emitted(at) + gas.light);
        (*seen).through *= exp(-depth);
    }
}

// The part of a piece that lies within the sphere, whose radius is v = edge.
fn inside(
    ray: KerrRay,
    walk: KerrWalk,
    series: ptr<function, KerrSeries>,
    edge: f32,
    piece: vec2<f32>,
    seen: ptr<function, Seen>,
) {
    let first = kerr_radial(series, piece.x).x;
    let last = kerr_radial(series, piece.y).x;
    if (piece.y <= piece.x) || ((first <= edge) && (last <= edge)) {
        return;
    }
    var start = piece.x;
    var stop = piece.y;
    if first < edge {
        start = kerr_solve(series, false, edge, piece.x, piece.y);
    } else if last < edge {
        stop = kerr_solve(series, false, edge, piece.x, piece.y);
    }
    between(ray, walk, series, start, stop, seen);
}

// Light of what fills space between two places of a step.
fn filled(
    ray: KerrRay,
    walk: KerrWalk,
    series: ptr<function, KerrSeries>,
    piece: vec2<f32>,
    seen: ptr<function, Seen>,
) {
    if view.march.x <= 0.0 {
        return;
    }
    let edge = ray.b / view.march.x - ray.centre;
    let turn = clamp(kerr_turning(series, piece.y), piece.x, piece.y);
    inside(ray, walk, series, edge, vec2<f32>(piece.x, turn), seen);
    inside(ray, walk, series, edge, vec2<f32>(turn, piece.y), seen);
}

fn curved(at: vec2<f32>) -> Seen {
    var walk: KerrWalk;
    var series: KerrSeries;
    var seen = Seen(vec4<f32>(0.0), vec3<f32>(0.0), 1.0);
    let ray = kerr_begin(view.hole, view.place, arriving(at), &walk);
    if ray.outcome == KERR_LOST {
        return seen;
    }
    for (var i = 0u; i < KERR_MOST_STEPS; i++) {
        kerr_expand(ray, walk, true, &series);
        var h = 0.0;
        let done = kerr_ends(ray, walk, &series, &h);
        var from_ = 0.0;
        if (view.disc.w > 0.5) && (kerr_above(walk.n, walk.dn) != (kerr_height(&series, h).x > 0.0)) {
            let x = kerr_solve(&series, true, 0.0, 0.0, h);
            let p = kerr_point(view.hole, ray, walk, &series, x);
            let r = 1.0 / p.inverse_radius;
            if (r >= view.disc.x) && (r <= view.disc.y) {
                filled(ray, walk, &series, vec2<f32>(0.0, x), &seen);
                from_ = x;
                let crossing = Crossing(r, ray.lambda, ray.eta, p.rate > 0.0, blueshift(at));
                seen.light += seen.through * disc_light(crossing);
                if view.disc.w > 1.5 {
                    return seen;
                }
            }
        }
        filled(ray, walk, &series, vec2<f32>(from_, h), &seen);
        if done {
            if (ray.outcome == KERR_ESCAPED) && (view.look.z > 0.0) {
                let last = kerr_point(view.hole, ray, walk, &series, h);
                let across = kerr_cos_sin(last.azimuth) * length(last.n.xy);
                seen.sky = seen.through * sky_light(vec3<f32>(across, last.n.z));
            }
            return seen;
        }
        kerr_advance(view.hole, ray, &walk, &series, h);
    }
    return seen;
}

// A straight ray in the coordinates r n: where it passes the middle of the view, or starts; its direction.
struct Line {
    from_: vec3<f32>,
    along: vec3<f32>,
}

fn line(at: vec2<f32>) -> Line {
    let turn = kerr_cos_sin(view.place.azimuth);
    let s = view.place.sin_i.x;
    let c = view.place.cos_i.x;
    let towards = vec3<f32>(s * turn.x, s * turn.y, c);
    let across = at.x * vec3<f32>(-turn.y, turn.x, 0.0) + at.y * vec3<f32>(-c * turn.x, -c * turn.y, s);
    if view.camera > 0.5 {
        return Line(towards / view.place.inverse_radius.x, normalize(across - towards));
    }
    return Line(across, -towards);
}

// Without gravity, delays and shifts of frequency: a drawing of what shines.
fn straight(at: vec2<f32>) -> Seen {
    var seen = Seen(vec4<f32>(0.0), vec3<f32>(0.0), 1.0);
    let ray = line(at);
    let middle = -dot(ray.from_, ray.along);
    let miss = ray.from_ + middle * ray.along;
    let room = view.reach.x * view.reach.x - dot(miss, miss);
    let ball = view.hole.outer * view.hole.outer - dot(miss, miss);
    if view.slice.x > 0.5 {
        seen.light = sliced(ray);
        return seen;
    }
    if ball > 0.0 {
        seen.sky = vec3<f32>(0.01, 0.013, 0.02) * view.look.x;
    }
    if room <= 0.0 {
        return seen;
    }
    let near = select(-1e30, 0.0, view.camera > 0.5);
    let first = max(middle - sqrt(room), near);
    let last = middle + select(1.0, -1.0, ball > 0.0) * sqrt(select(room, ball, ball > 0.0));
    let pieces = clamp(ceil((last - first) / view.march.y), 1.0, 1000.0);
    let h = (last - first) / pieces;
    for (var k = 0.5; k < pieces; k += 1.0) {
        let x = ray.from_ + (first + k * h) * ray.along;
        seen.light += h * still(x);
    }
    return seen;
}

// Emission at a place and the time of observation, as it is in the frame of its matter.
fn still(x: vec3<f32>) -> vec4<f32> {
    let r = max(length(x), 1e-3);
    var light = stored(x, r, view.time) * vec4<f32>(view.volume_color.xyz, 1.0);
    let spots = u32(view.volume_color.w);
    for (var k = 0u; k < spots; k++) {
        let spot = view.spots[k];
        light += spot_emission(spot, x, r, view.time) * vec4<f32>(spot.color.xyz, 1.0);
    }
    return light;
}

// Emission where a ray meets the plane, by its share of the largest.
fn sliced(ray: Line) -> vec4<f32> {
    let k = u32(view.slice.x) - 1u;
    let distance = (view.slice.y - ray.from_[k]) / ray.along[k];
    let x = ray.from_ + distance * ray.along;
    let behind = (view.camera > 0.5) && (distance < 0.0);
    if behind || (abs(ray.along[k]) < 1e-4) || (length(x) > view.reach.x) {
        return vec4<f32>(0.0);
    }
    if length(x) < view.hole.outer {
        return vec4<f32>(0.0);
    }
    return still(x) * (view.look.x / view.slice.z);
}

fn look(pixel: vec2<f32>) -> Seen {
    let side = min(view.size.x, view.size.y);
    let place = (pixel - view.corner - 0.5 * view.size) * (2.0 * view.half / side);
    let at = vec2<f32>(place.x, -place.y);
    if view.effects.x < 0.5 {
        return straight(at);
    }
    var seen = curved(at);
    let shift = boost(blueshift(at), 3.0);
    seen.light *= shift;
    seen.sky *= shift;
    return seen;
}

// A measured picture, whose field is square.
fn data(pixel: vec2<f32>) -> Seen {
    let side = min(view.size.x, view.size.y);
    let place = (pixel - view.corner - 0.5 * view.size) * (2.0 * view.half / side) / view.slice.w;
    let at = place + 0.5;
    if any(at < vec2<f32>(0.0)) || any(at >= vec2<f32>(1.0)) {
        return Seen(vec4<f32>(0.0), vec3<f32>(0.0), 1.0);
    }
    let pixels = vec2<f32>(textureDimensions(measured));
    let light = textureLoad(measured, vec2<i32>(at * pixels), 0).x * view.slice.z;
    return Seen(vec4<f32>(light), vec3<f32>(0.0), 1.0);
}

fn shown(seen: Seen) -> vec3<f32> {
    let light = seen.light / view.look.x;
    if view.look.y > 0.5 {
        let color = light.xyz + seen.sky / view.look.x;
        return pow(1.0 - exp(-max(color, vec3<f32>(0.0))), vec3<f32>(1.0 / 2.2));
    }
    let k = COLORS + 3u * u32(clamp(light.w, 0.0, 1.0) * 255.0 + 0.5);
    return max(vec3<f32>(table[k], table[k + 1u], table[k + 2u]), seen.sky / view.look.x);
}

@vertex
fn corner(@builtin(vertex_index) k: u32) -> @builtin(position) vec4<f32> {
    return vec4<f32>(f32(k & 1u) * 4.0 - 1.0, f32(k >> 1u) * 4.0 - 1.0, 0.0, 1.0);
}

// Colours of the page.
@fragment
fn paint(@builtin(position) at: vec4<f32>) -> @location(0) vec4<f32> {
    if view.look.w > 0.5 {
        return vec4<f32>(shown(data(at.xy)), 1.0);
    }
    return vec4<f32>(shown(look(at.xy)), 1.0);
}

// Linear light: R, G, B with the sky, and the intensity without it.
@fragment
fn measure(@builtin(position) at: vec4<f32>) -> @location(0) vec4<f32> {
    let seen = look(at.xy);
    return vec4<f32>(seen.light.xyz + seen.sky * view.effects.x, seen.light.w);
}
