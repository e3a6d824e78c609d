//! Published numbers of lensing by Schwarzschild and Kerr holes, from traced rays. The
//! extent of the critical curve pins signs, which no conservation law sees.

use kerrlight_geodesic::{Inclination, Kerr, Observer, Outcome, Path, Quantities, Tracer};

fn trace(spin: f64, degrees: f64, alpha: f64, beta: f64, want: Quantities) -> Path {
    let hole = Kerr::new(spin).unwrap();
    let observer = Observer::at_infinity(Inclination::from_degrees(degrees).unwrap());
    let mut path = Path::new();
    let ray = observer.ray(&hole, alpha, beta).unwrap();
    Tracer::new(1e-12).unwrap().trace(&hole, &ray, want, &mut path);
    path
}

/// Bisects for where `inside` changes from true at `lo` to false at `hi`.
fn edge(mut lo: f64, mut hi: f64, inside: impl Fn(f64) -> bool) -> f64 {
    assert!(inside(lo) && !inside(hi));
    for _ in 0..48 {
        let middle = 0.5 * (lo + hi);
        if inside(middle) { lo = middle } else { hi = middle }
    }
    0.5 * (lo + hi)
}

/// Bardeen 1973: at 90° the shadow of a = 0.9 reaches from α = −2.8444 (the flat side, where
/// a prograde disc approaches) to 6.8323.
#[test]
fn paper_extent_of_the_shadow() {
    let cases = [(0.9, -2.8444214035, 6.8323192304), (0.99, -2.2517243354, 6.9833234311)];
    for (spin, left, right) in cases {
        let captured =
            |alpha| trace(spin, 90.0, alpha, 0.0, Quantities::POLAR).outcome() == Outcome::Captured;
        assert!((edge(2.0, -10.0, captured) - left).abs() < 2e-10);
        assert!((edge(2.0, 10.0, captured) - right).abs() < 2e-10);
        let mirrored = |alpha| {
            trace(-spin, 90.0, alpha, 0.0, Quantities::POLAR).outcome() == Outcome::Captured
        };
        assert!((edge(-2.0, 10.0, mirrored) + left).abs() < 2e-10);
    }
}

/// Gralla, Holz & Wald 2019: impact parameters between which a ray to a face-on observer
/// crosses the equatorial plane of a Schwarzschild hole at least 2, 3, 4 times.
#[test]
fn paper_lensing_bands() {
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
        assert!((edge(middle, 4.0, crosses) - inner).abs() < 2e-10, "{count}");
        // Beyond the outer edge the ray still crosses, but at r → ∞: the crossing is lost
        // where the deflection falls short of (n − 1/2)π.
        assert!((edge(middle, 7.0, crosses) - outer).abs() < 2e-10, "{count}");
    }
}

/// Schwarzschild deflection angles (closed form at 12 digits) in the equatorial plane and
/// over the pole.
#[test]
fn exact_deflection_angles() {
    let cases = [
        (5.2, 6.810371956663),
        (5.5, 2.553020182345),
        (6.0, 1.719388310230),
        (10.0, 0.590395787606),
        (100.0, 0.041222539749),
        (1000.0, 0.004011823809925),
    ];
    for (b, deflection) in cases {
        let path = trace(0.0, 90.0, b, 0.0, Quantities::ALL);
        let end = path.at(path.mino_total());
        let found = end.azimuth.abs() - std::f64::consts::PI;
        assert!((found - deflection).abs() < 1e-10, "b = {b}: {found}");
        let over_the_pole = trace(0.0, 90.0, 0.0, b, Quantities::ALL);
        let end = over_the_pole.at(over_the_pole.mino_total()).direction;
        // It starts at +x and climbs towards +z.
        let turned = end[2].atan2(end[0]).rem_euclid(std::f64::consts::TAU);
        let expected = (std::f64::consts::PI + deflection).rem_euclid(std::f64::consts::TAU);
        assert!((turned - expected).abs() < 1e-10, "b = {b}: {turned} {expected}");
    }
}

/// Next to the critical curve the deflection diverges as
/// −ln(b/b_c − 1) + ln(216(7 − 4√3)) − π (Darwin 1959).
#[test]
fn exact_strong_deflection_limit() {
    let limit = (216.0 * (7.0 - 4.0 * 3f64.sqrt())).ln() - std::f64::consts::PI;
    for distance in [1e-4, 1e-6, 1e-8] {
        let b = 27f64.sqrt() * (1.0 + distance);
        let actual = b / 27f64.sqrt() - 1.0;
        let path = trace(0.0, 90.0, b, 0.0, Quantities::ALL);
        let deflection = path.at(path.mino_total()).azimuth.abs() - std::f64::consts::PI;
        let miss = deflection - (limit - actual.ln());
        // The next term is of order distance · ln(distance); b's rounding adds 1e-16/distance.
        assert!(miss.abs() < 20.0 * distance + 1e-9 + 1e-15 / distance, "{distance}: {miss:e}");
    }
}

/// Every observer sees from far away that the delay of a point behind the hole exceeds that of a
/// point in front of it, and far away it is that of flat space plus logarithms.
#[test]
fn exact_delay_far_from_the_hole() {
    // From the point of closest approach at r₀ = b − 1, t_o − t = √(r_o² − r₀²) +
    // 2 ln[(r_o + √(r_o² − r₀²))/r₀] + √[(r_o − r₀)/(r_o + r₀)] (Shapiro). The ray has been
    // bent by 2/b by then, so that point lies 2 M beyond the equatorial plane.
    let path = trace(0.0, 0.0, 1e4, 0.0, Quantities::ALL);
    let hit = path.at(path.equatorial_crossings().next().unwrap());
    let expected = 2.0 * (2.0f64 / 1e4).ln() + 1.0 - 2.0;
    assert!((hit.delay - expected).abs() < 2e-3, "{} {expected}", hit.delay);
}
