//! Fits of a few steps.

use super::device;
use super::problem::{self, Kind, objective, start, training};
use kerrlight_tomo::Error;
use kerrlight_tomo::fit::graphics::GraphicsFit;
use kerrlight_tomo::fit::{
    BatchSize, ChangePrice, DeviceRunner, Outcome, State, StepDevice, Stretch, Taken, Trainer,
    Training, checkpoint,
};
use kerrlight_tomo::optimise::{LinearDecay, Muon};
use kerrlight_tomo::representation::{Activation, Allowed, Knots, Representation};

/// A fit with its data, on the device or not.
struct Fit<'a> {
    representation: &'a dyn Representation<f32>,
    training: Training,
    kind: Kind,
}

impl Fit<'_> {
    fn start(&self) -> State<f32> {
        start(self.representation, &self.training)
    }

    /// Steps up to `until`, by the device with pauses at multiples of a number, or by the processor.
    fn run(&self, state: &mut State<f32>, until: u64, pause: Option<u64>) -> Option<Vec<f64>> {
        let mut trainer =
            Trainer::new(objective(self.kind), self.representation, self.training.clone());
        if let Some(pause) = pause {
            let fit = self.graphics()?;
            trainer.device = Some(DeviceRunner::new(Box::new(fit), pause, until));
        }
        let mut losses = Vec::new();
        while state.now.step < until {
            match trainer.step(state).unwrap() {
                Outcome::Done(loss) => losses.push(loss.total),
                other => panic!("{other:?}"),
            }
        }
        Some(losses)
    }

    /// Returns the largest change of parameters by rounding in 20 steps. Gradients of few pairs have few singular values that
    /// are more than rounding, and Muon multiplies the others by up to 3.4⁵ = 480.
    fn rounding(&self) -> f64 {
        if self.training.muon.is_some() { 480.0 * 1e-5 } else { 1e-5 }
    }

    /// Steps that are compared. Closures multiply whatever differs by ten each step from the fourth on, so that rounding of 2e-7
    /// is a thousandth after 20 (measured on an NVIDIA H200): such fits end elsewhere and as well.
    fn steps(&self) -> u64 {
        if self.kind == Kind::Closures { 4 } else { 20 }
    }

    fn graphics(&self) -> Option<GraphicsFit> {
        let objective = objective(self.kind);
        let fit =
            GraphicsFit::new(device()?, &objective, self.representation, &self.training, None);
        Some(fit.unwrap())
    }
}

fn fits(representation: &dyn Representation<f32>) -> [Fit<'_>; 8] {
    let fit = |batch, masked, kind| Fit { representation, training: training(batch, masked), kind };
    let pairs = || fit(BatchSize::Pixels(30), true, Kind::Images);
    let turning = |batch, kind| {
        let training = training(batch, true);
        let axis_rate = Some(training.rate);
        Fit { representation, training: Training { axis_rate, ..training }, kind }
    };
    [
        pairs(),
        fit(BatchSize::Frames(2), false, Kind::Images),
        fit(BatchSize::All, true, Kind::ImagesAndFlux),
        fit(BatchSize::Frames(3), false, Kind::Visibilities),
        fit(BatchSize::All, true, Kind::Closures),
        Fit { training: Training { muon: Some(Muon::default()), ..pairs().training }, ..pairs() },
        turning(BatchSize::Pixels(60), Kind::Falling),
        turning(BatchSize::Frames(2), Kind::ImagesAndFlux),
    ]
}

fn apart(a: &[f32], b: &[f32]) -> f64 {
    let pairs = || a.iter().zip(b).map(|(a, b)| (f64::from(*a), f64::from(*b)));
    let differences: f64 = pairs().map(|(a, b)| (a - b).powi(2)).sum();
    (differences / pairs().map(|(a, _)| a * a).sum::<f64>()).sqrt()
}

/// All kinds of batches with a network, and one with each of the others.
fn all_fits<'a>(
    network: &'a dyn Representation<f32>,
    others: [&'a dyn Representation<f32>; 3],
) -> Vec<Fit<'a>> {
    let other = |representation| Fit {
        representation,
        training: training(BatchSize::Pixels(60), false),
        kind: Kind::Images,
    };
    fits(network).into_iter().chain(others.map(other)).collect()
}

