// A picture, enlarged.
@group(0) @binding(0) var picture: texture_2d<f32>;
@group(0) @binding(1) var linear: sampler;

struct Place {
    @builtin(position) at: vec4<f32>,
    @location(0) share: vec2<f32>,
}

@vertex
fn corner(@builtin(vertex_index) k: u32) -> Place {
    let at = vec2<f32>(f32(k & 1u) * 4.0 - 1.0, f32(k >> 1u) * 4.0 - 1.0);
    return Place(vec4<f32>(at, 0.0, 1.0), vec2<f32>(0.5 + 0.5 * at.x, 0.5 - 0.5 * at.y));
}

@fragment
fn paint(place: Place) -> @location(0) vec4<f32> {
    return textureSampleLevel(picture, linear, clamp(place.share, vec2<f32>(0.0), vec2<f32>(1.0)), 0.0);
}
