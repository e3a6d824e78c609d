//! Losses with penalties: gradients of the whole, and what total variation does to noise.

use super::training::settings;
use super::*;
use crate::fit::linear::Prior;
use crate::optimise::Polynomial;
use crate::representation::{Allowed, Changing, Knots};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;

fn priors(of: &[Regulariser]) -> Vec<Prior> {
    let weights = [0.3, 0.2, 0.05, 0.4];
    of.iter().zip(weights).map(|(r, weight)| Prior { regulariser: *r, weight }).collect()
}

fn region() -> Region {
    settings().region
}

/// A trainer whose loss is all frames with these penalties.
fn penalised(representation: &dyn Representation<f64>, penalties: Penalties) -> Trainer<'_, f64> {
    let training = Training {
        batch: BatchSize::All,
        occupancy: None,
        penalties: Some(penalties),
        change: None,
        ..settings()
    };
    Trainer::new(objective(true, true, true), representation, training)
}

/// Central differences of the whole loss along parameters and, where the field is smooth and knows of it, the axis
/// together, at a step's draws.
fn check(trainer: &mut Trainer<'_, f64>, parameters: &[f64], step: u64, turned: bool) {
    let axis = Axis::new([0.3, -0.5, 0.8]).unwrap();
    let mut of_axis = [0.0; 3];
    let place = Place { parameters, axis, occupancy: None, step };
    let loss = trainer.loss(place, &mut of_axis);
    let slopes = trainer.gradient().to_vec();
    let data: f64 = loss.terms.iter().zip([0.7, 1.3, 0.4]).map(|(t, w)| t * w).sum();
    let more: f64 = loss.penalties.iter().sum();
    assert!((loss.total - data - more).abs() < 1e-12 * loss.total && more > 0.0);
    let way: Vec<f64> = (0..slopes.len()).map(|k| (k as f64 * 0.7).cos()).collect();
    let turn = if turned { axis.tangent([0.2, 1.0, 0.3]) } else { [0.0; 3] };
    let mut at = |h: f64| {
        let moved: Vec<f64> = parameters.iter().zip(&way).map(|(x, d)| x + h * d).collect();
        let axis = axis.moved(turn.map(|x| h * x));
        trainer.loss(Place { parameters: &moved, axis, occupancy: None, step }, &mut [0.0; 3]).total
    };
    let difference = (at(1e-5) - at(-1e-5)) / 2e-5;
    let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
    let product = dot(&slopes, &way) + dot(&of_axis, &turn);
    assert!((difference - product).abs() < 1e-7 * product.abs(), "{difference} {product}");
}

#[test]
fn exact_gradient_of_the_whole_loss_by_differences() {
    let all = [
        Regulariser::TotalVariation { epsilon: 0.3 },
        Regulariser::Smoothness,
        Regulariser::Sparsity,
        Regulariser::Entropy { level: 0.4, floor: 0.5 },
    ];
    let grid = grid();
    for probe in [Probe::Moved { nodes: 9 }, Probe::Fixed { nodes: 7 }] {
        let penalties = Penalties { priors: priors(&all), probe, region: region() };
        check(&mut penalised(&grid, penalties), &start(&grid), 3, false);
    }
    // Fields that may be negative, where sparsity has a kink.
    for blobs in [Blobs::STEADY, Blobs::CHANGING, Blobs::EVENTS] {
        let (priors, probe) = (priors(&all[..2]), Probe::Moved { nodes: 9 });
        let penalties = Penalties { priors, probe, region: region() };
        check(&mut penalised(&blobs, penalties), &start(&blobs), 5, blobs.carried);
    }
}

/// Emission that changes while matter carries it has its price in the loss, with its gradient.
#[test]
fn exact_gradient_of_a_loss_with_change_by_differences() {
    let knots = Knots { first: -20.0, spacing: 15.0, count: 4, allowed: Allowed::Any };
    let steps = Changing::new(Box::new(grid()), knots, None).unwrap();
    let of_time: [(&dyn Representation<f64>, bool); 2] =
        [(&steps, true), (&Blobs::CHANGING, false)];
    for (representation, linear) in of_time {
        let change = ChangePrice { weight: 0.01, knots, linear, region: region() };
        let (batch, change) = (BatchSize::All, Some(change));
        let training = Training { batch, change, occupancy: None, penalties: None, ..settings() };
        let mut trainer = Trainer::new(objective(true, true, true), representation, training);
        check(&mut trainer, &start(representation), 5, !linear);
        assert_eq!(trainer.training.penalty_names(), ["change"]);
    }
}

