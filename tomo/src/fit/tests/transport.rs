//! Polarised light of a fit's nodes against parallel transport that is integrated step by step.

use super::stokes::{apart, law, traced, view};
use crate::fit::Sightlines;
use kerrlight_geodesic::vector::cross;
use kerrlight_geodesic::{Dual, Kerr, Scalar};
use kerrlight_render::dynamics::AngularVelocity;
use kerrlight_render::polarization::{FieldFrame, MagneticField};

/// g_μν of Kerr–Schild coordinates with its derivatives, F and l_μ.
fn metric(a: f64, place: [f64; 3]) -> ([[Dual<f64, 3>; 4]; 4], f64, [f64; 4]) {
    let [x, y, z]: [Dual<f64, 3>; 3] = core::array::from_fn(|i| Dual::parameter(place[i], i));
    let of = Dual::<f64, 3>::constant;
    let (a, a2) = (of(a), of(a * a));
    let b = x * x + y * y + z * z - a2;
    let r2 = (b + (b * b + of(4.0) * a2 * z * z).sqrt()) / of(2.0);
    let r = r2.sqrt();
    let strength = of(2.0) * r2 * r / (r2 * r2 + a2 * z * z);
    let l = [of(1.0), (r * x + a * y) / (r2 + a2), (r * y - a * x) / (r2 + a2), z / r];
    let flat = |i: usize, j: usize| if i != j { 0.0 } else { [-1.0, 1.0, 1.0, 1.0][i] };
    let at = |i: usize, j: usize| of(flat(i, j)) + strength * l[i] * l[j];
    let g = core::array::from_fn(|i| core::array::from_fn(|j| at(i, j)));
    (g, strength.value, l.map(|x| x.value))
}

/// −Γ^μ_{αβ} k^α v^β, term by term.
fn turn(a: f64, place: [f64; 3], k: [f64; 4], v: [f64; 4]) -> [f64; 4] {
    let (g, strength, l) = metric(a, place);
    let slope = |c: usize, i: usize, j: usize| if c == 0 { 0.0 } else { g[i][j].slope[c - 1] };
    let mut lower = [0.0; 4];
    for (nu, out) in lower.iter_mut().enumerate() {
        for (al, k) in k.iter().enumerate() {
            for (be, v) in v.iter().enumerate() {
                *out -= 0.5 * (slope(al, nu, be) + slope(be, nu, al) - slope(nu, al, be)) * k * v;
            }
        }
    }
    let eta = [-1.0, 1.0, 1.0, 1.0];
    let along: f64 = (0..4).map(|i| eta[i] * l[i] * lower[i]).sum();
    core::array::from_fn(|i| eta[i] * (lower[i] - strength * l[i] * along))
}

/// Place, photon and vector.
type State = [f64; 11];

fn rate(a: f64, y: &State) -> State {
    let (x, k, f) = ([y[0], y[1], y[2]], [y[3], y[4], y[5], y[6]], [y[7], y[8], y[9], y[10]]);
    let (dk, df) = (turn(a, x, k, k), turn(a, x, k, f));
    [k[1], k[2], k[3], dk[0], dk[1], dk[2], dk[3], df[0], df[1], df[2], df[3]]
}

/// Runge–Kutta steps of order 4, out to 1e10 M.
fn carry_out(a: f64, mut y: State) -> State {
    let distance = |y: &State| (y[0] * y[0] + y[1] * y[1] + y[2] * y[2]).sqrt();
    while distance(&y) < 1e10 {
        let h = 0.01 * distance(&y);
        let plus = |d: &State, h: f64| core::array::from_fn(|i| y[i] + h * d[i]);
        let k1 = rate(a, &y);
        let k2 = rate(a, &plus(&k1, 0.5 * h));
        let k3 = rate(a, &plus(&k2, 0.5 * h));
        let k4 = rate(a, &plus(&k3, h));
        y = core::array::from_fn(|i| y[i] + h / 6.0 * (k1[i] + 2.0 * (k2[i] + k3[i]) + k4[i]));
    }
    y
}

/// The vectors (t, r, θ, φ) of Boyer–Lindquist coordinates at a place (r n) in Kerr–Schild ones; azimuths differ by a
/// turn that the observer's is turned by, too.
fn start(hole: &Kerr, position: [f64; 3], vectors: [[f64; 4]; 2]) -> State {
    let (a, [x, y, z]) = (hole.spin(), position);
    let r = (x * x + y * y + z * z).sqrt();
    let (s, c) = (x.hypot(y) / r, z / r);
    let (sin, cos) = (y.atan2(x) + hole.azimuth_closed_form(1.0 / r)).sin_cos();
    let (x, y) = ((r * cos - a * sin) * s, (r * sin + a * cos) * s);
    let convert = |[t, dr, dtheta, dphi]: [f64; 4]| {
        let (turn, late) = (dphi + a * dr / hole.delta(r), 2.0 * r * dr / hole.delta(r));
        let dx = dr * cos * s + x / s * c * dtheta - y * turn;
        let dy = dr * sin * s + y / s * c * dtheta + x * turn;
        [t + late, dx, dy, dr * c - r * s * dtheta]
    };
    let [k, f] = vectors.map(convert);
    [x, y, r * c, k[0], k[1], k[2], k[3], f[0], f[1], f[2], f[3]]
}

