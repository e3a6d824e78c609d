//! A Gaussian prior of the voxels in the search for a geometry.

use super::*;
use crate::fit::linear::{GaussianField, Matern, Roughness, Voxels};

/// The objective for a geometry is χ² and the square of the prior's white noise, from images and prior alone, and half of it
/// is the geometry's value.
#[test]
fn exact_a_prior_of_voxels_is_part_of_the_value() {
    let (model, side) = (screen(20, 12), 20);
    let truth = Geometry::new(0.6, 1.05);
    let forward: ForwardModel<f32> = model.forward(&truth).unwrap();
    let movie = forward.movie_of(model.axis, &spot, &mut Batch::default());
    let sigma = 2e-2 * movie.iter().fold(0.0f64, |most, x| most.max(*x));
    let data: Vec<f32> = movie.iter().map(|x| *x as f32).collect();
    let term = ImageTerm::new(data, side * side, sigma).unwrap();
    let terms = [Weighted { weight: 1.0, term: &term as &dyn FrameTerm<f32> }];
    let free = [ANY_INCLINATION];
    let plain = of_hot_spot(&model, &free, &terms);
    let voxels = Voxels::cube(plain.effort.nodes, plain.half_width, plain.effort.degree);
    let roughness = Roughness::FiveHalves;
    let law = Matern { mean: 0.1, amplitude: 0.2, correlation_length: 2.0, roughness };
    let field = GaussianField::new(law, &voxels).unwrap();
    let problem = GeometryProblem { known: truth, gaussian: Some(&field), ..plain };
    let found = problem.solve(truth).unwrap();
    let parameters: Vec<f32> = found.x.iter().map(|x| *x as f32).collect();
    let splines = voxels.field().unwrap();
    let at = |x: [f64; 3]| {
        let factors: Vec<f64> = parameters.iter().map(|x| f64::from(*x)).collect();
        splines.at(&factors, x)
    };
    let seen = forward.movie_of(model.axis, &at, &mut Batch::default());
    let chi2: f64 = seen.iter().zip(&movie).map(|(a, b)| ((a - b) / sigma).powi(2)).sum();
    let of_prior = field.value_and_gradient(&found.x, 1.0, &mut vec![0.0; found.x.len()]);
    assert!(of_prior > 1.0 && chi2 > 1.0, "{of_prior} {chi2}");
    assert!((found.chi2 / (chi2 + of_prior) - 1.0).abs() < 1e-3, "{} {chi2}", found.chi2);
    let penalty = free[0].penalty(1.05);
    assert!((found.value - 0.5 * found.chi2 - penalty).abs() < 1e-9 * found.value);
    let count = 12.0 * (side * side) as f64;
    assert!((problem.reduced(found.chi2) / (found.chi2 / count) - 1.0).abs() < 1e-12);
}