#[test]
fn code_twenty_steps_are_those_of_the_processor() {
    let (small, features) = (problem::small(), problem::features());
    let [sigmoid, linear] = [Activation::Sigmoid, Activation::Linear].map(problem::voxels);
    for fit in all_fits(&small, [&sigmoid, &linear, &features]) {
        let (mut state, mut ours) = (fit.start(), fit.start());
        let steps = fit.steps();
        let losses = fit.run(&mut state, steps, None).unwrap();
        let Some(found) = fit.run(&mut ours, steps, Some(1)) else { return };
        let pairs = losses.iter().zip(&found).map(|(a, b)| (b / a - 1.0).abs());
        let by_step: Vec<String> = pairs.clone().map(|apart| format!("{apart:.0e}")).collect();
        println!("losses of each step differ by {}", by_step.join(" "));
        assert!(pairs.clone().all(f64::is_finite) && found.len() == losses.len(), "{found:?}");
        let most = pairs.fold(0.0, f64::max);
        let moved = apart(&state.now.parameters, &ours.now.parameters);
        let batch = fit.training.batch;
        let [axis, our_axis] = [&state, &ours].map(|state| state.now.axis.vector());
        let turned = (0..3).map(|k| (axis[k] - our_axis[k]).powi(2)).sum::<f64>().sqrt();
        println!(
            "{batch:?}: losses differ by {most:.1e}, parameters by {moved:.1e}, axes by {turned:.1e}"
        );
        let learns = fit.training.axis_rate.is_some();
        assert!((fit.start().now.axis != state.now.axis) == learns);
        assert!(turned < 1e-5, "{batch:?}: {turned:e}");
        assert!([losses.len(), found.len()] == [steps as usize; 2]);
        let last = losses[losses.len() - 1];
        assert!(last < 0.9 * losses[0] || matches!(batch, BatchSize::Pixels(_)) || steps < 20);
        let allowed = fit.rounding();
        assert!(most < allowed && moved < allowed, "{batch:?}: {most:e} {moved:e}");
        let good = ours.good.as_ref().map(|good| good.step);
        assert!(
            state.good.as_ref().map(|good| good.step) == good && (good == Some(16) || steps < 20)
        );
    }
}

/// The first step by Muon is that of the processor, for a gradient with as many singular values as a matrix has.
#[test]
fn code_a_step_by_muon_is_that_of_the_processor() {
    let bhnerf = problem::bhnerf();
    let mut training = training(BatchSize::All, false);
    (training.muon, training.ramp) = (Some(Muon::default()), 0);
    let fit = Fit { representation: &bhnerf, training, kind: Kind::Images };
    let before = fit.start().now.parameters;
    let step = |pause| {
        let mut state = fit.start();
        fit.run(&mut state, 1, pause)?;
        let moved = state.now.parameters.iter().zip(&before).map(|(after, before)| after - before);
        Some((moved.collect::<Vec<f32>>(), state.now.adam))
    };
    let Some((ours, adam)) = step(Some(1)) else { return };
    let (theirs, of_processor) = step(None).unwrap();
    let matrices = Representation::<f32>::matrices(&bhnerf);
    assert!(matrices.len() == 4 && matrices.iter().any(|matrix| matrix.rows > matrix.columns));
    for matrix in matrices {
        let of = matrix.range();
        let apart = apart(&theirs[of.clone()], &ours[of.clone()]);
        println!("{} x {}: steps differ by {apart:.1e}", matrix.rows, matrix.columns);
        assert!(apart < 2e-4, "{apart:e}");
        assert!(adam.second[of].iter().all(|x| *x == 0.0));
    }
    assert!(apart(&of_processor.first, &adam.first) < 1e-5);
    assert!(apart(&of_processor.second, &adam.second) < 1e-5);
}

/// Neither another time nor the lengths of stretches change a byte.
#[test]
fn exact_the_same_bytes_twice() {
    let (small, features) = (problem::small(), problem::features());
    let [sigmoid, linear] = [Activation::Sigmoid, Activation::Linear].map(problem::voxels);
    for fit in all_fits(&small, [&sigmoid, &linear, &features]) {
        let bytes = |pause| {
            let mut state = fit.start();
            fit.run(&mut state, 20, Some(pause))?;
            Some(checkpoint::encode(&state, "").unwrap())
        };
        let Some(first) = bytes(1) else { return };
        assert!(Some(&first) == bytes(1).as_ref() && Some(first) == bytes(20));
    }
}

