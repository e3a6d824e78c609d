//! Published numbers and closed forms of lensing by Schwarzschild and Kerr holes, and of discs, from traced rays. The
//! extent of the critical curve pins signs, which no conservation law sees.

use kerrlight_geodesic::{Inclination, Kerr, Observer, Path, Quantities, Tracer};
use kerrlight_validation::{bardeen, page_thorne, schwarzschild};

fn trace(spin: f64, degrees: f64, alpha: f64, beta: f64, want: Quantities) -> Path {
    let hole = Kerr::new(spin).unwrap();
    let observer = Observer::at_infinity(Inclination::from_degrees(degrees).unwrap());
    let mut path = Path::new();
    let ray = observer.ray(&hole, alpha, beta).unwrap();
    Tracer::new(1e-12).unwrap().trace(&hole, &ray, want, &mut path);
    path
}

/// Critical curves, lensing bands, deflection angles, orbits and discs, as `validation/` has them.
#[test]
fn paper_lensing_and_discs() {
    for case in [bardeen::cases(), schwarzschild::cases(), page_thorne::cases()].concat() {
        assert!(case.passed(), "{case:?}");
    }
}

/// Schwarzschild deflection angles (closed form at 12 digits) over the pole.
#[test]
fn exact_deflection_over_the_pole() {
    let cases = [
        (5.2, 6.810371956663),
        (5.5, 2.553020182345),
        (6.0, 1.719388310230),
        (10.0, 0.590395787606),
        (100.0, 0.041222539749),
        (1000.0, 0.004011823809925),
    ];
    for (b, deflection) in cases {
        let over_the_pole = trace(0.0, 90.0, 0.0, b, Quantities::ALL);
        let end = over_the_pole.at(over_the_pole.mino_total()).direction;
        // It starts at +x and climbs towards +z.
        let turned = end[2].atan2(end[0]).rem_euclid(std::f64::consts::TAU);
        let expected = (std::f64::consts::PI + deflection).rem_euclid(std::f64::consts::TAU);
        assert!((turned - expected).abs() < 1e-10, "b = {b}: {turned} {expected}");
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
