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
    march: vec4<f32>,         // radius in M beyond which nothing of what fills space shines, the longest piece in M in volumes and spots, ln r and rate of the table
    low: vec4<f32>,           // first node, M; emission where the texture has 1, 0 without a volume
    high: vec4<f32>,          // last node, M; time at which the volume is as in the texture
    axis: vec4<f32>,          // unit vector; time before which it is dark
    region: vec4<f32>,        // least and largest radius and largest |z| where it shines; 1: it turns
    volume_color: vec4<f32>,  // R, G, B; number of spots
    slice: vec4<f32>,         // 0: none, 1 to 3: the plane x, y or z; where, M; emission that is white in a slice, or light of a measured picture where its texture has 1; field of that, M
    plunge: vec4<f32>,        // energy and angular momentum (M) of matter that plunges; its intensity at the innermost stable orbit, 0: none; power of its fall
    gas: vec4<f32>,           // emissivity at density 1 by M, 0: none; 1/M of the scale; half of the flatness squared; slope, below 0: Gaussian
    gas_motion: vec4<f32>,    // 1: circles with an angular momentum l0, 2: Kepler's, 3: free fall; l0; absorption at density 1 by M; edge, M
    gas_color: vec4<f32>,     // R, G, B; the longest piece of a ray in gas by its radius
    reach: vec4<f32>,         // radius in M beyond which no volume or spot shines
    spots: array<Spot, 8>,
}

// Tables: 512 entries of the disc's flux, 512 of rates, 256 colours, logarithms of 512 reds, greens and blues of black bodies.
const FLUX: u32 = 0u;
const RATES: u32 = 512u;
const COLORS: u32 = 1024u;
const SHADES: u32 = 1792u;

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

