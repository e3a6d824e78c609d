//! Static images beside voxels: columns of the same problem.

use super::super::objective::{Objective, Penalised};
use super::super::scaled::Convex;
use super::initial_fields::{Observable as Array, array, spot};
use super::*;
use crate::fit::{Observable, Quiescent, WithStaticImage};
use kerrlight_render::polarization::{Stokes, StokesParameter};

const UPPER: f64 = 2.0;

fn image(signed: &[bool], weights: [f64; 2]) -> Quiescent {
    let regularisers = [Regulariser::Smoothness, Regulariser::Sparsity];
    let prior = |(regulariser, weight)| Prior { regulariser, weight };
    Quiescent {
        pixels: 81,
        signed: signed.to_vec(),
        most: UPPER,
        upper: 5.0,
        jy_per_pixel: 1.3,
        priors: regularisers.into_iter().zip(weights).map(prior).collect(),
        spacing: 1.25,
    }
}

/// I beside it, or I, Q and U with factors that differ from node to node.
fn beside(weights: [f64; 2], polarized: bool) -> ForwardModel<f64> {
    let model = forward_model();
    if !polarized {
        return model.beside(image(&[false], weights)).unwrap();
    }
    let number = random(3 * model.points(), 12);
    let of = |k: usize| Stokes { i: 1.0, q: number[k] - 0.5, u: number[k + 1] - 0.5, v: 0.0 };
    let factors: Vec<Stokes> = (0..model.points()).map(|k| of(3 * k)).collect();
    let seen = vec![StokesParameter::I, StokesParameter::Q, StokesParameter::U];
    let model = model.seen(Some(&factors), &Observable::StokesImages(seen)).unwrap();
    model.beside(image(&[false, true, true], weights)).unwrap()
}

fn problem<'a>(
    model: &'a ForwardModel<f64>,
    terms: &'a [Weighted<'a, f64>],
    priors: &'a [Prior],
) -> LinearProblem<'a, f64> {
    let voxels = Voxels::cube(6, 5.0, Degree::Linear);
    LinearProblem { upper: UPPER, priors, ..of_images(model, terms, voxels) }
}

/// Images of values at all nodes, and of the image behind them, by way of the representation.
fn images(model: &ForwardModel<f64>, x: &[f64]) -> Vec<f64> {
    let grid = Box::new(Voxels::cube(6, 5.0, Degree::Linear).field().unwrap());
    let representation = &WithStaticImage::new(grid, model.quiescent().unwrap());
    super::images(model, Field { representation, parameters: x, axis: axis(), occupancy: None })
}

/// ⟨A x, y⟩ = ⟨x, Aᵀ y⟩ with rows that are kept and with walks, where some voxels count or all; and A x are the images of
/// the representation.
#[test]
fn exact_quiescent_columns_have_their_adjoint() {
    for polarized in [false, true] {
        let model = beside([0.0; 2], polarized);
        let problem = problem(&model, &[], &[]);
        let is_active: Vec<bool> = random(problem.unknowns(), 4).iter().map(|x| *x < 0.4).collect();
        for (budget, is_active) in [(usize::MAX, is_active.clone()), (0, is_active)] {
            let active = problem.active(&is_active);
            let operator = Operator::new(problem.walk(), active, &FRAMES, budget);
            let x = random(operator.active.count(), 1);
            let y = random(FRAMES.len() * model.pixels(), 2);
            let found = operator.images(&x);
            let (forward, back) = (dot(&found, &y), dot(&operator.adjoint(&y), &x));
            assert!((back / forward - 1.0).abs() < 1e-12, "{back} {forward}");
            let movie = images(&model, &operator.active.expand(&x));
            let worst = found.iter().zip(&movie).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
            assert!(worst < 1e-12 * movie.iter().fold(0.0f64, |most, x| most.max(x.abs())));
        }
    }
}

/// Slopes of data and penalties along random directions, and second derivatives where they are quadratic.
#[test]
fn exact_slopes_beside_a_quiescent_image() {
    let model = beside([0.3, 0.2], false);
    let movie = images(&model, &lit(0.7));
    for seen in [Array::Visibilities, Array::Amplitudes, Array::Phases, Array::LogAmplitudes] {
        let term = array(&movie, seen);
        let terms = [Weighted { weight: 1.0, term: &term as &dyn FrameTerm<f64> }];
        let problem = problem(&model, &terms, &[]);
        let operator = Operator::new(problem.walk(), problem.all(), &FRAMES, usize::MAX);
        let data = problem.data().unwrap();
        let mut objective = Objective::new(&operator, &data, problem.penalised(&data));
        let x: Vec<f64> = random(problem.unknowns(), 1).iter().map(|x| 0.5 + x).collect();
        let direction = random(problem.unknowns(), 2);
        let (mut gradient, h) = (Vec::new(), 1e-5);
        let mut at = |s: f64| {
            let value = objective.value_and_gradient(&moved(&x, &direction, s), &mut gradient);
            (value, dot(&gradient, &direction))
        };
        let (after, before, (_, slope)) = (at(h), at(-h), at(0.0));
        let difference = (after.0 - before.0) / (2.0 * h);
        assert!((difference / slope - 1.0).abs() < 1e-6, "{seen:?}: {difference} {slope}");
        if seen == Array::Visibilities {
            let product = objective.curvature(&direction);
            let (bend, found) = ((after.1 - before.1) / (2.0 * h), dot(&product, &direction));
            assert!((bend / found - 1.0).abs() < 1e-6, "{bend} {found}");
        }
    }
}

