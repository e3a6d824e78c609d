use super::*;
use crate::representation::conformance::{Subject, check};
use crate::representation::grid::tests::{
    Number, activated, hat, number, numbers, sum_of_products,
};

fn settings(activation: Activation) -> FeatureGridSettings {
    let (low, high) = ([-5.0, -4.0, -3.5], [5.0, 4.5, 3.0]);
    FeatureGridSettings { coarsest: 3, levels: 3, low, high, activation, initial: -1.0 }
}

/// A layer, with its parameters one after the other; rectified if there is a next one.
pub(in crate::representation) fn layer(
    p: &mut dyn Iterator<Item = Number>,
    inputs: &[Number],
    units: usize,
    last: bool,
) -> Vec<Number> {
    let weights: Vec<Number> = p.take(inputs.len() * units).collect();
    let biases: Vec<Number> = p.take(units).collect();
    let unit = |h: usize| {
        let products = inputs.iter().enumerate().map(|(i, x)| *x * weights[i * units + h]);
        let sum = products.fold(biases[h], |sum, x| sum + x);
        if last || sum.value > 0.0 { sum } else { number(0.0, 0.0) }
    };
    (0..units).map(unit).collect()
}

/// Interpolation in each grid, then the network, by the rules of derivatives.
fn plain(s: &FeatureGridSettings, p: &[f64], dp: &[f64], at: &[f64], dat: &[f64]) -> (f64, f64) {
    if (0..3).any(|k| at[k] < s.low[k] || at[k] > s.high[k]) {
        return (0.0, 0.0);
    }
    let mut p = numbers(p, dp);
    let mut features = Vec::new();
    for level in 0..s.levels {
        let n = (s.coarsest << level) + 1;
        let of = |k: usize, node| hat([s.low[k], s.high[k]], n, node, number(at[k], dat[k]));
        features.extend([0; 2].map(|_| sum_of_products([n; 3], &mut p, of)));
    }
    let first = layer(&mut p, &features, 16, false);
    let second = layer(&mut p, &first, 16, false);
    let last = layer(&mut p, &second, 1, true)[0];
    assert!(p.next().is_none());
    activated(s.activation, last)
}

#[test]
fn exact_feature_grids_conform() {
    for activation in [Activation::Sigmoid, Activation::Softplus] {
        let settings = settings(activation);
        let tangent =
            |p: &[f64], dp: &[f64], at: &[f64], dat: &[f64]| plain(&settings, p, dp, at, dat);
        for set in InstructionSet::ALL {
            let grid = FeatureGrid::new(settings.clone()).unwrap().on(set);
            let (representation, within) = (&grid, 5.5);
            check(&Subject { representation, within, parameter_noise: 0.3, tangent: &tangent });
        }
    }
}

#[test]
fn a_nan_stays_one() {
    let grid = FeatureGrid::new(settings(Activation::Sigmoid)).unwrap();
    let mut parameters = vec![0.0f32; Representation::<f32>::parameters(&grid)];
    grid.initialise(1, &mut parameters);
    let (x, nan, mut values) = ([0.0f32], [f32::NAN], [0.0]);
    grid.eval(&parameters, Coordinates::xyz(&x, &nan, &x), &mut values, &mut Workspace::new());
    assert!(values[0].is_nan());
}

#[test]
fn shapes_out_of_range_are_named() {
    let of = |settings| FeatureGrid::new(settings).unwrap_err().to_string();
    let text = of(FeatureGridSettings { levels: 7, ..settings(Activation::Sigmoid) });
    assert_eq!(text, "levels = 7 is not allowed: 1 to 6");
    let text = of(FeatureGridSettings { coarsest: 200, ..settings(Activation::Sigmoid) });
    assert_eq!(text, "coarsest = 200 is not allowed: at most 512 cells of the finest grid");
    let text = of(settings(Activation::Linear));
    assert!(text.contains("sigmoid or softplus"), "{text}");
}