/// At its own nodes a grid's penalty is that of its values.
#[test]
fn exact_penalties_of_a_grid_are_those_of_its_nodes() {
    let grid = grid();
    let parameters = start(&grid);
    let of = Regulariser::TotalVariation { epsilon: 0.1 };
    let penalties =
        Penalties { priors: priors(&[of]), probe: Probe::Fixed { nodes: 7 }, region: region() };
    let mut trainer = penalised(&grid, penalties);
    let axis = Axis::new([0.0, 0.0, 1.0]).unwrap();
    let place = Place { parameters: &parameters, axis, occupancy: None, step: 0 };
    let found = trainer.loss(place, &mut [0.0; 3]).penalties;
    let values: Vec<f64> = parameters.iter().map(|x| x.exp().ln_1p()).collect();
    let shape = Shape { nodes: [7; 3], spacing: [2.0; 3] };
    let known = of.value_and_gradient(&values, shape, 0.3, &mut vec![0.0; values.len()]);
    assert!((found[0] - known).abs() < 1e-12 * known, "{found:?} {known}");
}

/// A blob, recovered from images with noise by a grid that has more nodes than the noise allows: total variation makes
/// the recovery smoother, and closer to the blob.
#[test]
fn exact_total_variation_lowers_the_variation_of_a_noisy_recovery() {
    let axis = Axis::new([0.1, 0.2, 0.9]).unwrap();
    let blob = |x: [f64; 3]| {
        let square: f64 = x.iter().zip([3.5, 1.0, 1.0]).map(|(x, c)| (x - c).powi(2)).sum();
        (-square / 3.0).exp()
    };
    let (low, high) = ([-6.0; 3], [6.0; 3]);
    let settings_of =
        GridSettings { nodes: [13; 3], low, high, activation: Activation::Softplus, initial: -4.0 };
    let grid = Grid::new(settings_of).unwrap();
    let node = |k: usize| [k / 169, k / 13 % 13, k % 13].map(|k| k as f64 - 6.0);
    let shape = Shape { nodes: [13; 3], spacing: [1.0; 3] };
    let tv = Regulariser::TotalVariation { epsilon: 0.01 };
    let recover = |weight: f64| {
        let mut model = forward_model::<f32>(true, false);
        model.weigh(axis);
        let mut random = Pcg64::seed_from_u64(7);
        let clean = model.movie_of(axis, &blob, &mut Batch::default());
        let noisy = clean.iter().map(|x| (x + 0.6 * (random.random::<f64>() - 0.5)) as f32);
        let term = Box::new(ImageTerm::new(noisy.collect(), SIDE * SIDE, 0.17).unwrap());
        let data = Data { image: Some(Weighted { weight: 1.0, term }), others: Vec::new() };
        let priors = vec![Prior { regulariser: tv, weight }];
        let penalties = Penalties { priors, probe: Probe::Fixed { nodes: 13 }, region: region() };
        let training = Training {
            batch: BatchSize::All,
            rate: Polynomial { from: 0.2, to: 0.02, steps: 150, power: 1.0 },
            axis_rate: None,
            occupancy: None,
            penalties: (weight > 0.0).then_some(penalties),
            ..settings()
        };
        let mut state = State::new(&grid, axis, &training);
        let objective = Objective { model, data };
        let mut trainer = Trainer::new(objective, &grid, training);
        while state.now.step < 150 {
            trainer.step(&mut state).unwrap();
        }
        let values: Vec<f64> =
            state.now.parameters.iter().map(|x| f64::from(*x).exp().ln_1p()).collect();
        let variation = tv.value_and_gradient(&values, shape, 1.0, &mut vec![0.0; values.len()]);
        let inside = |k: &usize| region().holds(node(*k));
        let error = |k: usize| (values[k] - blob(node(k))).powi(2);
        (variation, (0..values.len()).filter(inside).map(error).sum::<f64>())
    };
    let (plain, smooth) = (recover(0.0), recover(0.01));
    assert!(smooth.0 < 0.6 * plain.0 && smooth.1 < 0.8 * plain.1, "{plain:?} {smooth:?}");
}
