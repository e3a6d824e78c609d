use super::*;
use crate::fit::linear::Voxels;
use crate::representation::Activation;
use crate::representation::conformance::{Subject, check};
use crate::representation::grid::tests::{activated, number, numbers, sum_of_products};

const LOW: [f64; 3] = [-5.0, -4.0, -3.5];
const HIGH: [f64; 3] = [5.0, 4.5, 3.0];
const NODES: [usize; 3] = [40, 9, 6];

/// The B-spline of a degree about 0 and its slope, as a sum of truncated powers.
fn spline(degree: usize, x: f64) -> (f64, f64) {
    let n = degree as i32;
    if x.abs() >= 0.5 * (degree as f64 + 1.0) {
        return (0.0, 0.0);
    }
    let factorial = [1.0, 1.0, 2.0, 6.0];
    let (mut value, mut slope, mut binomial) = (0.0, 0.0, 1.0);
    for k in 0..=degree + 1 {
        let u = x + 0.5 * (degree as f64 + 1.0) - k as f64;
        if u > 0.0 {
            value += binomial * u.powi(n) / factorial[degree];
            slope += binomial * u.powi(n - 1) / factorial[degree - 1];
        }
        binomial *= -((degree + 1 - k) as f64) / (k as f64 + 1.0);
    }
    (value, slope)
}

fn plain(degree: Degree, p: &[f64], dp: &[f64], at: &[f64], dat: &[f64]) -> (f64, f64) {
    let spacing = |k: usize| (HIGH[k] - LOW[k]) / (NODES[k] - 1) as f64;
    let outside = |k: usize| {
        let margin = degree.margin() * spacing(k);
        at[k] < LOW[k] + margin || at[k] > HIGH[k] - margin
    };
    if (0..3).any(outside) {
        return (0.0, 0.0);
    }
    let of = |k: usize, node: usize| {
        let u = (at[k] - LOW[k]) / spacing(k) - node as f64;
        let (value, slope) = spline(degree.number(), u);
        number(value, slope * dat[k] / spacing(k))
    };
    activated(Activation::Linear, sum_of_products(NODES, &mut numbers(p, dp), of))
}

#[test]
fn exact_sums_of_b_splines_conform() {
    for degree in [Degree::Linear, Degree::Quadratic, Degree::Cubic] {
        let field = Spline::new(NODES, LOW, HIGH, degree).unwrap();
        let tangent =
            |p: &[f64], dp: &[f64], at: &[f64], dat: &[f64]| plain(degree, p, dp, at, dat);
        let (representation, within) = (&field, 5.5);
        check(&Subject { representation, within, parameter_noise: 1.0, tangent: &tangent });
    }
}

/// B-splines of degree d add up to polynomials of degree d: of factors k², to k² + (d + 1)/12 (Marsden 1970).
#[test]
fn exact_squares_are_kept_with_their_shift() {
    for degree in [Degree::Quadratic, Degree::Cubic] {
        let field = Spline::new([9; 3], [-4.0; 3], [4.0; 3], degree).unwrap();
        let parameters: Vec<f64> = (0..729).map(|k| ((k / 81) as f64 - 4.0).powi(2)).collect();
        let (x, y) = ([0.3, -1.7, 2.2], [0.1, 1.9, -2.1]);
        let mut values = [0.0; 3];
        field.eval(&parameters, Coordinates::xyz(&x, &y, &y), &mut values, &mut Workspace::new());
        for (x, value) in x.into_iter().zip(values) {
            let expected = x * x + (degree.number() as f64 + 1.0) / 12.0;
            assert!((value - expected).abs() < 1e-12, "{degree:?} {x} {value}");
        }
    }
}

#[test]
fn exact_cubes_cover_their_half_width() {
    for degree in [Degree::Linear, Degree::Quadratic, Degree::Cubic] {
        let field = Voxels::cube(12, 3.0, degree).field().unwrap();
        let (edge, beyond) = ([2.9999, -2.9999], [3.0001, -3.0001]);
        let mut values = [0.0f64; 2];
        let ones = vec![1.0; 1728];
        field.eval(
            &ones,
            Coordinates::xyz(&edge, &edge, &edge),
            &mut values,
            &mut Workspace::new(),
        );
        assert!(values.iter().all(|value| (value - 1.0).abs() < 1e-12), "{degree:?} {values:?}");
        let at = Coordinates::xyz(&beyond, &edge, &edge);
        field.eval(&ones, at, &mut values, &mut Workspace::new());
        assert_eq!(values, [0.0; 2]);
    }
}

#[test]
fn exact_few_nodes_are_refused() {
    let error = Voxels::cube(3, 1.0, Degree::Cubic).field().unwrap_err().to_string();
    assert!(error.contains("nodes") && error.contains("4 to 2048"), "{error}");
    assert!(Voxels::cube(4, 1.0, Degree::Cubic).field().is_ok());
}
