//! The equations of motion in Kerr–Schild coordinates and the affine parameter.

use crate::numbers::scalar::Scalar;

/// x, y, z, p_x, p_y, p_z, t and Mino time.
pub(super) type State<T> = [T; 8];
pub(super) const MINO_TIME: usize = 7;

/// dy/ds of the reflected, future-directed ray with energy 1.
pub(super) fn derivative<T: Scalar>(spin: f64, y: &State<T>) -> State<T> {
    let [x, y_, z, px, py, pz, _, _] = *y;
    let (a, one, two) = (T::constant(spin), T::constant(1.0), T::constant(2.0));
    let a2 = a * a;
    let b = x * x + y_ * y_ + z * z - a2;
    let r2 = (b + (b * b + T::constant(4.0) * a2 * z * z).sqrt()) / two;
    let r = r2.sqrt();
    let (inv, sum) = (one / (r2 * r2 + a2 * z * z), r2 + a2);
    let f = two * r2 * r * inv;
    let l = [(r * x + a * y_) / sum, (r * y_ - a * x) / sum, z / r];
    // p_t = −1.
    let along = one + l[0] * px + l[1] * py + l[2] * pz;
    let f_along = f * along;
    let gradient_r = [x * r2 * r * inv, y_ * r2 * r * inv, z * r * sum * inv];
    // df = (6r²/N − 4r³·2r³/N²) dr − 4r³a²z/N² dz with N = r⁴ + a²z².
    let f_r = T::constant(6.0) * r2 * inv - T::constant(8.0) * r2 * r2 * r2 * inv * inv;
    let f_z = -(T::constant(4.0) * r2 * r * a2 * z * inv * inv);
    // d(l·p) by r at fixed x, y, z, and by x, y, z at fixed r.
    let l_r = (x - two * r * l[0]) / sum * px + (y_ - two * r * l[1]) / sum * py - z / r2 * pz;
    let l_fixed = [(r * px - a * py) / sum, (a * px + r * py) / sum, pz / r];
    let half = along * along / two;
    let force = |k: usize| {
        let df = f_r * gradient_r[k] + if k == 2 { f_z } else { T::constant(0.0) };
        half * df + f_along * (l_r * gradient_r[k] + l_fixed[k])
    };
    let sigma = r2 + a2 * z * z / r2;
    [
        px - f_along * l[0],
        py - f_along * l[1],
        pz - f_along * l[2],
        force(0),
        force(1),
        force(2),
        one + f_along,
        one / sigma,
    ]
}

/// Boyer–Lindquist radius of a point.
pub(super) fn radius(spin: f64, [x, y, z]: [f64; 3]) -> f64 {
    let b = x * x + y * y + z * z - spin * spin;
    (0.5 * (b + b.hypot(2.0 * spin * z))).sqrt()
}
