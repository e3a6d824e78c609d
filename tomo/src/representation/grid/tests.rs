use super::*;
use crate::representation::conformance::{Subject, check};
use kerrlight_geodesic::Dual;

/// A number with its derivative along a direction.
pub(in crate::representation) type Number = Dual<f64, 1>;

pub(in crate::representation) fn number(value: f64, slope: f64) -> Number {
    Dual { value, slope: [slope] }
}

/// Numbers with their derivatives.
pub(in crate::representation) fn numbers(
    values: &[f64],
    slopes: &[f64],
) -> impl Iterator<Item = Number> {
    values.iter().zip(slopes).map(|(value, slope)| number(*value, *slope))
}

/// The hat function of one of so many nodes from `low` to `high`.
pub(in crate::representation) fn hat(
    [low, high]: [f64; 2],
    nodes: usize,
    node: usize,
    at: Number,
) -> Number {
    let spacing = (high - low) / (nodes - 1) as f64;
    let u = (at.value - low) / spacing - node as f64;
    let slope = if u.abs() < 1.0 { -u.signum() * at.slope[0] / spacing } else { 0.0 };
    number((1.0 - u.abs()).max(0.0), slope)
}

/// Sum over all nodes of a parameter times the functions of the node along each axis.
pub(in crate::representation) fn sum_of_products(
    [nx, ny, nz]: [usize; 3],
    parameters: &mut dyn Iterator<Item = Number>,
    of: impl Fn(usize, usize) -> Number,
) -> Number {
    (0..nx * ny * nz).zip(parameters).fold(number(0.0, 0.0), |sum, (node, p)| {
        sum + p * of(0, node / (ny * nz)) * of(1, node / nz % ny) * of(2, node % nz)
    })
}

pub(in crate::representation) fn activated(activation: Activation, x: Number) -> (f64, f64) {
    let (x, dx) = (x.value, x.slope[0]);
    let sigmoid = 1.0 / (1.0 + (-x).exp());
    match activation {
        Activation::Sigmoid => (sigmoid, dx * sigmoid * (1.0 - sigmoid)),
        Activation::Softplus => (x.max(0.0) + (-x.abs()).exp().ln_1p(), dx * sigmoid),
        Activation::Linear => (x, dx),
    }
}

/// Interpolation, and its derivative.
pub(in crate::representation) fn plain(
    settings: &GridSettings,
    p: &[f64],
    dp: &[f64],
    at: &[f64],
    dat: &[f64],
) -> (f64, f64) {
    let GridSettings { nodes, low, high, activation, .. } = settings;
    if (0..3).any(|k| at[k] < low[k] || at[k] > high[k]) {
        return (0.0, 0.0);
    }
    let of = |k: usize, node| hat([low[k], high[k]], nodes[k], node, number(at[k], dat[k]));
    activated(*activation, sum_of_products(*nodes, &mut numbers(p, dp), of))
}

fn settings(activation: Activation) -> GridSettings {
    let (low, high) = ([-5.0, -4.0, -3.5], [5.0, 4.5, 3.0]);
    GridSettings { nodes: [40, 9, 6], low, high, activation, initial: 1.5 }
}

#[test]
fn exact_grids_conform() {
    for activation in [Activation::Sigmoid, Activation::Softplus, Activation::Linear] {
        let settings = settings(activation);
        let tangent =
            |p: &[f64], dp: &[f64], at: &[f64], dat: &[f64]| plain(&settings, p, dp, at, dat);
        for set in InstructionSet::ALL {
            let grid = Grid::new(settings.clone()).unwrap().on(set);
            let (representation, within) = (&grid, 5.5);
            check(&Subject { representation, within, parameter_noise: 1.0, tangent: &tangent });
        }
    }
}

#[test]
fn exact_linear_functions_are_kept() {
    let settings =
        GridSettings { nodes: [33, 20, 7], initial: 0.0, ..settings(Activation::Linear) };
    let grid = Grid::new(settings).unwrap();
    let of = |x: [f64; 3]| 20.0 + 0.5 * x[0] - 0.25 * x[1] + 2.0 * x[2];
    let node = |k: usize, i: usize| {
        let GridSettings { nodes, low, high, .. } = grid.settings();
        low[k] + (high[k] - low[k]) * i as f64 / (nodes[k] - 1) as f64
    };
    let parameters: Vec<f32> = (0..33 * 20 * 7)
        .map(|i| of([node(0, i / 140), node(1, i / 7 % 20), node(2, i % 7)]) as f32)
        .collect();
    // The corners of the box belong to it.
    let (x, y, z) = ([-5.0, 5.0, 0.3, 5.1], [-4.0, 4.5, 1.7, 0.0], [-3.5, 3.0, -2.2, 0.0]);
    let [a, b, c] = [x, y, z].map(|column| column.map(|x: f64| x as f32));
    let mut values = [0.0f32; 4];
    let at = Coordinates::xyz(&a, &b, &c);
    grid.eval(&parameters, at, &mut values, &mut Workspace::new());
    for k in 0..3 {
        assert!((f64::from(values[k]) - of([x[k], y[k], z[k]])).abs() < 2e-5, "{values:?}");
    }
    assert_eq!(values[3], 0.0);
}

#[test]
fn a_nan_stays_one() {
    let grid = Grid::new(settings(Activation::Sigmoid)).unwrap();
    let parameters = vec![0.0f32; 40 * 9 * 6];
    let (x, nan, mut values) = ([0.0f32], [f32::NAN], [0.0]);
    grid.eval(&parameters, Coordinates::xyz(&x, &nan, &x), &mut values, &mut Workspace::new());
    assert!(values[0].is_nan());
}

#[test]
fn shapes_out_of_range_are_named() {
    let of = |settings| Grid::new(settings).unwrap_err().to_string();
    let text = of(GridSettings { nodes: [4, 1, 4], ..settings(Activation::Sigmoid) });
    assert_eq!(text, "nodes = 1 is not allowed: 2 to 2048 along each axis");
    let text = of(GridSettings { initial: -1.0, ..settings(Activation::Linear) });
    assert_eq!(text, "initial = -1 is not allowed: a finite number, not negative if linear");
}
