//! The photon ring: images of one circle in the equatorial plane, n = 1…6, approach the
//! critical curve by e^{−γ} per half-orbit, turn by δ and lag by τ (Gralla & Lupsasca 2020b,
//! arXiv:1910.12873; γ = π without spin; values for the polar orbit of a = 0.94 from its
//! closed forms).

use crate::report::Case;
use crate::search::{edge, trace};
use kerrlight_geodesic::{PathPoint, Quantities};

const AUTHORITY: &str = "Gralla & Lupsasca 2020";

/// Impact parameter and place of the n-th image of the circle of radius r, seen face-on,
/// outside the critical curve.
fn image(spin: f64, critical: f64, r: f64, n: usize) -> (f64, PathPoint) {
    let nth = |b: f64| {
        let path = trace(spin, 0.0, b, 0.0, Quantities::ALL);
        path.equatorial_crossings().nth(n - 1).map(|time| path.at(time))
    };
    // Further out the n-th crossing is farther away, then missing.
    let nearer = |b: f64| nth(b).is_some_and(|hit| hit.radius() < r);
    let b = edge(critical, critical + 4.0, nearer);
    let hit = nth(b).expect("the bisection ends at an image"); // the nearer side has one
    (b, hit)
}

fn ring(spin: f64, critical: f64, expected: [f64; 3], cases: &mut Vec<Case>) {
    let images: Vec<_> = (2..=6).map(|n| image(spin, critical, 10.0, n)).collect();
    for (k, pair) in images.windows(2).enumerate() {
        let [(b0, hit0), (b1, hit1)] = pair else { continue };
        let n = k + 2;
        let ratio = ((b0 - critical) / (b1 - critical)).ln();
        // Corrections fall by e^{−γ} per image themselves.
        let allowed = 0.3 * (-expected[0] * (n as f64 - 2.0)).exp() + 1e-7;
        let name = |what: &str| format!("{what}, a = {spin} face-on, images {n} and {}", n + 1);
        cases.push(Case::number(AUTHORITY, name("γ"), expected[0], ratio, allowed));
        // Backward, and modulo 2π: a ray through the axis may count as passing on either side.
        let turned = (hit0.azimuth - hit1.azimuth).rem_euclid(std::f64::consts::TAU);
        cases.push(Case::number(AUTHORITY, name("δ mod 2π"), expected[1], turned, allowed));
        let lag = hit1.delay - hit0.delay;
        cases.push(Case::number(AUTHORITY, name("τ"), expected[2], lag, allowed));
    }
}

/// All cases of this file.
pub fn cases() -> Vec<Case> {
    use std::f64::consts::PI;
    let mut cases = Vec::new();
    ring(0.0, 27f64.sqrt(), [PI, PI, PI * 27f64.sqrt()], &mut cases);
    let (spin, eta): (f64, f64) = (0.94, 22.966933631584);
    let critical = (eta + spin * spin).sqrt();
    ring(spin, critical, [2.5668730302941, 4.56211886, 15.19949515147], &mut cases);
    cases
}
