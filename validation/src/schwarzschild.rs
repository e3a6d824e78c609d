//! Light around a hole without spin: Darwin's closed form of the deflection (1959, Proc. R.
//! Soc. A 249, 180) in Legendre's integrals, its strong-deflection limit, and the lensing
//! bands of Gralla, Holz & Wald (2019, arXiv:1906.00873).

use crate::report::Case;
use crate::search::{edge, trace};
use kerrlight_geodesic::Quantities;
use std::f64::consts::PI;

const DARWIN: &str = "Darwin 1959";
const GRALLA_HOLZ_WALD: &str = "Gralla, Holz & Wald 2019";

/// Radius of closest approach: the largest root of r³ − b²r + 2b² = 0 (Viète).
fn closest_approach(b: f64) -> f64 {
    let third = (-(27f64.sqrt()) / b).acos() / 3.0;
    2.0 * b / 3f64.sqrt() * third.cos()
}

/// α = 4√(r₀/Q) [K(m) − F(ζ, m)] − π with Q² = (r₀ − 2)(r₀ + 6), m = (Q − r₀ + 6)/2Q,
/// sin²ζ = (Q − r₀ + 2)/(Q − r₀ + 6).
fn deflection(b: f64) -> Option<f64> {
    let r0 = closest_approach(b);
    let q = ((r0 - 2.0) * (r0 + 6.0)).sqrt();
    let m = (q - r0 + 6.0) / (2.0 * q);
    let zeta = ((q - r0 + 2.0) / (q - r0 + 6.0)).sqrt().asin();
    let complete = ellip::ellipk(m).ok()?;
    let incomplete = ellip::ellipf(zeta, m).ok()?;
    Some(4.0 * (r0 / q).sqrt() * (complete - incomplete) - PI)
}

fn traced_deflection(b: f64) -> f64 {
    let path = trace(0.0, 90.0, b, 0.0, Quantities::ALL);
    path.at(path.mino_total()).azimuth.abs() - PI
}

/// All cases of this file.
pub fn cases() -> Vec<Case> {
    let mut cases = Vec::new();
    let captured = |b: f64| trace(0.0, 17.0, b, 0.0, Quantities::POLAR).turning_point().is_none();
    let critical = edge(5.0, 6.0, captured);
    cases.push(Case::number(
        DARWIN,
        "critical impact parameter 3√3",
        27f64.sqrt(),
        critical,
        1e-14,
    ));
    for b in [5.2, 5.3, 5.5, 6.0, 8.0, 10.0, 30.0, 100.0, 1000.0] {
        if let Some(expected) = deflection(b) {
            let name = format!("deflection at b = {b} (absolute)");
            let found = traced_deflection(b);
            let mut case = Case::number(DARWIN, name, expected, found, 2e-12);
            case.error = (found - expected).abs();
            cases.push(case);
        }
    }
    let constant = (216.0 * (7.0 - 4.0 * 3f64.sqrt())).ln() - PI;
    let b = 27f64.sqrt() * (1.0 + 1e-9);
    let limit = constant - (b / 27f64.sqrt() - 1.0).ln();
    let found = traced_deflection(b);
    cases.push(Case::number(
        DARWIN,
        "strong-deflection limit at b/b_c − 1 = 1e-9",
        limit,
        found,
        1e-7,
    ));
    let bands = [
        (2, 5.0151354942, 6.1675667648),
        (3, 5.1878081749, 5.2279386085),
        (4, 5.1957902930, 5.1975054871),
    ];
    for (count, inner, outer) in bands {
        let crosses = |b: f64| {
            trace(0.0, 0.0, b, 0.0, Quantities::POLAR).equatorial_crossings().len() >= count
        };
        let middle = 27f64.sqrt() + 1e-6;
        for (name, expected, far) in [("inner", inner, 4.0), ("outer", outer, 7.0)] {
            let name = format!("{name} edge of the band of {count} crossings, face-on");
            let found = edge(middle, far, crosses);
            cases.push(Case::number(GRALLA_HOLZ_WALD, name, expected, found, 2e-11));
        }
    }
    cases
}