#[test]
fn exact_checkpoints_go_from_device_to_processor_and_back() {
    let small = problem::small();
    for fit in fits(&small) {
        let moved = |pauses: [Option<u64>; 3]| {
            let mut state = fit.start();
            let part = |percent: u64| fit.steps() * percent / 100;
            for (pause, until) in pauses.into_iter().zip([35, 65, 100].map(part)) {
                let bytes = checkpoint::encode(&state, "").unwrap();
                state = checkpoint::decode(&bytes, &fit.start()).unwrap();
                fit.run(&mut state, until, pause)?;
            }
            Some(state)
        };
        let Some(there_and_back) = moved([Some(5), None, Some(5)]) else { return };
        let alone = moved([None; 3]).unwrap();
        let apart = apart(&alone.now.parameters, &there_and_back.now.parameters);
        println!("{:?}: parameters differ by {apart:.1e}", fit.training.batch);
        assert!(apart > 0.0 && apart < fit.rounding(), "{apart:e}");
        let mut whole = fit.start();
        fit.run(&mut whole, fit.steps(), Some(5));
        assert!(moved([Some(5); 3]).unwrap() == whole, "a break changes bytes");
    }
}

/// A device that is lost after a few steps.
struct Fragile {
    fit: GraphicsFit,
    left: usize,
}

impl StepDevice for Fragile {
    fn name(&self) -> &str {
        self.fit.name()
    }
    fn makes_residuals(&self) -> bool {
        self.fit.makes_residuals()
    }
    fn most(&self) -> usize {
        1
    }
    fn take(
        &mut self,
        stretch: &Stretch<'_>,
        from: &kerrlight_tomo::fit::Progress<f32>,
    ) -> Result<Taken, Error> {
        if self.left == 0 {
            self.fit.device().lose();
        }
        self.left = self.left.saturating_sub(1);
        self.fit.take(stretch, from)
    }
}

#[test]
fn exact_after_a_lost_device_the_processor_goes_on() {
    let small = problem::small();
    let [fit, ..] = fits(&small);
    let Some(graphics) = fit.graphics() else { return };
    let mut state = fit.start();
    let mut trainer = Trainer::new(objective(fit.kind), &small, fit.training.clone());
    let fragile = Fragile { fit: graphics, left: 5 };
    trainer.device = Some(DeviceRunner::new(Box::new(fragile), 1, 20));
    for _ in 0..5 {
        trainer.step(&mut state).unwrap();
    }
    let before = state.clone();
    let error = trainer.step(&mut state).unwrap_err();
    assert!(matches!(error, Error::Device(_)), "{error}");
    assert!(error.to_string().contains("lost"), "{error}");
    assert!(state == before && state.now.step == 5);
    fit.run(&mut state, 20, None).unwrap();
    let mut alone = fit.start();
    fit.run(&mut alone, 20, None).unwrap();
    assert!(apart(&alone.now.parameters, &state.now.parameters) < 1e-5);
}

#[test]
fn exact_a_divergence_is_stepped_back_from() {
    let small = problem::small();
    let absurd = LinearDecay { from: 1e30, to: 1e30, steps: 40 };
    let training = Training { rate: absurd, ramp: 0, ..training(BatchSize::Pixels(30), false) };
    let fit = Fit { representation: &small, training, kind: Kind::Images };
    let Some(graphics) = fit.graphics() else { return };
    let mut trainer = Trainer::new(objective(fit.kind), &small, fit.training.clone());
    trainer.device = Some(DeviceRunner::new(Box::new(graphics), 20, 20));
    let mut state = fit.start();
    let error = loop {
        match trainer.step(&mut state) {
            Ok(Outcome::SteppedBack { to, caution, .. }) => {
                assert!(caution == 0.5f64.powi(state.setbacks as i32) && to == state.now.step);
            }
            Ok(other) => assert!(matches!(other, Outcome::Done(_)), "{other:?}"),
            Err(error) => break error,
        }
        assert!(state.now.step < 20);
    };
    assert!(matches!(error, Error::Diverged(fail) if fail.setbacks == 12), "{error}");
}

#[test]
fn what_is_not_done_is_named_with_its_key() {
    let small = problem::small();
    let settings = training(BatchSize::All, false);
    let (region, allowed) = (settings.region, Allowed::Any);
    let knots = Knots { first: 0.0, spacing: 1.0, count: 2, allowed };
    let change = ChangePrice { weight: 0.1, knots, linear: true, region };
    let training = Training { change: Some(change), ..settings };
    let Some(device) = device() else { return };
    let objective = objective(Kind::Images);
    let refused = GraphicsFit::new(device, &objective, &small, &training, None);
    let told = refused.unwrap_err().to_string();
    assert!(told.starts_with("change:"), "{told}");
    assert!(told.contains("the processor does it"), "{told}");
}
