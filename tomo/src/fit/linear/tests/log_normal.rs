//! A log-normal prior: derivatives, its minimum, and that its draws are where the prior says.

use super::super::log_normal::Posterior;
use super::super::objective::Objective;
use super::super::operator::Operator;
use super::*;

const NODES: usize = 6;

fn voxels() -> Voxels {
    Voxels::cube(NODES, 5.0, Degree::Cubic)
}

fn prior(roughness: Roughness) -> LogNormalField {
    let law = Matern { mean: -1.0, amplitude: 0.8, correlation_length: 4.0, roughness };
    LogNormalField::new(law, &voxels()).unwrap()
}

/// Hands the problem of data with a noise of `sigma` to a function.
fn with<R>(sigma: f64, truth: &[f64], f: impl FnOnce(&LinearProblem<'_, f64>) -> R) -> R {
    let model = forward_model();
    let clean = movie(&model, &voxels(), truth);
    let data = moved(&clean, &normal(clean.len(), 4), sigma);
    let term = ImageTerm::new(data, model.pixels(), sigma).unwrap();
    f(&of_images(&model, &[Weighted { weight: 1.0, term: &term }], voxels()))
}

fn most_probable(problem: &LinearProblem<'_, f64>, prior: &LogNormalField) -> LinearSolution<f64> {
    let settings =
        LinearSettings { iterations: 3000, tolerance: 1e-9, ..LinearSettings::default() };
    problem.solve_log_normal(prior, &settings, &mut |_| ControlFlow::Continue(())).unwrap()
}

/// Hands the function that is minimised to another one.
fn posterior<R>(
    problem: &LinearProblem<'_, f64>,
    prior: &LogNormalField,
    f: impl FnOnce(&mut Posterior<'_, '_, f64>) -> R,
) -> R {
    let data = problem.data().unwrap().together(problem.frames);
    let operator = Operator::new(problem.walk(), problem.all(), problem.frames, usize::MAX);
    let objective = Objective::new(&operator, &data, problem.penalised(&data));
    f(&mut Posterior { objective, prior, upper: problem.upper })
}

#[test]
fn exact_slopes_of_the_logarithm_are_differences() {
    for roughness in [Roughness::Half, Roughness::FiveHalves] {
        let prior = prior(roughness).about(8);
        with(0.3, &prior.drawn(3), |problem| {
            posterior(problem, &prior, |posterior| {
                let count = prior.count();
                let (white, along) = (normal(count, 1), normal(count, 2));
                let mut slopes = vec![0.0; count];
                posterior.value_and_gradient(&white, &mut slopes);
                let difference = slope(1e-5, |h| {
                    posterior.value_and_gradient(&moved(&white, &along, h), &mut vec![0.0; count])
                });
                let slope = dot(&slopes, &along);
                assert!((slope / difference - 1.0).abs() < 1e-6, "{slope} {difference}");
            });
        });
    }
}

/// ⟨y, S z⟩ = ⟨Sᵀ y, z⟩ of the map from white numbers to the field and the one of slopes back.
#[test]
fn exact_white_numbers_and_slopes_are_transposed() {
    let law =
        Matern { mean: 0.0, amplitude: 0.8, correlation_length: 3.0, roughness: Roughness::Half };
    let voxels = Voxels { nodes: [6, 5, 7], ..voxels() };
    let field = GaussianField::at_nodes(law, &voxels).unwrap();
    let (z, y) = (normal(210, 1), normal(210, 2));
    let (there, back) = (dot(&y, &field.of_white(&z)), dot(&field.to_white(&y), &z));
    assert!((there / back - 1.0).abs() < 1e-10, "{there} {back}");
}

/// No slope is left at the solution, and it explains data of noise as small as the difference from the truth says.
#[test]
fn exact_the_most_probable_field_is_stationary() {
    let prior = prior(Roughness::FiveHalves);
    let truth = prior.drawn(3);
    with(0.02, &truth, |problem| {
        let found = most_probable(problem, &prior);
        assert_eq!((found.certificate, found.quiescent.len()), (None, 0));
        let flatness = found.stationarity.unwrap();
        assert!(flatness.relative_violation() < 1e-7, "{flatness:?}");
        assert!(found.emission.iter().all(|e| *e > 0.0));
        let misfit = problem.misfit(&found.emission).unwrap();
        assert!(misfit < 1.0 && flatness.value < 1.3, "{misfit} {flatness:?}");
    });
}

/// The field that is found where data say nothing is the one that the density is about: draws are those of the prior.
#[test]
fn exact_data_that_say_nothing_leave_the_draw() {
    let prior = prior(Roughness::Half);
    let draw = prior.drawn(11);
    with(1e9, &draw, |problem| {
        let found = most_probable(problem, &prior.clone().about(11));
        for (found, expected) in found.emission.iter().zip(&draw) {
            assert!((found / expected - 1.0).abs() < 1e-6, "{found} {expected}");
        }
    });
}

/// The logarithm is linear if its amplitude is small: the field is the one of the Gaussian prior whose mean and
/// standard deviation are those of the emission.
#[test]
fn exact_small_amplitudes_are_gaussian() {
    let law =
        Matern { mean: 0.5, amplitude: 1e-4, correlation_length: 4.0, roughness: Roughness::Half };
    let prior = LogNormalField::new(law, &voxels()).unwrap();
    let scale = 0.5f64.exp();
    let of_emission = Matern { mean: scale, amplitude: scale * law.amplitude, ..law };
    let gaussian = GaussianField::at_nodes(of_emission, &voxels()).unwrap();
    with(1e-4, &prior.drawn(3), |problem| {
        let found = most_probable(problem, &prior);
        let settings = LinearSettings { iterations: 3000, tolerance: 1e-10, ..Default::default() };
        let problem = LinearProblem { gaussian: Some(&gaussian), ..*problem };
        let linear = solved(&problem, settings);
        for (found, linear) in found.emission.iter().zip(&linear.emission) {
            let [found, linear] = [found, linear].map(|e| (e / scale - 1.0) / law.amplitude);
            assert!((found - linear).abs() < 1e-2, "{found} {linear}");
        }
    });
}
