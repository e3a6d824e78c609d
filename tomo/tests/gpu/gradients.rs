//! Losses and gradients.

use super::device;
use super::problem::{self, Kind, axis, objective, start, training};
use kerrlight_render::dynamics::Axis;
use kerrlight_tomo::fit::graphics::GraphicsFit;
use kerrlight_tomo::fit::{
    BatchSize, Buffers, Drawn, Field, Gradients, Loss, Objective, Occupancy, Progress, StepDevice,
    Stretch, Training,
};
use kerrlight_tomo::representation::{Activation, Representation, Workspace};

/// A device with a fit, and what it is a fit of.
struct Both<'a> {
    graphics: GraphicsFit,
    objective: Objective<f32>,
    representation: &'a dyn Representation<f32>,
    training: Training,
    occupancy: Option<Occupancy>,
    draw: Drawn,
}

impl<'a> Both<'a> {
    fn new(
        representation: &'a dyn Representation<f32>,
        kind: Kind,
        draw: Drawn,
        masked: bool,
        most: Option<usize>,
        learns_axis: bool,
    ) -> Option<Self> {
        let batch = match &draw {
            Drawn::Pixels(pairs) => BatchSize::Pixels(pairs.len()),
            Drawn::Frames(frames) => BatchSize::Frames(frames.len()),
        };
        let mut training = training(batch, masked);
        training.axis_rate = learns_axis.then_some(training.rate);
        let mut objective = objective(kind);
        objective.model.weigh(axis());
        let (device, now) = (device()?, start(representation, &training).now);
        let graphics =
            GraphicsFit::new(device, &objective, representation, &training, most).unwrap();
        assert!(graphics.makes_residuals() == (kind != Kind::ImagesAndFlux));
        let mut occupancy = now.occupancy.clone();
        if let Some(mask) = &mut occupancy {
            mask.refresh(representation, &now.parameters, 3, &[], &mut Workspace::new());
            assert!(mask.fraction() > 0.05 && mask.fraction() < 0.95, "{}", mask.fraction());
        }
        Some(Self { graphics, objective, representation, training, occupancy, draw })
    }

    fn now(&self) -> Progress<f32> {
        start(self.representation, &self.training).now
    }

    fn processor(&self, parameters: &[f32]) -> (Loss, Vec<f32>, [f64; 3]) {
        let occupancy = self.occupancy.as_ref();
        let representation = self.representation;
        let field = Field { representation, parameters, axis: axis(), occupancy };
        let mut gradient = vec![0.0; parameters.len()];
        let mut of_axis = [0.0; 3];
        let learns = self.training.learns_axis(representation);
        let gradients =
            Gradients { parameters: &mut gradient, axis: learns.then_some(&mut of_axis) };
        let buffers = &mut Buffers::default();
        let loss = self.objective.value_and_gradient(field, &self.draw, gradients, buffers);
        (loss, gradient, of_axis)
    }

    fn device(&mut self, parameters: &[f32]) -> (Loss, Vec<f32>, [f64; 3]) {
        self.device_about(axis(), parameters)
    }

    fn device_about(&mut self, axis: Axis, parameters: &[f32]) -> (Loss, Vec<f32>, [f64; 3]) {
        self.objective.model.weigh(axis);
        let now = Progress { parameters: parameters.to_vec(), ..self.now() };
        let stretch = Stretch {
            objective: &self.objective,
            axis,
            occupancy: self.occupancy.as_ref(),
            draws: vec![self.draw.clone()],
            rates: vec![0.0],
        };
        self.graphics.gradient(&stretch, &now).unwrap()
    }
}

fn pixels(count: u32) -> Drawn {
    let rays = problem::model().rays() as u32;
    Drawn::Pixels((0..count).map(|k| ((k * 7) % rays, k % 4)).collect())
}

/// Loss, its terms and points, and the gradient relative to its largest number.
fn agree(name: &str, both: &mut Both<'_>) {
    let parameters = both.now().parameters;
    let (loss, gradient, of_axis) = both.processor(&parameters);
    let (ours, found, turned) = both.device(&parameters);
    let apart = (ours.total / loss.total - 1.0).abs();
    let largest = gradient.iter().fold(0.0f32, |most, g| most.max(g.abs()));
    let pairs = gradient.iter().zip(&found);
    let error = pairs.map(|(a, b)| (a - b).abs()).fold(0.0f32, f32::max) / largest;
    println!(
        "{name}: {} parameters, {} points; loss differs by {apart:.1e}, gradient by {error:.1e}",
        gradient.len(),
        loss.points
    );
    assert_eq!(ours.points, loss.points, "{name}");
    assert_eq!(ours.terms.len(), loss.terms.len());
    assert!(loss.points > 20 && largest > 0.0, "{name}");
    assert!(apart < 2e-6, "{name}: {} {}", ours.total, loss.total);
    assert!(error < 5e-6, "{name}: {error:e}");
    let length = |v: [f64; 3]| v.iter().map(|x| x * x).sum::<f64>().sqrt();
    let off = length([0, 1, 2].map(|k| of_axis[k] - turned[k])) / length(of_axis).max(1e-30);
    if both.training.learns_axis(both.representation) {
        println!("{name}: slope along the axis differs by {off:.1e}");
        assert!(length(of_axis) > 0.0);
    }
    assert!(off < 2e-5, "{name}: {of_axis:?} {turned:?}");
    let again = both.device(&parameters);
    assert!(again == (ours, found, turned), "{name}: other bytes the second time");
}

