// Numbers of twice the precision: a sum of two floats, hi + lo, |lo| at most half a unit in the last place of hi.
//
// A shader compiler may reorder floating-point sums as if they were exact, and many do: (a + b) - a becomes b, and
// nothing is compensated. Every intermediate result that must stay as it is therefore passes through kerr_keep, an
// exclusive or with a zero that is read from memory at run time.

// The zero that no compiler knows: kerr_begin takes it from the uniform.
var<private> kerr_veil: u32 = 0u;

fn kerr_keep(x: f32) -> f32 {
    return bitcast<f32>(bitcast<u32>(x) ^ kerr_veil);
}

// a + b exactly, if |a| >= |b|.
fn kerr_quick_sum(a: f32, b: f32) -> vec2<f32> {
    let s = kerr_keep(a + b);
    return vec2<f32>(s, b - kerr_keep(s - a));
}

// a + b exactly (Knuth).
fn kerr_two_sum(a: f32, b: f32) -> vec2<f32> {
    let s = kerr_keep(a + b);
    let c = kerr_keep(s - a);
    let left = kerr_keep(a - kerr_keep(s - c));
    return vec2<f32>(s, left + kerr_keep(b - c));
}

// a * b exactly: halves of 12 bits, whose products are exact with and without fused multiply-add (Dekker).
fn kerr_two_product(a: f32, b: f32) -> vec2<f32> {
    let p = kerr_keep(a * b);
    let a1 = bitcast<f32>(bitcast<u32>(a) & 0xfffff000u);
    let b1 = bitcast<f32>(bitcast<u32>(b) & 0xfffff000u);
    let a2 = kerr_keep(a - a1);
    let b2 = kerr_keep(b - b1);
    // In this order every sum is exact.
    let first = kerr_keep(kerr_keep(a1 * b1) - p);
    let second = kerr_keep(first + kerr_keep(a1 * b2));
    let third = kerr_keep(second + kerr_keep(a2 * b1));
    return vec2<f32>(p, third + kerr_keep(a2 * b2));
}

fn kerr_add(a: vec2<f32>, b: vec2<f32>) -> vec2<f32> {
    let s = kerr_two_sum(a.x, b.x);
    let t = kerr_two_sum(a.y, b.y);
    let r = kerr_quick_sum(s.x, s.y + t.x);
    return kerr_quick_sum(r.x, r.y + t.y);
}

fn kerr_sub(a: vec2<f32>, b: vec2<f32>) -> vec2<f32> {
    return kerr_add(a, -b);
}

fn kerr_mul(a: vec2<f32>, b: vec2<f32>) -> vec2<f32> {
    let p = kerr_two_product(a.x, b.x);
    return kerr_quick_sum(p.x, p.y + (a.x * b.y + a.y * b.x));
}

// By a power of two.
fn kerr_scale(a: vec2<f32>, by: f32) -> vec2<f32> {
    return a * by;
}

fn kerr_wide(x: f32) -> vec2<f32> {
    return vec2<f32>(x, 0.0);
}

fn kerr_div(a: vec2<f32>, b: vec2<f32>) -> vec2<f32> {
    let q = kerr_keep(a.x / b.x);
    let rest = kerr_sub(a, kerr_mul(b, kerr_wide(q)));
    let more = kerr_keep((rest.x + rest.y) / b.x);
    let last = kerr_sub(rest, kerr_mul(b, kerr_wide(more)));
    let r = kerr_quick_sum(q, more);
    return kerr_quick_sum(r.x, r.y + last.x / b.x);
}

// Of a number that is not negative.
fn kerr_sqrt(a: vec2<f32>) -> vec2<f32> {
    if a.x <= 0.0 {
        return vec2<f32>(0.0, 0.0);
    }
    let s = kerr_keep(sqrt(a.x));
    let rest = kerr_sub(a, kerr_two_product(s, s));
    return kerr_quick_sum(s, 0.5 * rest.x / s);
}
