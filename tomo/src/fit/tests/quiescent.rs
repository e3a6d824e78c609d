//! Emission that does not move beside a field that is learnt.

use super::training::settings;
use super::*;
use crate::fit::linear::Prior;

fn image() -> Quiescent {
    let prior = |regulariser, weight| Prior { regulariser, weight };
    Quiescent {
        pixels: SIDE * SIDE,
        signed: vec![false],
        most: 1.5,
        upper: 4.0,
        jy_per_pixel: 0.7,
        priors: vec![prior(Regulariser::Smoothness, 0.3), prior(Regulariser::Sparsity, 0.1)],
        spacing: 1.5,
    }
}

fn beside() -> WithStaticImage<f64> {
    WithStaticImage::new(Box::new(grid()), &image())
}

fn trainer(representation: &dyn Representation<f64>) -> Trainer<'_, f64> {
    let training = Training { batch: BatchSize::All, occupancy: None, ..settings() };
    let mut objective = objective(true, true, true);
    objective.model = forward_model::<f64>(true, true).beside(image()).unwrap();
    Trainer::new(objective, representation, training)
}

fn lit() -> Vec<f64> {
    let representation = beside();
    let mut parameters = start(&representation);
    let own = representation.parameters() - SIDE * SIDE;
    parameters[own..]
        .iter_mut()
        .enumerate()
        .for_each(|(k, x)| *x = 0.1 + (k as f64 * 0.3).sin().abs());
    parameters
}

/// The whole loss along the field and the image.
#[test]
fn exact_gradient_beside_a_quiescent_image_by_differences() {
    let (representation, parameters) = (beside(), lit());
    let axis = Axis::new([0.3, -0.5, 0.8]).unwrap();
    let mut trainer = trainer(&representation);
    let mut of_axis = [0.0; 3];
    let place = Place { parameters: &parameters, axis, occupancy: None, step: 2 };
    trainer.loss(place, &mut of_axis);
    let slopes = trainer.gradient().to_vec();
    let own = parameters.len() - SIDE * SIDE;
    for range in [0..own, own..parameters.len()] {
        let way = |k: usize| if range.contains(&k) { (k as f64 * 0.7).cos() } else { 0.0 };
        let way: Vec<f64> = (0..parameters.len()).map(way).collect();
        let difference = slope(1e-5, |h| {
            let parameters = &moved(&parameters, &way, h);
            trainer.loss(Place { parameters, ..place }, &mut [0.0; 3]).total
        });
        let product = dot(&slopes, &way);
        assert!((difference / product - 1.0).abs() < 1e-6, "{difference} {product}");
    }
}

/// The image is in every frame, and the field's emission is what it is without.
#[test]
fn exact_the_image_is_added_to_every_frame() {
    let (representation, parameters) = (beside(), lit());
    let axis = Axis::new([0.3, -0.5, 0.8]).unwrap();
    let movie = |model: &ForwardModel<f64>, representation, parameters: &[f64]| {
        images(model, Field { representation, parameters, axis, occupancy: None })
    };
    let mut plain = forward_model::<f64>(true, true);
    plain.weigh(axis);
    let own = parameters.len() - SIDE * SIDE;
    let grid = grid();
    let without = movie(&plain, &grid, &parameters[..own]);
    let with = movie(&plain.clone().beside(image()).unwrap(), &representation, &parameters);
    for (k, (with, without)) in with.iter().zip(&without).enumerate() {
        let expected = without + parameters[own + k % (SIDE * SIDE)] * 4.0 / 1.5;
        assert!((with - expected).abs() < 1e-12 * expected, "{k}");
    }
}

/// Steps leave the image inside its box, from where it starts dark; a checkpoint goes on with the same bits.
#[test]
fn exact_steps_stay_inside_the_box() {
    let inner = Box::new(training::network());
    let image = || Quiescent { priors: Vec::new(), ..image() };
    let representation = WithStaticImage::<f32>::new(inner, &image());
    let training = Training { batch: BatchSize::Frames(2), occupancy: None, ..settings() };
    let axis = Axis::new([0.1, 0.5, 0.8]).unwrap();
    let mut state = State::new(&representation, axis, &training);
    let own = representation.parameters() - SIDE * SIDE;
    assert!(state.now.parameters[own..].iter().all(|x| *x == 0.0));
    let mut objective = training::objective();
    objective.model = forward_model::<f32>(true, true).beside(image()).unwrap();
    let mut trainer = Trainer::new(objective, &representation, training);
    for _ in 0..12 {
        trainer.step(&mut state).unwrap();
    }
    let image = &state.now.parameters[own..];
    assert!(image.iter().all(|x| (0.0..=1.5).contains(x)) && image.iter().any(|x| *x > 0.01));
    let mut resumed = checkpoint::decode(&checkpoint::encode(&state, "").unwrap(), &state).unwrap();
    trainer.step(&mut state).unwrap();
    trainer.step(&mut resumed).unwrap();
    assert_eq!(resumed, state);
}

/// Images of other sizes and numbers that mean nothing.
/// Where a fit diverges its numbers show it.
#[test]
fn exact_the_box_hides_no_nan() {
    let representation = beside();
    let own = representation.parameters() - SIDE * SIDE;
    let mut parameters = lit();
    parameters[own..own + 4].copy_from_slice(&[-0.1, f64::NAN, 2.0, 0.7]);
    representation.project(&mut parameters);
    let [low, nan, high, inside] = [0, 1, 2, 3].map(|k| parameters[own + k]);
    assert!(nan.is_nan());
    assert_eq!([low, high, inside], [0.0, 1.5, 0.7]);
}

#[test]
fn exact_images_that_do_not_fit_are_refused() {
    let refused =
        |image: Quiescent| forward_model::<f64>(true, true).beside(image).unwrap_err().to_string();
    assert!(refused(Quiescent { pixels: 80, ..image() }).contains("quiescent pixels = 80 "));
    assert!(refused(Quiescent { upper: 0.0, ..image() }).contains("quiescent upper = 0 "));
    let priors = vec![Prior { regulariser: Regulariser::Sparsity, weight: -1.0 }];
    assert!(refused(Quiescent { priors, ..image() }).contains("quiescent penalty = -1 "));
}
