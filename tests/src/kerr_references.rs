//! Rays against 25-digit references from the separated Boyer–Lindquist integrals (the
//! recipe is tests/reference/kerr_crossings.py), which share no equation with the tracer.

use crate::support::{root, succeed};
use std::collections::HashMap;

/// The table of the references, from the root of the repository.
const TABLE: &str = "tests/reference/kerr_crossings.csv";

/// Rows of a CSV text as maps from column to text.
fn rows(text: &str) -> Vec<HashMap<String, String>> {
    let mut lines = text.lines().filter(|line| !line.starts_with('#') && !line.is_empty());
    let header: Vec<&str> = lines.next().expect("a header").split(',').collect();
    lines
        .map(|line| {
            let cells = line.split(',').map(str::to_owned);
            header.iter().map(|name| (*name).to_owned()).zip(cells).collect()
        })
        .collect()
}

/// The rays of the references.
pub fn references() -> Vec<HashMap<String, String>> {
    rows(&std::fs::read_to_string(root().join(TABLE)).expect("the references"))
}

fn number(row: &HashMap<String, String>, column: &str) -> Option<f64> {
    row.get(column).filter(|text| !text.is_empty()).map(|text| text.parse().expect("a number"))
}

/// Largest errors over all rays: [relative r and r_min, Mino time, azimuth, delay].
fn compare(integrator: &str, tolerance: &str) -> [f64; 4] {
    let expected = references();
    let how = ["--integrator", integrator, "--tolerance", tolerance];
    let arguments = [&["trace", "--rays", TABLE, "--crossings", "3"][..], &how].concat();
    let found = rows(&succeed(&root(), &arguments));
    assert_eq!(expected.len(), found.len());
    assert!(expected.len() > 250);
    let mut worst = [0.0f64; 4];
    for (expected, found) in expected.iter().zip(&found) {
        for column in ["outcome", "crossings"] {
            assert_eq!(expected[column], found[column], "{expected:?}");
        }
        // Where the input's own rounding moves the answer by more, it is no measure.
        let rounding = 30.0 * number(expected, "cond").expect("cond");
        let mut add = |kind: usize, error: f64| {
            assert!(!error.is_nan(), "{expected:?}");
            worst[kind] = worst[kind].max(error - rounding);
        };
        let pair = |column: &str| Some((number(expected, column)?, number(found, column)?));
        assert_eq!(expected["r_min"].is_empty(), found["r_min"].is_empty(), "{expected:?}");
        for k in 1..=3 {
            let Some((r, r_found)) = pair(&format!("r_{k}")) else { continue };
            add(0, (r_found / r - 1.0).abs());
            let (tau, tau_found) = pair(&format!("mino_{k}")).expect("a Mino time");
            add(1, (tau_found / tau - 1.0).abs());
            let (phi, phi_found) = pair(&format!("phi_{k}")).expect("an azimuth");
            let miss = phi_found - phi;
            add(2, (miss - std::f64::consts::TAU * (miss / std::f64::consts::TAU).round()).abs());
            let (delay, delay_found) = pair(&format!("delay_{k}")).expect("a delay");
            add(3, (delay_found - delay).abs() / delay.abs().max(1.0));
        }
    }
    worst
}

/// Users are promised 1e-11 in r and azimuth at the default tolerance.
#[test]
fn code_mpmath_crossings_at_the_default_tolerance() {
    for integrator in ["taylor-mino", "dop853-mino", "rk45-mino", "elliptic"] {
        let [r, mino_time, azimuth, delay] = compare(integrator, "1e-12");
        assert!(r < 1e-11, "{integrator}: {r:e}");
        assert!(mino_time < 1e-13, "{integrator}: {mino_time:e}");
        assert!(azimuth < 1e-11, "{integrator}: {azimuth:e}");
        // The quadrature of the closed form, of fixed order, leaves a little more.
        let bound = if integrator == "elliptic" { 3e-10 } else { 1e-11 };
        assert!(delay < bound, "{integrator}: {delay:e}");
    }
}

/// Local errors 10⁴ times larger: global errors follow.
#[test]
fn code_mpmath_crossings_follow_the_tolerance() {
    for integrator in ["taylor-mino", "dop853-mino", "rk45-mino"] {
        let [r, mino_time, azimuth, delay] = compare(integrator, "1e-8");
        assert!(r < 5e-7, "{integrator}: {r:e}");
        assert!(mino_time < 1e-9, "{integrator}: {mino_time:e}");
        assert!(azimuth < 5e-8, "{integrator}: {azimuth:e}");
        assert!(delay < 5e-7, "{integrator}: {delay:e}");
    }
}

/// Numbers of twice the precision round to the same doubles as the 25 digits do, where the
/// input is exact: the oracle of the accuracy sweeps.
#[test]
fn code_oracle_and_mpmath_agree_to_the_last_digit() {
    use kerrlight_validation::accuracy::Oracle;
    use kerrlight_validation::accuracy::rays::{Angle, Draw};
    let mut oracle = Oracle::default();
    let mut compared = 0;
    for row in references() {
        let value = |name: &str| number(&row, name);
        let given = |name: &str| value(name).expect("an input");
        let inclination = Angle::Radians(given("inclination_rad"));
        let (spin, alpha, beta) = (given("spin"), given("alpha"), given("beta"));
        let ray = Draw { spin, inclination, radius: f64::INFINITY, alpha, beta };
        oracle.trace(&ray).expect("a ray");
        assert_eq!(oracle.outcome().name(), row["outcome"], "{row:?}");
        let times = oracle.crossings();
        assert_eq!(times.len().to_string(), row["crossings"], "{row:?}");
        for (k, mino_time) in times.iter().map(|time| time.hi).enumerate().take(3) {
            let expected = value(&format!("mino_{}", k + 1)).expect("a Mino time");
            // A double and the one next to it.
            assert!((mino_time / expected - 1.0).abs() <= 2.0 * f64::EPSILON, "{row:?}");
            let r = value(&format!("r_{}", k + 1)).expect("a radius");
            // At the rounded time of the crossing: what that moves is its condition.
            let found = oracle.at(mino_time).radius().hi;
            let condition = given("cond").max(f64::EPSILON);
            assert!((found / r - 1.0).abs() <= 4.0 * condition, "{row:?}: {found}");
            compared += 1;
        }
    }
    assert!(compared > 300);
}
