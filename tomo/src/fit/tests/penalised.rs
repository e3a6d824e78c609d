//! Losses with a price of change: gradients of the whole.

use super::training::settings;
use super::*;
use crate::representation::{Allowed, Changing, Knots};

/// Central differences of the whole loss along parameters and, where the field is smooth and knows of it, the axis
/// together, at a step's draws.
fn check(trainer: &mut Trainer<'_, f64>, parameters: &[f64], step: u64, turned: bool) {
    let axis = Axis::new([0.3, -0.5, 0.8]).unwrap();
    let mut of_axis = [0.0; 3];
    let place = Place { parameters, axis, occupancy: None, step };
    let loss = trainer.loss(place, &mut of_axis);
    let slopes = trainer.gradient().to_vec();
    let data: f64 = loss.terms.iter().zip([0.7, 1.3, 0.4]).map(|(t, w)| t * w).sum();
    let more = loss.change.unwrap();
    assert!((loss.total - data - more).abs() < 1e-12 * loss.total && more > 0.0);
    let way: Vec<f64> = (0..slopes.len()).map(|k| (k as f64 * 0.7).cos()).collect();
    let turn = if turned { axis.tangent([0.2, 1.0, 0.3]) } else { [0.0; 3] };
    let difference = slope(1e-5, |h| {
        let axis = axis.moved(turn.map(|x| h * x));
        let parameters = &moved(parameters, &way, h);
        trainer.loss(Place { parameters, axis, occupancy: None, step }, &mut [0.0; 3]).total
    });
    let product = dot(&slopes, &way) + dot(&of_axis, &turn);
    assert!((difference - product).abs() < 1e-7 * product.abs(), "{difference} {product}");
}

/// Emission that changes while matter carries it has its price in the loss, with its gradient.
#[test]
fn exact_gradient_of_a_loss_with_change_by_differences() {
    let knots = Knots { first: -20.0, spacing: 15.0, count: 4, allowed: Allowed::Any };
    let steps = Changing::new(Box::new(grid()), knots, None).unwrap();
    let of_time: [(&dyn Representation<f64>, bool); 2] =
        [(&steps, true), (&Blobs::CHANGING, false)];
    for (representation, linear) in of_time {
        let change = ChangePrice { weight: 0.01, knots, linear, region: settings().region };
        let (batch, change) = (BatchSize::All, Some(change));
        let training = Training { batch, change, occupancy: None, ..settings() };
        let mut trainer = Trainer::new(objective(true, true, true), representation, training);
        check(&mut trainer, &start(representation), 5, !linear);
    }
}
