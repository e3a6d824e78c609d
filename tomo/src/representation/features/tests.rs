use super::*;
use crate::representation::conformance::{Subject, check};

fn settings(activation: Activation) -> FeatureGridSettings {
    let (low, high) = ([-5.0, -4.0, -3.5], [5.0, 4.5, 3.0]);
    FeatureGridSettings { coarsest: 3, levels: 3, low, high, activation, initial: -1.0 }
}

/// A number and its change.
type Dual = (f64, f64);

fn times(a: Dual, b: Dual) -> Dual {
    (a.0 * b.0, a.0 * b.1 + a.1 * b.0)
}

fn plus(a: Dual, b: Dual) -> Dual {
    (a.0 + b.0, a.1 + b.1)
}

/// A layer of 16 or of one, with its parameters one after the other; rectified if there is a next one.
fn layer(
    p: &mut dyn Iterator<Item = Dual>,
    inputs: &[Dual],
    units: usize,
    last: bool,
) -> Vec<Dual> {
    let weights: Vec<Dual> = p.take(inputs.len() * units).collect();
    let biases: Vec<Dual> = p.take(units).collect();
    let unit = |h: usize| {
        let products = inputs.iter().enumerate().map(|(i, x)| times(*x, weights[i * units + h]));
        let sum = products.fold(biases[h], plus);
        if last || sum.0 > 0.0 { sum } else { (0.0, 0.0) }
    };
    (0..units).map(unit).collect()
}

/// Interpolation as a sum over all nodes of products of hat functions, then the network, by the rules of derivatives.
fn plain(s: &FeatureGridSettings, p: &[f64], dp: &[f64], at: &[f64], dat: &[f64]) -> Dual {
    if (0..3).any(|k| at[k] < s.low[k] || at[k] > s.high[k]) {
        return (0.0, 0.0);
    }
    let mut p = p.iter().copied().zip(dp.iter().copied());
    let mut features = Vec::new();
    for level in 0..s.levels {
        let n = (s.coarsest << level) + 1;
        let hat = |k: usize, node: usize| -> Dual {
            let spacing = (s.high[k] - s.low[k]) / (n - 1) as f64;
            let u = (at[k] - s.low[k]) / spacing - node as f64;
            if u.abs() < 1.0 { (1.0 - u.abs(), -u.signum() * dat[k] / spacing) } else { (0.0, 0.0) }
        };
        for _ in 0..2 {
            let sum = (0..n * n * n).fold((0.0, 0.0), |sum, node| {
                let product =
                    times(times(hat(0, node / (n * n)), hat(1, node / n % n)), hat(2, node % n));
                plus(sum, times(product, p.next().unwrap()))
            });
            features.push(sum);
        }
    }
    let first = layer(&mut p, &features, 16, false);
    let second = layer(&mut p, &first, 16, false);
    let (x, dx) = layer(&mut p, &second, 1, true)[0];
    assert!(p.next().is_none());
    let sigmoid = 1.0 / (1.0 + (-x).exp());
    match s.activation {
        Activation::Sigmoid => (sigmoid, dx * sigmoid * (1.0 - sigmoid)),
        _ => (x.exp().ln_1p(), dx * sigmoid),
    }
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
