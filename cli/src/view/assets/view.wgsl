// What is seen and from where. The tracer stands before this.

struct Spot {
    start: vec4<f32>,  // centre at time 0, M; standard deviation, M
    axis: vec4<f32>,   // unit vector; emissivity at the centre
    color: vec4<f32>,  // R, G, B; radius of the orbit, M
    times: vec4<f32>,  // since when it is sheared; 1: it is sheared; drag in M^(3/2)
}

struct View {
    hole: KerrHole,
    place: KerrPlace,
    lens: KerrLens,
    size: vec2<f32>,          // of the panel, pixels
    half: f32,                // of the field across the shorter side: M, or on the picture plane at distance 1
    camera: f32,              // 1: a camera; 0: the screen of an observer
    corner: vec2<f32>,        // of the panel in the target, pixels
    time: f32,                // of observation, M
    delay: f32,               // what delays lack, M
    disc: vec4<f32>,          // edges in M; scale of the intensity; 0: none, 1: transparent, 2: opaque
    disc_color: vec4<f32>,    // R, G, B; innermost stable orbit, M
    effects: vec4<f32>,       // 1: lensing; 1: redshift; spectral index; 1: slow light
    look: vec4<f32>,          // white; 1: in colours; brightness of the sky; 1: a measured picture
    march: vec4<f32>,         // radius in M beyond which no volume or spot shines, the longest piece in M, ln r and rate of the table
    low: vec4<f32>,           // first node, M; emission where the texture has 1, 0 without a volume
    high: vec4<f32>,          // last node, M; time at which the volume is as in the texture
    axis: vec4<f32>,          // unit vector; time before which it is dark
    region: vec4<f32>,        // least and largest radius and largest |z| where it shines; 1: it turns
    volume_color: vec4<f32>,  // R, G, B; number of spots
    slice: vec4<f32>,         // 0: none, 1 to 3: the plane x, y or z; where, M; emission that is white in a slice, or light of a measured picture where its texture has 1; field of that, M
    spots: array<Spot, 8>,
}

// Tables: 512 entries of the disc's flux, 512 of rates, 256 colours.
const FLUX: u32 = 0u;
const RATES: u32 = 512u;
const COLORS: u32 = 1024u;

@group(0) @binding(0) var<uniform> view: View;
@group(0) @binding(1) var<storage, read> table: array<f32>;
@group(0) @binding(2) var volume: texture_3d<f32>;
@group(0) @binding(3) var linear: sampler;
@group(0) @binding(4) var panorama: texture_2d<f32>;
@group(0) @binding(5) var measured: texture_2d<f32>;

fn tabulated(first: u32, place: f32) -> f32 {
    let at = clamp(place, 0.0, 1.0) * 511.0;
    let k = min(u32(at), 510u);
    return mix(table[first + k], table[first + k + 1u], at - f32(k));
}

fn rotated(axis: vec3<f32>, angle: f32, x: vec3<f32>) -> vec3<f32> {
    let turn = kerr_cos_sin(angle);
    return x * turn.x + cross(axis, x) * turn.y + axis * (dot(axis, x) * (1.0 - turn.x));
}

// A place on a ray: r n, the ray's lambda and d cos theta/dtau, and when its light left.
struct Spotted {
    x: vec3<f32>,
    r: f32,
    lambda: f32,
    polar: f32,
    time: f32,
}

// The redshift of matter that turns with the angular velocity `omega`; 0 where there can be none.
fn shift_of(at: Spotted, omega: vec3<f32>) -> f32 {
    if view.effects.y < 0.5 {
        return 1.0;
    }
    let a = view.hole.spin.x;
    let n = at.x / at.r;
    let v = cross(omega, n);
    let sigma = at.r * at.r + a * a * n.z * n.z;
    let delta = (at.r - view.hole.outer) * (at.r - view.hole.inner);
    let sin2 = max(n.x * n.x + n.y * n.y, 1e-20);
    let square = at.r * at.r + a * a;
    let area = (square * square - a * a * delta * sin2) / sigma;
    let swirl = n.x * v.y - n.y * v.x;
    let norm = 1.0 - 2.0 * at.r / sigma * (1.0 - 2.0 * a * swirl) - area * dot(v, v)
        + a * a * (sigma + 2.0 * at.r) / sigma * v.z * v.z;
    let energy = 1.0 + (v.z * at.polar - at.lambda * swirl) / sin2;
    if (norm <= 0.0) || (energy <= 0.0) {
        return 0.0;
    }
    return sqrt(norm) / energy;
}

