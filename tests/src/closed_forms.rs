//! The closed forms of rays and lensing bands, against 25-digit references, published numbers
//! and the tracer, with which they share the constants of motion only.

use crate::kerr_references::references;
use kerrlight_geodesic::analytic::{ClosedForm, LensingBand};
use kerrlight_geodesic::{Inclination, Kerr, Observer, Path, Quantities, Tracer};

/// All 268 rays: numbers of crossings exactly, Mino times to a few roundings, radii to 1e-15
/// or 30 times what the input's own rounding moves them by (`cond`), as for the tracer.
#[test]
fn code_mpmath_crossings_in_closed_form() {
    for row in references() {
        let number = |column: &str| row[column].parse::<f64>().expect("a number");
        let hole = Kerr::new(number("spin")).unwrap();
        let inclination = Inclination::from_radians(number("inclination_rad")).unwrap();
        let observer = Observer::at_infinity(inclination);
        let ray = observer.ray(&hole, number("alpha"), number("beta")).unwrap();
        let crossings: Vec<_> = ClosedForm::new(&hole, &ray).crossings().collect();
        assert_eq!(crossings.len().to_string(), row["crossings"], "{row:?}");
        for (k, crossing) in (1..=3).zip(&crossings) {
            let miss = crossing.mino_time / number(&format!("mino_{k}")) - 1.0;
            assert!(miss.abs() < 2e-15, "{miss:e} {row:?}");
            let miss = crossing.radius / number(&format!("r_{k}")) - 1.0;
            assert!(miss.abs() < 1e-15 + 30.0 * number("cond"), "{miss:e} {row:?}");
        }
    }
}

/// w at all times, from an observer at infinity or not, captured, scattered and vortical.
#[test]
fn exact_radius_along_traced_rays() {
    let tracer = Tracer::new(1e-13).unwrap();
    let mut path = Path::new();
    let screen = [(0.0, 0.0), (0.1, -0.2), (-3.0, 1.0), (4.0, 4.0), (-20.0, 3.0), (6.0, -0.01)];
    for spin in [-1.0, -0.5, 0.0, 1e-8, 0.94, 1.0] {
        let hole = Kerr::new(spin).unwrap();
        for degrees in [0.0, 17.0, 90.0, 150.0] {
            let inclination = Inclination::from_degrees(degrees).unwrap();
            let far = Observer::at_infinity(inclination);
            let near = Observer::at_radius(inclination, 50.0).unwrap();
            for ((alpha, beta), observer) in screen.iter().flat_map(|p| [(p, far), (p, near)]) {
                let ray = observer.ray(&hole, *alpha, *beta).unwrap();
                tracer.trace(&hole, &ray, Quantities::POLAR, &mut path);
                let form = ClosedForm::new(&hole, &ray);
                let total = path.mino_total();
                let context = format!("{spin} {degrees} {alpha} {beta} {observer:?}");
                assert_eq!(
                    form.crossings().count(),
                    path.equatorial_crossings().len(),
                    "{context}"
                );
                assert!((form.mino_total() / total - 1.0).abs() < 1e-13, "{context}");
                for k in 1..8 {
                    let mino_time = total * f64::from(k) / 8.0;
                    let expected = path.at(mino_time).inverse_radius;
                    let miss = form.inverse_radius(mino_time) - expected;
                    assert!(miss.abs() < 5e-13 * expected, "{miss:e} {context}");
                }
            }
        }
    }
}

/// Gralla, Holz & Wald 2019, from outside and inside; ten digits are published.
#[test]
fn paper_lensing_bands_in_closed_form() {
    let bands = [
        (1, 5.0151354942, 6.1675667648),
        (2, 5.1878081749, 5.2279386085),
        (3, 5.1957902930, 5.1975054871),
    ];
    for (n, inner, outer) in bands {
        let hole = Kerr::new(0.0).unwrap();
        let band = LensingBand::new(&hole, Inclination::from_degrees(0.0).unwrap(), n);
        for angle in [0.0, 1.0, 4.0] {
            let (alpha, beta) = band.inner(angle);
            assert!((alpha.hypot(beta) - inner).abs() < 6e-11);
            let (alpha, beta) = band.outer(angle).unwrap();
            assert!((alpha.hypot(beta) - outer).abs() < 6e-11);
        }
    }
}

/// A traced ray just inside of an edge has a crossing more than one just outside.
#[test]
fn exact_edges_of_lensing_bands() {
    let tracer = Tracer::new(1e-12).unwrap();
    let mut path = Path::new();
    for (spin, degrees) in
        [(0.94, 17.0), (-0.94, 60.0), (0.0, 90.0), (1e-9, 163.0), (1.0, 85.0), (0.999, 0.0)]
    {
        let hole = Kerr::new(spin).unwrap();
        let inclination = Inclination::from_degrees(degrees).unwrap();
        let observer = Observer::at_infinity(inclination);
        for n in 0..4 {
            let band = LensingBand::new(&hole, inclination, n);
            for angle in (0..12).map(|k| 0.05 + f64::from(k) * std::f64::consts::TAU / 12.0) {
                let mut belongs = |(alpha, beta): (f64, f64), scale: f64| {
                    let ray = observer.ray(&hole, alpha * scale, beta * scale).unwrap();
                    tracer.trace(&hole, &ray, Quantities::POLAR, &mut path);
                    path.equatorial_crossings().len() > usize::from(n)
                };
                let context = format!("{spin} {degrees} {n} {angle}");
                let inner = band.inner(angle);
                assert!(!belongs(inner, 1.0 - 1e-9) && belongs(inner, 1.0 + 1e-9), "{context}");
                let outer = band.outer(angle);
                assert_eq!(outer.is_none(), n == 0, "{context}");
                if let Some(outer) = outer {
                    assert!(belongs(outer, 1.0 - 1e-9) && !belongs(outer, 1.0 + 1e-9), "{context}");
                }
            }
        }
    }
}
