//! The edge of the shadow of a Kerr hole: Bardeen's spherical photon orbits (1973, in Black
//! Holes), projected onto the screen, against where traced rays change their fate.

use crate::report::Case;
use crate::search::{edge, trace};
use kerrlight_geodesic::{Outcome, Quantities};

const AUTHORITY: &str = "Bardeen 1973";

/// λ and η of the spherical photon orbit of radius r.
fn constants(a: f64, r: f64) -> (f64, f64) {
    let delta = r * r - 2.0 * r + a * a;
    let lambda = a + r / a * (r - 2.0 * delta / (r - 1.0));
    let eta = r.powi(3) / (a * a) * (4.0 * delta / (r - 1.0).powi(2) - r);
    (lambda, eta)
}

fn screen(a: f64, degrees: f64, r: f64) -> Option<(f64, f64)> {
    let (sin, cos) = degrees.to_radians().sin_cos();
    let (lambda, eta) = constants(a, r);
    let square = eta + a * a * cos * cos - (lambda * cos / sin).powi(2);
    (square >= 0.0).then(|| (-lambda / sin, square.sqrt()))
}

/// Relative distance from Bardeen's curve, in the direction of one of its points, to where
/// traced rays begin to escape.
fn miss(a: f64, degrees: f64, alpha: f64, beta: f64) -> f64 {
    let captured = |factor: f64| {
        trace(a, degrees, factor * alpha, factor * beta, Quantities::POLAR).outcome()
            == Outcome::Captured
    };
    if !captured(0.99) || captured(1.01) {
        return f64::INFINITY;
    }
    (edge(0.99, 1.01, captured) - 1.0).abs()
}

/// All cases of this file.
pub fn cases() -> Vec<Case> {
    let mut cases = Vec::new();
    for (a, degrees) in
        [(0.2, 30.0), (0.5, 60.0), (0.9, 17.0), (0.94, 85.0), (0.998, 60.0), (-0.8, 130.0)]
    {
        let orbit = |sign: f64| 2.0 * (1.0 + (2.0 / 3.0 * (sign * f64::abs(a)).acos()).cos());
        let (from, to) = (orbit(-1.0), orbit(1.0));
        let misses: Vec<f64> = (1..60)
            .map(|k| from + (to - from) * f64::from(k) / 60.0)
            .filter_map(|r| screen(a, degrees, r))
            .flat_map(|(x, y)| [miss(a, degrees, x, y), miss(a, degrees, x, -y)])
            .collect();
        let name = format!("critical curve of a = {a} at {degrees}°");
        cases.push(Case::sample(AUTHORITY, name, "directions", misses, 2e-13));
    }
    let extents = [(0.9, -2.8444214035, 6.8323192304), (0.99, -2.2517243354, 6.9833234311)];
    for (a, left, right) in extents {
        for (expected, far) in [(left, -10.0), (right, 10.0)] {
            let captured = |alpha| {
                trace(a, 90.0, alpha, 0.0, Quantities::POLAR).outcome() == Outcome::Captured
            };
            let name = format!("extent of the shadow of a = {a} at 90°");
            cases.push(Case::number(AUTHORITY, name, expected, edge(2.0, far, captured), 5e-11));
        }
    }
    cases
}
