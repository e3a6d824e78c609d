//! Quasi-Newton steps of a fit.

use super::training::settings;
use super::*;
use crate::optimise::Lbfgs;
use crate::representation::{Network, NetworkSettings};

fn training() -> Training {
    Training { batch: BatchSize::All, lbfgs: Some(Lbfgs::default()), ..settings() }
}

/// Data that a field makes with an axis are explained to the last digits, from elsewhere; the axis is found.
#[test]
fn exact_parameters_and_axis_are_found_again() {
    let blobs = Blobs::STEADY;
    let (known, axis) = (start(&blobs), Axis::new([0.3, -0.5, 0.8]).unwrap());
    let mut objective = objective(true, true, false);
    objective.model.weigh(axis);
    let mut movie = vec![0.0; 4 * SIDE * SIDE];
    let field = Field { representation: &blobs, parameters: &known, axis, occupancy: None };
    objective.movie(field, &[0, 1, 2, 3], &mut Buffers::default(), &mut movie);
    let term = Box::new(ImageTerm::new(movie, SIDE * SIDE, 0.1).unwrap());
    objective.data.image = Some(Weighted { weight: 1.0, term });
    let training = Training { occupancy: None, ..training() };
    let mut state = State::new(&blobs, axis.moved([0.1, 0.05, 0.0]), &training);
    let off = |(k, x): (usize, &f64)| x + 0.05 * (k as f64 * 2.3).sin();
    state.now.parameters = known.iter().enumerate().map(off).collect();
    let mut trainer = Trainer::new(objective, &blobs, training);
    let mut last = f64::INFINITY;
    while state.now.step < 300 {
        match trainer.step(&mut state).unwrap() {
            Outcome::Done(loss) => {
                assert!(loss.total < last && loss.total == state.now.loss);
                last = loss.total;
            }
            other => {
                assert_eq!(other, Outcome::Converged);
                break;
            }
        }
    }
    assert!(last < 1e-12, "{last:e} after {} steps", state.now.step);
    assert!(1.0 - state.now.axis.dot(axis) < 1e-12);
}

/// Also across refreshments of the mask, which make the loss another one.
#[test]
fn regress_resumed_from_a_checkpoint_the_same_bits() {
    let settings =
        NetworkSettings { width: 16, shift: -1.0, length_scale: 6.0, ..NetworkSettings::bhnerf() };
    let network = Network::new(settings).unwrap();
    let training = training();
    let objective = || {
        let movie = movie().iter().map(|x| *x as f32).collect();
        let term = Box::new(ImageTerm::new(movie, SIDE * SIDE, 0.5).unwrap());
        let data = Data { image: Some(Weighted { weight: 1.0, term }), others: Vec::new() };
        Objective { model: forward_model(true, true), data }
    };
    let start = || State::new(&network, Axis::new([0.1, 0.5, 0.8]).unwrap(), &training);
    let run = |state: &mut State<f32>, until: u64| {
        let mut trainer = Trainer::new(objective(), &network, training.clone());
        let mut first = f64::NAN;
        while state.now.step < until {
            let Outcome::Done(loss) = trainer.step(state).unwrap() else { panic!("converged") };
            if first.is_nan() {
                first = loss.total;
            }
        }
        first
    };
    let (mut whole, mut broken) = (start(), start());
    let first = run(&mut whole, 30);
    assert!(whole.now.loss < 0.95 * first, "{first} {}", whole.now.loss);
    let pool = rayon::ThreadPoolBuilder::new().num_threads(3).build().unwrap();
    for until in [11, 17, 30] {
        pool.install(|| run(&mut broken, until));
        let bytes = checkpoint::encode(&broken, "").unwrap();
        broken = checkpoint::decode(&bytes, &start()).unwrap();
    }
    let bytes = |state: &State<f32>| checkpoint::encode(state, "").unwrap();
    assert!(broken == whole && bytes(&broken) == bytes(&whole));
}
