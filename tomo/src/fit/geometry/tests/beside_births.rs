//! The view of matter whose emission appears while it is seen.

use super::*;
use crate::representation::{Allowed, Knots};

/// Two spots, one of which begins to shine half-way: the inclination is found where births are allowed. Without them no view
/// explains the images.
#[test]
fn exact_inclination_is_found_beside_births() {
    let (mut model, side) = (screen(16, 12), 16);
    model.slow_light = false;
    let truth = Geometry::new(0.3, 0.9);
    let forward: ForwardModel<f32> = model.forward(&truth).unwrap();
    let opposite = |[x, y, z]: [f64; 3]| spot([-x, y, z]);
    let movies = [&spot as &(dyn Fn([f64; 3]) -> f64 + Sync), &opposite]
        .map(|of| forward.movie_of(model.axis, of, &mut Batch::default()));
    let shines = |k: usize| if k / (side * side) < 6 { 0.0 } else { 1.0 };
    let pairs = movies[0].iter().zip(&movies[1]).enumerate();
    let movie: Vec<f32> = pairs.map(|(k, (a, b))| (a + shines(k) * b) as f32).collect();
    let sigma = 0.02 * f64::from(movie.iter().fold(0.0f32, |most, x| most.max(*x)));
    let count = movie.len() as f64;
    let term = ImageTerm::new(movie, side * side, sigma).unwrap();
    let terms = [Weighted { weight: count, term: &term as &dyn FrameTerm<f32> }];
    let free = [ANY_INCLINATION];
    let knots = Knots { first: 0.0, spacing: 10.0, count: 12, allowed: Allowed::Births };
    let within = Some(model.region);
    let change = Change { knots, weight: 0.01 * count, within, sharpen: None };
    let effort = Effort { nodes: 14, degree: Degree::Linear, patience: StopRule::looking(60) };
    let steady = GeometryProblem { known: truth, effort, ..of_hot_spot(&model, &free, &terms) };
    let best = |problem: &GeometryProblem<'_, f32>| {
        let trials = [0.5, 0.7, 0.9, 1.1, 1.3].map(|i| truth.with(Parameter::Inclination, i));
        let all = trials.map(|geometry| problem.solve(geometry).unwrap());
        all.into_iter().min_by(|a, b| a.value.total_cmp(&b.value)).unwrap()
    };
    let (born, carried) = (best(&GeometryProblem { change, ..steady }), best(&steady));
    assert!((born.geometry.get(Parameter::Inclination) - 0.9).abs() < 1e-9, "{:?}", born.geometry);
    assert!(2.0 * born.value < carried.value, "{} {}", born.value, carried.value);
    // What births cost is no part of the residuals, which are those of images of the volume.
    let problem = GeometryProblem { change, ..steady };
    let best = problem.solve(truth).unwrap();
    let x: Vec<f32> = best.x.iter().map(|x| *x as f32).collect();
    let linear = problem.linear(&forward);
    let images: f64 = linear.misfit(&x).unwrap() / count;
    let left = problem.left(&best).unwrap();
    assert!((left - images).abs() < 1e-6 * images, "{left} {images}");
    let cell = linear.voxels.shape().cell();
    let cost = linear.change.penalty(&best.x, cell, 1.0, &[], &mut vec![0.0; x.len()]);
    let whole = problem.reduced(best.chi2);
    assert!((whole - left - cost / count).abs() < 1e-3 * whole && cost > 0.01 * best.chi2);
}