// g^power, 1 where nothing is shifted.
fn boost(g: f32, power: f32) -> f32 {
    if view.effects.y < 0.5 {
        return 1.0;
    }
    return select(0.0, pow(g, power + view.effects.z), g > 0.0);
}

// The angular velocity of the volume's matter.
fn rate_of(r: f32) -> f32 {
    if view.region.w < 0.5 {
        return 0.0;
    }
    return tabulated(RATES, (log(r) - view.march.z) * view.march.w) / (r * sqrt(r));
}

// Emission of the volume at a place, in the frame of its matter.
fn stored(x: vec3<f32>, r: f32, time: f32) -> f32 {
    let inside = (r >= view.region.x) && (r < view.region.y) && (abs(x.z) <= view.region.z);
    if (view.low.w == 0.0) || !inside || (time < view.axis.w) {
        return 0.0;
    }
    let from_ = rotated(view.axis.xyz, -rate_of(r) * (time - view.high.w), x);
    let q = (from_ - view.low.xyz) / (view.high.xyz - view.low.xyz);
    if any(q < vec3<f32>(0.0)) || any(q > vec3<f32>(1.0)) {
        return 0.0;
    }
    let nodes = vec3<f32>(textureDimensions(volume));
    return view.low.w * textureSampleLevel(volume, linear, (q * (nodes - 1.0) + 0.5) / nodes, 0.0).x;
}

// Colour and intensity per M.
fn volume_light(at: Spotted) -> vec4<f32> {
    let emission = stored(at.x, at.r, at.time);
    if emission <= 0.0 {
        return vec4<f32>(0.0);
    }
    let g = shift_of(at, view.axis.xyz * rate_of(at.r));
    return emission * boost(g, 2.0) * vec4<f32>(view.volume_color.xyz, 1.0);
}

fn spot_rate(spot: Spot, r: f32) -> f32 {
    return 1.0 / (r * sqrt(r) + spot.times.z);
}

// The angular velocity of a spot's matter at a radius.
fn own_rate(spot: Spot, r: f32) -> f32 {
    return select(spot_rate(spot, spot.color.w), spot_rate(spot, r), spot.times.y > 0.5);
}

// Emission of a spot in the frame of its matter.
fn spot_emission(spot: Spot, x: vec3<f32>, r: f32, time: f32) -> f32 {
    let sheared = spot.times.y > 0.5;
    let orbit = spot_rate(spot, spot.color.w);
    var angle = orbit * time;
    if sheared {
        angle = own_rate(spot, r) * (time - spot.times.x) + orbit * spot.times.x;
    }
    let off = distance(rotated(spot.axis.xyz, -angle, x), spot.start.xyz) / spot.start.w;
    let dark = (off > 6.0) || (sheared && (time < spot.times.x));
    return select(spot.axis.w * exp(-0.5 * off * off), 0.0, dark);
}

fn spot_light(spot: Spot, at: Spotted) -> vec4<f32> {
    let emission = spot_emission(spot, at.x, at.r, at.time);
    if emission <= 0.0 {
        return vec4<f32>(0.0);
    }
    let g = shift_of(at, spot.axis.xyz * own_rate(spot, at.r));
    return emission * boost(g, 2.0) * vec4<f32>(spot.color.xyz, 1.0);
}

// Light of all that fills space, per M.
fn emitted(at: Spotted) -> vec4<f32> {
    var light = volume_light(at);
    let spots = u32(view.volume_color.w);
    for (var k = 0u; k < spots; k++) {
        light += spot_light(view.spots[k], at);
    }
    return light;
}

// Light of the disc at a radius: Page & Thorne's flux over that of its peak, as a table in sqrt(isco/r).
fn disc_light(r: f32, lambda: f32) -> vec4<f32> {
    let s = sqrt(view.disc_color.w / r);
    let s3 = s * s * s;
    let intensity = view.disc.z * select(0.0, tabulated(FLUX, s) * s3 * s3, s < 1.0);
    var g = 1.0;
    if view.effects.y > 0.5 {
        let a = view.hole.spin.x;
        let cube = r * sqrt(r);
        let norm = cube * (cube - 3.0 * sqrt(r) + 2.0 * a);
        g = sqrt(max(norm, 0.0)) / (cube + a - lambda);
    }
    return intensity * boost(g, 3.0) * vec4<f32>(view.disc_color.xyz, 1.0);
}

fn sky_light(direction: vec3<f32>) -> vec3<f32> {
    let turns = kerr_angle(direction.y, direction.x) / (2.0 * KERR_PI);
    let polar = kerr_angle(length(direction.xy), direction.z) / KERR_PI;
    return view.look.z * textureSampleLevel(panorama, linear, vec2<f32>(turns, polar), 0.0).xyz;
}
