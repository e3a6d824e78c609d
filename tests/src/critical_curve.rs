//! The critical curve against 25-digit references (the recipe is
//! tests/reference/critical_curve.py) and the verb that writes it.

use crate::support::{fail_with, new_folder, root, succeed};
use kerrlight_geodesic::analytic::{CriticalCurve, CriticalPoint};
use kerrlight_geodesic::{Inclination, Kerr, Observer};

fn numbers(text: &str) -> Vec<Vec<f64>> {
    text.lines()
        .filter(|line| !line.starts_with('#'))
        .skip(1)
        .map(|line| line.split(',').map(|cell| cell.parse().expect("a number")).collect())
        .collect()
}

fn curve(spin: f64, degrees: f64) -> CriticalCurve {
    CriticalCurve::new(&Kerr::new(spin).unwrap(), Inclination::from_degrees(degrees).unwrap())
}

/// Relative error; λ and δ, which pass through zero, relative to 1 at least.
fn miss(column: usize, found: &[f64; 8], expected: &[f64]) -> f64 {
    if expected[column].is_infinite() {
        return if found[column] == expected[column] { 0.0 } else { f64::INFINITY };
    }
    let scale = if column == 1 || column == 6 { 1.0 } else { 0.0 };
    (found[column] - expected[column]).abs() / expected[column].abs().max(scale).max(1e-300)
}

/// Spins from −1 to 1 with 0, ±1 and their neighbourhoods, inclinations from 0 to 137°, both
/// halves of the curve. Bounds are three times what was measured. γ → 0 and δ, τ → ∞ at the ends
/// of an extremal hole's straight part, where a rounding of the angle moves them by 1e-13.
#[test]
fn code_mpmath_critical_curves() {
    let file = root().join("tests/reference/critical_curve.csv");
    let rows = numbers(&std::fs::read_to_string(file).expect("the references"));
    assert!(rows.len() > 500);
    let mut worst = [const { (0.0f64, Vec::new()) }; 8];
    for row in rows {
        let found = curve(row[0], row[1]).point(row[2]).numbers();
        for (column, worst) in worst.iter_mut().enumerate() {
            let error = miss(column, &found, &row[3..]);
            assert!(!error.is_nan(), "{row:?} {found:?}");
            if error > worst.0 {
                *worst = (error, row[..3].to_vec());
            }
        }
    }
    for (column, (error, row)) in worst.iter().enumerate() {
        let bound = if column < 5 { 2e-15 } else { 2e-13 };
        assert!(*error < bound, "{}: {error:e} at {row:?}", CriticalPoint::NAMES[column]);
    }
}

/// The tracer's verdict turns over on the curve: it shares no formula with it.
#[test]
fn exact_rays_next_to_the_curve_are_captured_or_escape() {
    for (spin, degrees) in [(0.0, 30.0), (1e-9, 60.0), (0.94, 17.0), (-0.7, 90.0), (0.999, 135.0)] {
        let hole = Kerr::new(spin).unwrap();
        let observer = Observer::at_infinity(Inclination::from_degrees(degrees).unwrap());
        for point in curve(spin, degrees).points(24) {
            let captured = |scale: f64| {
                let ray = observer.ray(&hole, point.alpha * scale, point.beta * scale).unwrap();
                ray.potential.captures()
            };
            assert!(captured(1.0 - 1e-13) && !captured(1.0 + 1e-13), "{spin} {point:?}");
        }
    }
}

/// Gralla & Lupsasca 2020b, for the polar orbit of a = 0.94; Schwarzschild's are π, π, 3√3π.
#[test]
fn paper_half_orbits() {
    let found = curve(0.94, 0.0).point(1.0).numbers();
    let expected = [2.5069454821737, 0.0, 22.966933631584];
    assert!(found.iter().zip(expected).all(|(x, y)| (x - y).abs() < 1e-12), "{found:?}");
    let expected = [2.5668730302941, 4.56211886, 15.19949515147];
    let near = |x: f64, y: f64, tolerance: f64| assert!((x - y).abs() < tolerance, "{x} {y}");
    near(found[5], expected[0], 1e-12);
    near(found[6], expected[1], 5e-9);
    near(found[7], expected[2], 1e-11);
    let pi = std::f64::consts::PI;
    for spin in [0.0, 1e-15, -1e-15] {
        for point in curve(spin, 50.0).points(7) {
            let orbit = point.half_orbit();
            near(orbit.gamma, pi, 1e-13);
            near(orbit.delta, pi, 1e-13);
            near(orbit.tau, 27f64.sqrt() * pi, 1e-12);
        }
    }
}

/// A mirrored hole has the mirrored curve; from the other side it is upside down.
#[test]
fn exact_symmetries_of_the_curve() {
    for spin in [0.3, 0.94, 1.0] {
        let points: Vec<_> = curve(spin, 60.0).points(16).collect();
        let mirrored: Vec<_> = curve(-spin, 60.0).points(16).collect();
        let below: Vec<_> = curve(spin, 120.0).points(16).collect();
        for k in 0..16 {
            let image = mirrored[(24 - k) % 16];
            assert!((points[k].alpha + image.alpha).abs() < 1e-13);
            assert!((points[k].beta - image.beta).abs() < 1e-13);
            assert!((points[k].radius - image.radius).abs() < 1e-13);
            let image = below[(16 - k) % 16];
            assert!((points[k].alpha - image.alpha).abs() < 1e-13);
            assert!((points[k].beta + image.beta).abs() < 1e-13);
        }
    }
}

#[test]
fn critical_curve_writes_a_table() {
    let path = &new_folder();
    let arguments = ["critical-curve", "--spin", "-0.94", "--inclination", "17", "--points", "5"];
    let text = succeed(path, &arguments);
    assert_eq!(text.lines().next(), Some("r,lambda,eta,alpha,beta,gamma,delta,tau"));
    let rows = numbers(&text);
    assert_eq!(rows.len(), 5);
    for (row, point) in rows.iter().zip(curve(-0.94, 17.0).points(5)) {
        assert_eq!(row[..], point.numbers());
    }
    assert_eq!(succeed(path, &[&arguments[..], &["-o", "curve.csv"]].concat()), "");
    assert_eq!(std::fs::read_to_string(path.join("curve.csv")).unwrap(), text);
}

#[test]
fn critical_curve_names_what_is_out_of_range() {
    let folder = tempfile::tempdir().unwrap();
    for (spin, inclination, points, key, range) in [
        ("1.2", "17", "5", "--spin", "[-1, 1]"),
        ("0.5", "200", "5", "--inclination", "[0, 180]"),
        ("0.5", "17", "0", "--points", "1..=1000000"),
        ("nan", "17", "5", "--spin", "[-1, 1]"),
    ] {
        let words = ["critical-curve", "--spin", spin, "--inclination", inclination];
        let more = ["--points", points, "-o", "curve.csv"];
        fail_with(folder.path(), &[&words[..], &more].concat(), &[key, range]);
    }
}