/// Values of a spot and, behind them, of an image that is lit on one side.
fn lit(brightness: f64) -> Vec<f64> {
    let mut x = spot(&Voxels::cube(6, 5.0, Degree::Linear));
    x.extend((0..81).map(|k| if k % 9 < 3 { brightness } else { 0.0 }));
    x
}

/// All starts come to the same minimum with a small gap, and a rough solution is no farther from it than its gap.
#[test]
fn exact_certificates_beside_a_quiescent_image() {
    for polarized in [false, true] {
        let model = beside([1e-3, 1e-3], polarized);
        let mut pixels = images(&model, &random_field(&model));
        let noise = random(pixels.len(), 8);
        pixels.iter_mut().zip(noise).for_each(|(pixel, n)| *pixel += 0.4 * (n - 0.5));
        let term = ImageTerm::new(pixels, model.pixels(), 0.1).unwrap();
        let terms = [Weighted { weight: 1.0, term: &term as &dyn FrameTerm<f64> }];
        let priors = [Prior { regulariser: Regulariser::Smoothness, weight: 1e-3 }];
        let problem = problem(&model, &terms, &priors);
        let coarse = Some(Coarse { nodes: 4, stride: 2, iterations: 5 });
        let solve = |iterations, coarse| {
            let settings =
                LinearSettings { coarse, iterations, tolerance: 1e-8, ..LinearSettings::default() };
            solved(&problem, settings)
        };
        let least = solve(3000, None).certificate.unwrap();
        assert!(least.relative_gap() < 1e-5, "{least:?}");
        for coarse in [None, coarse] {
            let solution = solve(3000, coarse);
            let certificate = solution.certificate.unwrap();
            let excess = (certificate.value - least.value) / certificate.dark;
            assert!(excess.abs() < 1e-6, "{coarse:?}: {excess:e}");
            assert_eq!(solution.parameters().len(), problem.unknowns());
            assert!(solution.quiescent.iter().any(|x| *x > 0.0));
            let rough = solve(3, coarse).certificate.unwrap();
            assert!(rough.value - least.value <= rough.gap && rough.value > least.value);
        }
    }
}

fn random_field(model: &ForwardModel<f64>) -> Vec<f64> {
    let columns = model.quiescent().unwrap().columns();
    let mut x = spot(&Voxels::cube(6, 5.0, Degree::Linear));
    x.extend(random(columns, 9).iter().map(|x| (x - 0.6).max(0.0)));
    x
}

/// Exact images of a spot that moves and of light that does not: each is found where it belongs.
#[test]
fn exact_what_does_not_move_is_told_apart() {
    let model = beside([0.0, 1e-6], false);
    let truth = lit(0.7);
    let pixels = images(&model, &truth);
    let term = ImageTerm::new(pixels, model.pixels(), 0.1).unwrap();
    let terms = [Weighted { weight: 1.0, term: &term as &dyn FrameTerm<f64> }];
    let priors = [Prior { regulariser: Regulariser::Sparsity, weight: 1e-5 }];
    let problem = problem(&model, &terms, &priors);
    let settings = LinearSettings {
        coarse: None,
        iterations: 2000,
        tolerance: 1e-7,
        ..LinearSettings::default()
    };
    let found = solved(&problem, settings);
    let correlation = |a: &[f64], b: &[f64]| dot(a, b) / (dot(a, a) * dot(b, b)).sqrt();
    let (fields, light) = truth.split_at(truth.len() - 81);
    let [moving, still] =
        [correlation(&found.emission, fields), correlation(&found.quiescent, light)];
    assert!(moving > 0.99 && still > 0.99, "{moving} {still}");
    assert!(problem.misfit(&found.parameters()).unwrap() < 1e-3 * found.certificate.unwrap().dark);
}

/// A box that is not that of the emission has no certificate.
#[test]
fn exact_another_box_is_refused() {
    let other = Quiescent { most: 1.0, ..image(&[false], [0.0; 2]) };
    let model = forward_model().beside(other).unwrap();
    let term = ImageTerm::new(vec![0.0; 5 * 81], 81, 1.0).unwrap();
    let terms = [Weighted { weight: 1.0, term: &term as &dyn FrameTerm<f64> }];
    let error = problem(&model, &terms, &[]).least(None, 3).unwrap_err().to_string();
    assert!(error.contains("most of the quiescent image = 1 "), "{error}");
}

/// Rays of nodes have their entries; what is not theirs has its own.
#[test]
fn exact_penalties_of_the_image_are_its_own() {
    let (model, priors) = (beside([0.5, 0.25], false), []);
    let penalised = Penalised {
        priors: &priors,
        shape: Voxels::cube(6, 5.0, Degree::Linear).shape(),
        gaussian: None,
        change: Change::NONE,
        prices: &[],
        quiescent: model.quiescent(),
        upper: UPPER,
    };
    let x = lit(0.7);
    let mut slopes = vec![0.0; x.len()];
    // Brightness 0.7 · 5/2 Jy, over 1.3 Jy, M: three columns of nine pixels of 1.25 M, with an edge of nine.
    let b: f64 = 0.7 * 2.5 / 1.3;
    let expected = 0.5 * 9.0 * b * b + 0.25 * 27.0 * b * 1.25 * 1.25;
    let found = penalised.value_and_gradient(&x, &mut slopes);
    assert!((found / expected - 1.0).abs() < 1e-12, "{found} {expected}");
    let voxels = x.len() - 81;
    assert!(
        slopes[..voxels].iter().all(|x| *x == 0.0) && slopes[voxels..].iter().any(|x| *x > 0.0)
    );
}
