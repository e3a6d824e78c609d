//! Parallel transport that is integrated step by step, in Kerr–Schild coordinates. Fits are tested by it as well.

use kerrlight_geodesic::vector::norm;
use kerrlight_geodesic::{Dual, Kerr, Scalar, ZamoFrame};

/// The place, and two vectors (t, x, y, z): of a photon, and what it carries along.
pub struct Transported {
    x: [f64; 3],
    k: [f64; 4],
    f: [f64; 4],
}

impl Transported {
    /// Transforms from the frame to ingoing Kerr–Schild coordinates whose azimuth is Boyer and
    /// Lindquist's at infinity: dt̃ = dt + 2r dr/Δ, dφ̃ = dφ + a dr/Δ, x + iy = (r + ia) sin θ e^{iφ̃},
    /// z = r cos θ.
    pub fn new(hole: &Kerr, frame: &ZamoFrame, azimuth: f64, k: [f64; 4], f: [f64; 4]) -> Self {
        let (a, r) = (hole.spin(), frame.radius());
        let [s, c] = frame.polar_angle();
        let (sin, cos) = (azimuth + hole.azimuth_closed_form(1.0 / r)).sin_cos();
        let (x, y) = ((r * cos - a * sin) * s, (r * sin + a * cos) * s);
        let convert = |v: [f64; 4]| {
            let [t, dr, dtheta, dphi] = frame.to_coordinates(v);
            let turn = dphi + a * dr / hole.delta(r);
            let dx = dr * cos * s + x / s * c * dtheta - y * turn;
            let dy = dr * sin * s + y / s * c * dtheta + x * turn;
            [t + 2.0 * r * dr / hole.delta(r), dx, dy, dr * c - r * s * dtheta]
        };
        Self { x: [x, y, r * c], k: convert(k), f: convert(f) }
    }

    /// Runge–Kutta steps of order 4 whose length is `step` times the distance, out to 1e10 M.
    pub fn carried_out(self, a: f64, step: f64) -> Self {
        let rate = |y: &[f64; 11]| {
            let x = [y[0], y[1], y[2]];
            let (k, f) = ([y[3], y[4], y[5], y[6]], [y[7], y[8], y[9], y[10]]);
            let (dk, df) = (turn(a, x, k, k), turn(a, x, k, f));
            [k[1], k[2], k[3], dk[0], dk[1], dk[2], dk[3], df[0], df[1], df[2], df[3]]
        };
        let Self { x, k, f } = self;
        let mut y = [x[0], x[1], x[2], k[0], k[1], k[2], k[3], f[0], f[1], f[2], f[3]];
        let distance = |y: &[f64; 11]| norm([y[0], y[1], y[2]]);
        while distance(&y) < 1e10 {
            let h = step * distance(&y);
            let plus = |d: &[f64; 11], h: f64| std::array::from_fn(|i| y[i] + h * d[i]);
            let k1 = rate(&y);
            let k2 = rate(&plus(&k1, 0.5 * h));
            let k3 = rate(&plus(&k2, 0.5 * h));
            let k4 = rate(&plus(&k3, h));
            y = std::array::from_fn(|i| y[i] + h / 6.0 * (k1[i] + 2.0 * (k2[i] + k3[i]) + k4[i]));
        }
        let (k, f) = ([y[3], y[4], y[5], y[6]], [y[7], y[8], y[9], y[10]]);
        Self { x: [y[0], y[1], y[2]], k, f }
    }

    /// (north, east) of the vector on the screen, and by how much the ray misses the observer.
    pub fn on_screen(&self, inclination: f64) -> ([f64; 2], f64) {
        let (s, c) = inclination.sin_cos();
        let gauge = self.f[0] / self.k[0];
        let f: [f64; 3] = std::array::from_fn(|i| self.f[i + 1] - gauge * self.k[i + 1]);
        let miss = (self.k[1] - s).hypot(self.k[2]).hypot(self.k[3] - c);
        ([-c * f[0] + s * f[2], -f[1]], miss)
    }
}

/// g_μν = η_μν + F l_μ l_ν, its derivatives by dual numbers, and F, l_μ.
fn metric(a: f64, place: [f64; 3]) -> ([[Dual<f64, 3>; 4]; 4], f64, [f64; 4]) {
    let [x, y, z]: [Dual<f64, 3>; 3] = std::array::from_fn(|i| Dual::parameter(place[i], i));
    let of = Dual::<f64, 3>::constant;
    let (a, a2) = (of(a), of(a * a));
    let b = x * x + y * y + z * z - a2;
    let r2 = (b + (b * b + of(4.0) * a2 * z * z).sqrt()) / of(2.0);
    let r = r2.sqrt();
    let strength = of(2.0) * r2 * r / (r2 * r2 + a2 * z * z);
    let l = [of(1.0), (r * x + a * y) / (r2 + a2), (r * y - a * x) / (r2 + a2), z / r];
    let flat = |i: usize, j: usize| if i != j { 0.0 } else { [-1.0, 1.0, 1.0, 1.0][i] };
    let at = |i: usize, j: usize| of(flat(i, j)) + strength * l[i] * l[j];
    let g = std::array::from_fn(|i| std::array::from_fn(|j| at(i, j)));
    (g, strength.value, l.map(|x| x.value))
}

/// −Γ^μ_{αβ} k^α v^β from the Christoffel symbols, term by term.
fn turn(a: f64, place: [f64; 3], k: [f64; 4], v: [f64; 4]) -> [f64; 4] {
    let (g, strength, l) = metric(a, place);
    let slope = |c: usize, i: usize, j: usize| if c == 0 { 0.0 } else { g[i][j].slope[c - 1] };
    let mut lower = [0.0; 4];
    for (nu, out) in lower.iter_mut().enumerate() {
        for (al, k) in k.iter().enumerate() {
            for (be, v) in v.iter().enumerate() {
                let gamma = slope(al, nu, be) + slope(be, nu, al) - slope(nu, al, be);
                *out -= 0.5 * gamma * k * v;
            }
        }
    }
    let eta = [-1.0, 1.0, 1.0, 1.0];
    let along: f64 = (0..4).map(|i| eta[i] * l[i] * lower[i]).sum();
    std::array::from_fn(|i| eta[i] * (lower[i] - strength * l[i] * along))
}