/// g^{μν} p_ν of Boyer–Lindquist coordinates.
fn raised(hole: &Kerr, r: f64, u: f64, p: [f64; 4]) -> [f64; 4] {
    let (a, s2) = (hole.spin(), 1.0 - u * u);
    let (delta, sigma) = (hole.delta(r), hole.sigma(r, u));
    let area = (r * r + a * a).powi(2) - a * a * delta * s2;
    let tt = -area / (delta * sigma);
    let tp = -2.0 * a * r / (delta * sigma);
    let pp = (delta - a * a * s2) / (delta * sigma * s2);
    [tt * p[0] + tp * p[3], p[1] * delta / sigma, p[2] / sigma, tp * p[0] + pp * p[3]]
}

/// The electric vector k × B of gas of zero angular momentum, in Boyer–Lindquist components, and k itself.
fn emitted(hole: &Kerr, lines: &Sightlines, node: usize, field: &MagneticField) -> [[f64; 4]; 2] {
    let at = |columns: &[Vec<f64>; 3]| [0, 1, 2].map(|c| columns[c][node]);
    let ([x, y, z], momentum) = (at(&lines.position), at(&lines.momentum));
    let r = (x * x + y * y + z * z).sqrt();
    let (u, s, a) = (z / r, x.hypot(y) / r, hole.spin());
    let (cos, sin) = (x / (r * s), y / (r * s));
    let polar = momentum[1] * cos - momentum[0] * sin;
    let radial = lines.radial[node] * r * r / hole.delta(r);
    let k = raised(hole, r, u, [-1.0, radial, polar, momentum[2]]);
    let (delta, sigma) = (hole.delta(r), hole.sigma(r, u));
    let area = (r * r + a * a).powi(2) - a * a * delta * s * s;
    let drag = 2.0 * a * r / area;
    let units = [(sigma / delta).sqrt(), sigma.sqrt(), (area / sigma).sqrt() * s];
    let local = [k[1] * units[0], k[2] * units[1], (k[3] - drag * k[0]) * units[2]];
    let b = [field.radial + field.vertical * u, -field.vertical * s, field.toroidal];
    let e = cross(local, b);
    [k, [0.0, e[0] / units[0], e[1] / units[1], e[2] / units[2]]]
}

#[test]
fn exact_position_angles_are_those_of_parallel_transport() {
    let mut compared = 0;
    for (spin, degrees) in [(0.0, 20.0), (0.9, 60.0), (-0.7, 130.0)] {
        let (hole, lines, screen) = traced(spin, degrees);
        let field = MagneticField { vertical: 0.8, radial: 0.5, toroidal: -0.4 };
        let law = law(FieldFrame::Gas, [field.vertical, field.radial, field.toroidal]);
        for node in (0..lines.points()).step_by(7) {
            let [x, y, z] = [0, 1, 2].map(|c| lines.position[c][node]);
            let r = (x * x + y * y + z * z).sqrt();
            // Gas without angular momentum turns with the frame.
            let area = (r * r + spin * spin).powi(2)
                - spin * spin * hole.delta(r) * (1.0 - (z / r).powi(2));
            let rate = 2.0 * spin * r / area;
            let gas = AngularVelocity::Table { radii: vec![2.0, 3.0], rates: vec![rate; 2] };
            let factors = view(law, &screen, degrees).factors(&lines, &hole, &gas).unwrap();
            let end =
                carry_out(spin, start(&hole, [x, y, z], emitted(&hole, &lines, node, &field)));
            let (s, c) = degrees.to_radians().sin_cos();
            let gauge = end[7] / end[3];
            let f: [f64; 3] = core::array::from_fn(|i| end[8 + i] - gauge * end[4 + i]);
            let miss = (end[4] - s).hypot(end[5]).hypot(end[6] - c);
            assert!(miss < 1e-6, "the ray misses the observer by {miss}");
            let expected = (-f[1]).atan2(-c * f[0] + s * f[2]);
            let found = factors[node].evpa();
            assert!(apart(found, expected).abs() < 1e-6, "a = {spin}: {found} {expected}");
            compared += 1;
        }
    }
    assert!(compared > 30, "{compared}");
}
