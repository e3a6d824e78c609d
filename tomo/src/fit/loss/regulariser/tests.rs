//! Values of fields that are known, gradients by differences.

use super::*;
use crate::fit::tests::{dot, moved, slope};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;

const SHAPE: Shape = Shape { nodes: [5, 4, 6], spacing: [0.5, 0.25, 0.75] };
const ALL: [Regulariser; 3] =
    [Regulariser::TotalVariation { epsilon: 0.3 }, Regulariser::Smoothness, Regulariser::Sparsity];

fn random(seed: u64) -> Vec<f64> {
    let mut random = Pcg64::seed_from_u64(seed);
    (0..SHAPE.count()).map(|_| random.random::<f64>() + 0.05).collect()
}

#[test]
fn exact_gradients_are_central_differences() {
    let (values, along) = (random(1), random(2));
    for regulariser in ALL {
        let mut gradient = vec![0.0; values.len()];
        regulariser.value_and_gradient(&values, SHAPE, 1.7, &mut gradient);
        let difference = slope(1e-5, |h| {
            let moved = moved(&values, &along, h);
            regulariser.value_and_gradient(&moved, SHAPE, 1.7, &mut vec![0.0; moved.len()])
        });
        let slope = dot(&gradient, &along);
        let error = (slope - difference).abs() / slope.abs();
        assert!(error < 1e-7, "{regulariser:?}: {slope} {difference}");
    }
}

/// A field that rises by a along x has |∇e| = |a| but on the last plane.
#[test]
fn exact_values_of_a_ramp() {
    let a = 0.7;
    let ramp: Vec<f64> = (0..SHAPE.count()).map(|k| a * 0.5 * (k / 24) as f64 + 1.0).collect();
    let (weight, sloped) = (2.0, 4.0 * 24.0 * SHAPE.cell());
    let value = |regulariser: Regulariser| {
        regulariser.value_and_gradient(&ramp, SHAPE, weight, &mut vec![0.0; ramp.len()])
    };
    let tv = value(Regulariser::TotalVariation { epsilon: 0.3 });
    assert!((tv - weight * sloped * (a.hypot(0.3) - 0.3)).abs() < 1e-12);
    assert!((value(Regulariser::Smoothness) - weight * sloped * a * a).abs() < 1e-12);
    let sum: f64 = ramp.iter().sum();
    assert!((value(Regulariser::Sparsity) - weight * sum * SHAPE.cell()).abs() < 1e-10);
}

#[test]
fn exact_threads_change_no_bit() {
    let values: Vec<f32> = random(3).iter().map(|x| *x as f32).collect();
    let run = |threads, regulariser: Regulariser| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let mut gradient = vec![0.0f32; values.len()];
        let out = &mut gradient;
        let value = pool.install(|| regulariser.value_and_gradient(&values, SHAPE, 0.3, out));
        (value, gradient)
    };
    for regulariser in ALL {
        assert_eq!(run(1, regulariser), run(5, regulariser));
    }
}

#[test]
fn numbers_out_of_range_are_named() {
    let text = |r: Regulariser| r.checked().unwrap_err().to_string();
    assert!(text(Regulariser::TotalVariation { epsilon: 0.0 }).contains("epsilon = 0 "));
}