#[test]
fn code_all_fields_have_the_gradients_of_the_processor() {
    let (small, late) = (problem::small(), problem::late());
    let (bhnerf, mlp4d) = (problem::bhnerf(), problem::mlp4d());
    let [sigmoid, linear] = [Activation::Sigmoid, Activation::Linear].map(problem::voxels);
    let features = problem::features();
    let frames = || Drawn::Frames(vec![2, 0, 3]);
    let cases: [(&str, &dyn Representation<f32>, _, _); 20] = [
        ("bhnerf, pixels", &bhnerf, (Kind::Images, pixels(20)), (false, None)),
        ("small, pixels", &small, (Kind::Images, pixels(90)), (false, None)),
        ("late, pixels", &late, (Kind::Images, pixels(90)), (false, None)),
        ("small, masked", &small, (Kind::Images, pixels(90)), (true, None)),
        ("small, frames in blocks", &small, (Kind::Images, frames()), (false, Some(128))),
        ("small, frames and fluxes", &small, (Kind::ImagesAndFlux, frames()), (true, Some(128))),
        ("small, visibilities", &small, (Kind::Visibilities, frames()), (true, None)),
        ("small, closures", &small, (Kind::Closures, frames()), (false, Some(128))),
        ("mlp4d, closures", &mlp4d, (Kind::Closures, frames()), (false, None)),
        ("mlp4d, frames", &mlp4d, (Kind::Images, frames()), (false, None)),
        ("small, falling", &small, (Kind::Falling, frames()), (false, None)),
        ("small, falling, masked", &small, (Kind::Falling, pixels(90)), (true, None)),
        ("small, plunging", &small, (Kind::Plunging, frames()), (false, None)),
        ("mlp4d, falling", &mlp4d, (Kind::Falling, frames()), (false, None)),
        ("grid, pixels", &sigmoid, (Kind::Images, pixels(90)), (false, None)),
        ("linear grid, frames", &linear, (Kind::Images, frames()), (false, None)),
        ("feature grid, pixels", &features, (Kind::Images, pixels(90)), (false, None)),
        ("feature grid, blocks", &features, (Kind::Images, frames()), (false, Some(128))),
        ("feature grid, visibilities", &features, (Kind::Visibilities, frames()), (false, None)),
        ("feature grid, fluxes", &features, (Kind::ImagesAndFlux, frames()), (false, Some(128))),
    ];
    for (name, representation, (kind, draw), (masked, most)) in cases {
        for learns_axis in [false, true] {
            let both = Both::new(representation, kind, draw.clone(), masked, most, learns_axis);
            let Some(mut both) = both else { return };
            agree(name, &mut both);
        }
    }
}

/// Phases and logarithms of a dark image mean nothing: closure quantities leave its gradient to the images.
#[test]
fn code_a_dark_field_has_the_gradient_of_the_processor() {
    let (dark, draw) = (problem::dark(), Drawn::Frames(vec![2, 0, 3]));
    let both = Both::new(&dark, Kind::Closures, draw, false, None, false);
    if let Some(mut both) = both {
        agree("dark grid, closures", &mut both);
    }
}

/// ⟨gradient, v⟩ is the slope of the loss along v, both on the device.
#[test]
fn exact_gradients_are_slopes_of_the_loss() {
    let (small, voxels) = (problem::small(), problem::voxels(Activation::Sigmoid));
    // Rectified units have kinks, so that steps are short; voxels have none.
    let cases: [(&str, &dyn Representation<f32>, _, f32); 5] = [
        ("images", &small, Kind::Images, 5e-4),
        ("visibilities", &small, Kind::Visibilities, 5e-4),
        ("closures", &small, Kind::Closures, 5e-4),
        ("images, fluxes", &small, Kind::ImagesAndFlux, 5e-4),
        ("grid", &voxels, Kind::Images, 2e-2),
    ];
    for (name, representation, kind, step) in cases {
        let draw = Drawn::Frames(vec![1, 3]);
        let Some(mut both) = Both::new(representation, kind, draw, false, None, true) else {
            return;
        };
        let parameters = both.now().parameters;
        let (_, gradient, of_axis) = both.device(&parameters);
        let along: Vec<f32> =
            (0..parameters.len()).map(|k| (k as f32 * 1.7).sin() * parameters[k].abs()).collect();
        let product: f64 =
            gradient.iter().zip(&along).map(|(g, v)| f64::from(*g) * f64::from(*v)).sum();
        let mut loss = |step: f32| {
            let moved: Vec<f32> =
                parameters.iter().zip(&along).map(|(x, v)| x + step * v).collect();
            both.device(&moved).0.total
        };
        let slope = (loss(step) - loss(-step)) / f64::from(2.0 * step);
        println!("{name}: slope {slope:.6}, product {product:.6}");
        assert!((slope / product - 1.0).abs() < 2e-3, "{name}: {slope} {product}");
        // Along the sphere of axes.
        let across = axis().tangent([0.7, -0.4, 0.9]);
        let product: f64 = of_axis.iter().zip(across).map(|(g, v)| g * v).sum();
        let mut loss = |step: f64| {
            let [x, y, z] = axis().vector();
            let [u, v, w] = across.map(|c| step * c);
            both.device_about(Axis::new([x + u, y + v, z + w]).unwrap(), &parameters).0.total
        };
        let slope = (loss(2e-3) - loss(-2e-3)) / 4e-3;
        println!("{name}: slope of the axis {slope:.6}, product {product:.6}");
        assert!((slope / product - 1.0).abs() < 2e-2, "{name}: {slope} {product}");
    }
}
