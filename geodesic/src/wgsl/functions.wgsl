// Elementary functions to the last digits of a float: those of WGSL may be off by 4096 units in the last place
// (atan2), or by 2^-11 (sin, cos).

const KERR_PI: f32 = 3.14159265358979;

// atan(x) on [0, 1], error 1e-7 (minimax polynomial in x^2).
fn kerr_atan_unit(x: f32) -> f32 {
    let s = x * x;
    var p = 0.00282363896258175373077393;
    p = fma(p, s, -0.0159569028764963150024414);
    p = fma(p, s, 0.0425049886107444763183594);
    p = fma(p, s, -0.0748900920152664184570312);
    p = fma(p, s, 0.106347933411598205566406);
    p = fma(p, s, -0.142027363181114196777344);
    p = fma(p, s, 0.199926957488059997558594);
    p = fma(p, s, -0.333331018686294555664062);
    return fma(x * s, p, x);
}

// Angle of the point (x, y) in [-pi, pi]; 0 at the origin.
fn kerr_angle(y: f32, x: f32) -> f32 {
    let a = abs(x);
    let b = abs(y);
    let most = max(a, b);
    if most == 0.0 {
        return 0.0;
    }
    var angle = kerr_atan_unit(min(a, b) / most);
    if b > a {
        angle = 0.5 * KERR_PI - angle;
    }
    if x < 0.0 {
        angle = KERR_PI - angle;
    }
    return select(angle, -angle, y < 0.0);
}

// (cos x, sin x), error 2e-7 for |x| up to a hundred turns.
fn kerr_cos_sin(x: f32) -> vec2<f32> {
    let k = round(x * 0.636619772367581);
    // pi/2 in three parts, the first two of 12 bits.
    var y = fma(-k, 1.5703125, x);
    y = fma(-k, 4.83751296997e-4, y);
    y = fma(-k, 7.54978995489e-8, y);
    let s = y * y;
    let sine = y + y * s * (-0.16666667 + s * (0.008333331 + s * (-0.00019840874 + s * 2.7525562e-6)));
    let cosine = 1.0 + s * (-0.5 + s * (0.041666664 + s * (-0.0013888885 + s * 2.4433157e-5)));
    let turn = i32(k) & 3;
    if turn == 0 {
        return vec2<f32>(cosine, sine);
    }
    if turn == 1 {
        return vec2<f32>(-sine, cosine);
    }
    if turn == 2 {
        return vec2<f32>(-cosine, -sine);
    }
    return vec2<f32>(sine, -cosine);
}

// ln(1 - x) for x < 1.
fn kerr_log_below_one(x: f32) -> f32 {
    if abs(x) > 0.25 {
        return log(1.0 - x);
    }
    // -2 artanh(x/(2 - x))
    let t = x / (2.0 - x);
    let s = t * t;
    return -2.0 * t * (1.0 + s * (0.333333333 + s * (0.2 + s * (0.142857143 + s * 0.111111111))));
}