// A place on a ray: r n, the ray's lambda, d cos theta/dtau and d(1/r)/dtau, and when its light left.
struct Spotted {
    x: vec3<f32>,
    r: f32,
    lambda: f32,
    polar: f32,
    fall: f32,
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

// The density of the gas, 1 at its scale.
fn gas_density(at: Spotted) -> f32 {
    let u = at.x.z / at.r;
    let x = at.r * view.gas.y;
    let flat = view.gas.z * u * u;
    if view.gas.w < 0.0 {
        return exp(-0.5 * x * x - flat);
    }
    return pow(x, -view.gas.w) * exp(-flat);
}

// The redshift of the gas; 0 where it cannot move so.
fn gas_shift(at: Spotted) -> f32 {
    if view.effects.y < 0.5 {
        return 1.0;
    }
    let a = view.hole.spin.x;
    let u = at.x.z / at.r;
    let sin2 = max((1.0 - u) * (1.0 + u), 1e-20);
    let delta = (at.r - view.hole.outer) * (at.r - view.hole.inner);
    let sigma = at.r * at.r + a * a * u * u;
    let across = at.r * at.r + a * a;
    let area = across * across - a * a * delta * sin2;
    let twist = 2.0 * a * at.r;
    let ring = at.r * sqrt(sin2);
    var norm = delta * sigma;
    var energy = area - twist * at.lambda + sqrt(2.0 * at.r * across) * at.fall * at.r * at.r;
    if view.gas_motion.x < 1.5 {
        let l = view.gas_motion.y * ring * sqrt(ring) / (1.0 + ring);
        let turn = delta / sin2 - a * a;
        norm = sqrt(max(area - 2.0 * l * twist - l * l * turn, 0.0)) * sqrt(max(norm, 0.0));
        energy = area - twist * (l + at.lambda) - turn * l * at.lambda;
    } else if view.gas_motion.x < 2.5 {
        let omega = 1.0 / (ring * sqrt(ring) + a);
        let lift = 1.0 - a * omega * sin2;
        let square = 1.0 - 2.0 * at.r / sigma * lift * lift - across * sin2 * omega * omega;
        norm = sqrt(max(square, 0.0));
        energy = 1.0 - omega * at.lambda;
    }
    return select(0.0, norm / energy, (norm > 0.0) && (energy > 0.0));
}

// Colour and intensity of the gas per M, and its optical depth per M.
struct Gas {
    light: vec4<f32>,
    depth: f32,
}

fn gas_light(at: Spotted) -> Gas {
    if (view.gas.x == 0.0) || (at.r > view.gas_motion.w) {
        return Gas(vec4<f32>(0.0), 0.0);
    }
    let density = gas_density(at);
    let g = gas_shift(at);
    let light = view.gas.x * density * boost(g, 2.0) * vec4<f32>(view.gas_color.xyz, 1.0);
    return Gas(light, view.gas_motion.z * density * boost(g, 1.5));
}

// Where a ray meets the disc: radius, constants of motion, whether light leaves outward, and what a camera's motion adds.
struct Crossing {
    r: f32,
    lambda: f32,
    eta: f32,
    outward: bool,
    blueshift: f32,
}

// The redshift of circular orbits.
fn orbit_shift(at: Crossing) -> f32 {
    let a = view.hole.spin.x;
    let cube = at.r * sqrt(at.r);
    let norm = cube * (cube - 3.0 * sqrt(at.r) + 2.0 * a);
    return sqrt(max(norm, 0.0)) / (cube + a - at.lambda);
}

// The redshift of matter that plunges with the constants of the innermost stable orbit; 0 where there is no such light.
fn plunge_shift(at: Crossing) -> f32 {
    let a = view.hole.spin.x;
    let r2 = at.r * at.r;
    let delta = (at.r - view.hole.outer) * (at.r - view.hole.inner);
    let rest = view.plunge.y - a * view.plunge.x;
    let matter = view.plunge.x * (r2 + a * a) - a * view.plunge.y;
    let photon = r2 + a * a - a * at.lambda;
    let carter = at.eta + (at.lambda - a) * (at.lambda - a);
    let square = photon * photon - delta * carter;
    let isco = view.disc_color.w;
    let fall = sqrt(2.0 / (3.0 * isco)) * pow(max(isco / at.r - 1.0, 0.0), 1.5);
    let sum = matter * photon + sqrt(max(square, 0.0)) * r2 * fall;
    let inward = (carter * matter * matter + (r2 + rest * rest) * square) / sum;
    let energy = (select(inward, sum / delta, at.outward) - rest * (at.lambda - a)) / r2;
    let is = (delta > 0.0) && (square >= 0.0) && (energy > 0.0);
    return select(0.0, 1.0 / energy, is);
}

// Linear colour of a black body, at a temperature by that of the disc's peak, for intensity 1; white where the disc is none.
fn shade(temperature: f32) -> vec3<f32> {
    let place = (log(max(temperature, 1e-9)) + 6.0) / 9.0;
    return exp(vec3<f32>(
        tabulated(SHADES, place),
        tabulated(SHADES + 512u, place),
        tabulated(SHADES + 1024u, place),
    ));
}

// Light of the disc: Page & Thorne's flux over that of its peak, as a table in sqrt(isco/r), and that of plunging matter.
fn disc_light(at: Crossing) -> vec4<f32> {
    let s = sqrt(view.disc_color.w / at.r);
    let plunges = (s > 1.0) && (view.plunge.z > 0.0);
    let s3 = s * s * s;
    var intensity = view.disc.z * select(0.0, tabulated(FLUX, s) * s3 * s3, s < 1.0);
    if plunges {
        intensity = view.plunge.z * pow(1.0 / (s * s), view.plunge.w);
    }
    var g = 1.0;
    if view.effects.y > 0.5 {
        g = select(orbit_shift(at), plunge_shift(at), plunges);
    }
    let seen = select(1.0, g * at.blueshift, view.effects.y > 0.5);
    let color = shade(seen * sqrt(sqrt(intensity / max(view.disc.z, 1e-30))));
    return intensity * boost(g, 3.0) * vec4<f32>(view.disc_color.xyz * color, 1.0);
}

fn sky_light(direction: vec3<f32>) -> vec3<f32> {
    let turns = kerr_angle(direction.y, direction.x) / (2.0 * KERR_PI);
    let polar = kerr_angle(length(direction.xy), direction.z) / KERR_PI;
    return view.look.z * textureSampleLevel(panorama, linear, vec2<f32>(turns, polar), 0.0).xyz;
}
