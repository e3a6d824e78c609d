// From an unbounded number to an emissivity: value and slope.

const SIGMOID = 0u;
const SOFTPLUS = 1u;

// e^x, held beyond |x| = 87 (Moshier's polynomial in Cephes); a number that is none stays so.
fn exponential(x: f32) -> f32 {
    var held = x;
    if held > 87.0 { held = 87.0; }
    if held < -87.0 { held = -87.0; }
    let n = round(held * 1.44269504);
    // ln 2 in two parts, the first of so few bits that n times it is exact.
    let r = fma(-n, -2.12194440e-4, fma(-n, 0.693359375, held));
    var p = 1.9875691500e-4;
    p = fma(p, r, 1.3981999507e-3);
    p = fma(p, r, 8.3334519073e-3);
    p = fma(p, r, 4.1665795894e-2);
    p = fma(p, r, 1.6666665459e-1);
    p = fma(p, r, 5.0000001201e-1);
    return (fma(p, r * r, r) + 1.0) * bitcast<f32>((i32(n) + 127) << 23u);
}

// ln(1 + e^x) = max(x, 0) + 2 artanh(e/(2 + e)), e = e^-|x|.
fn softplus(x: f32) -> f32 {
    let e = exponential(-abs(x));
    let s = e / (2.0 + e);
    let z = s * s;
    // z is at most 1/9: the next term is 1e-9 of the sum.
    var p = 0.0666666667;
    p = fma(p, z, 0.0769230769);
    p = fma(p, z, 0.0909090909);
    p = fma(p, z, 0.111111111);
    p = fma(p, z, 0.142857143);
    p = fma(p, z, 0.2);
    p = fma(p, z, 0.333333333);
    return fma(p * z, s + s, s + s) + select(x, 0.0, x <= 0.0);
}

fn activate(kind: u32, x: f32) -> vec2<f32> {
    if kind > SOFTPLUS {
        return vec2<f32>(x, 1.0);
    }
    let sigmoid = 1.0 / (1.0 + exponential(-x));
    if kind == SIGMOID {
        return vec2<f32>(sigmoid, sigmoid * (1.0 - sigmoid));
    }
    return vec2<f32>(softplus(x), sigmoid);
}
