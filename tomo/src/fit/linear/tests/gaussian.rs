//! A Gaussian prior beside data that are linear: the posterior is known in closed form.

use super::*;
use nalgebra::{DMatrix, DVector};

const SIGMA: f64 = 0.4;
const NODES: usize = 5;

fn voxels() -> Voxels {
    Voxels::cube(NODES, 5.0, Degree::Linear)
}

fn prior(roughness: Roughness) -> GaussianField {
    // So far above 0 that no bound acts.
    let law = Matern { mean: 6.0, amplitude: 0.5, correlation_length: 4.0, roughness };
    GaussianField::new(law, &voxels()).unwrap()
}

fn noisy(data: &[f64], seed: u64) -> Vec<f64> {
    moved(data, &normal(data.len(), seed), SIGMA)
}

/// The data of a field that the prior gives.
struct Simulated {
    model: ForwardModel<f64>,
    data: Vec<f64>,
}

impl Simulated {
    fn new(prior: &GaussianField) -> Self {
        let model = forward_model();
        let clean = movie(&model, &voxels(), &prior.drawn(3));
        Self { model, data: noisy(&clean, 4) }
    }

    /// Hands the problem of some data to a function.
    fn with<R>(
        &self,
        data: &[f64],
        prior: &GaussianField,
        f: impl FnOnce(&LinearProblem<'_, f64>) -> R,
    ) -> R {
        let term = ImageTerm::new(data.to_vec(), self.model.pixels(), SIGMA).unwrap();
        f(&LinearProblem {
            gaussian: Some(prior),
            ..of_images(&self.model, &[Weighted { weight: 1.0, term: &term }], voxels())
        })
    }

    fn solution(&self, data: &[f64], prior: &GaussianField) -> LinearSolution<f64> {
        let settings =
            LinearSettings { iterations: 3000, tolerance: 1e-10, ..LinearSettings::default() };
        self.with(data, prior, |problem| solved(problem, settings))
    }

    /// The matrix from voxels to pixels.
    fn matrix(&self) -> DMatrix<f64> {
        let columns = columns(&self.model, &voxels()).into_iter().map(DVector::from_vec);
        DMatrix::from_columns(&columns.collect::<Vec<_>>())
    }
}

/// The inverse of the prior's covariance.
fn precision(prior: &GaussianField) -> DMatrix<f64> {
    let n = prior.count();
    let column = |k: usize| {
        let mut out = vec![0.0; n];
        prior.add_curvature(&beside(&out, k, 1.0), 0.5, &mut out);
        DVector::from_vec(out)
    };
    DMatrix::from_columns(&(0..n).map(column).collect::<Vec<_>>())
}

/// Data with noise once more and a draw of the prior in place of its mean give what the normal equations say, to the digits
/// of the descent, with a certificate of the minimum.
#[test]
fn exact_solutions_are_those_of_the_normal_equations() {
    for roughness in [Roughness::Half, Roughness::FiveHalves] {
        let prior = prior(roughness);
        let simulated = Simulated::new(&prior);
        let (a, q) = (simulated.matrix(), precision(&prior));
        let bend = a.transpose() * &a / (SIGMA * SIGMA) + &q;
        let data = noisy(&simulated.data, 9);
        let center = prior.drawn(10);
        let right = a.transpose() * DVector::from_vec(data.clone()) / (SIGMA * SIGMA)
            + &q * DVector::from_vec(center.clone());
        let expected = bend.clone().cholesky().unwrap().solve(&right);
        let found = simulated.solution(&data, &prior.clone().about(center));
        for (found, expected) in found.emission.iter().zip(&expected) {
            assert!((found - expected).abs() < 1e-5 * expected, "{roughness:?} {found} {expected}");
        }
        let certificate = found.certificate.unwrap();
        assert!(certificate.relative_violation() < 1e-8, "{certificate:?}");
    }
}

/// The variance of many draws at every node is the diagonal of the inverse of the second derivatives.
#[test]
fn exact_draws_have_the_covariance_of_the_posterior() {
    let prior = prior(Roughness::Half);
    let simulated = Simulated::new(&prior);
    let (a, q) = (simulated.matrix(), precision(&prior));
    let covariance = (a.transpose() * &a / (SIGMA * SIGMA) + q).try_inverse().unwrap();
    let best = simulated.solution(&simulated.data, &prior).emission;
    let (draws, n) = (400, prior.count());
    let mut squares = vec![0.0; n];
    for seed in 0..draws {
        let data = noisy(&simulated.data, 100 + seed);
        let center = prior.drawn(1000 + seed);
        let draw = simulated.solution(&data, &prior.clone().about(center)).emission;
        for (square, (x, best)) in squares.iter_mut().zip(draw.iter().zip(&best)) {
            *square += (x - best).powi(2) / draws as f64;
        }
    }
    let ratios: Vec<f64> = (0..n).map(|k| squares[k] / covariance[(k, k)]).collect();
    // Each is χ² of 400 over 400: a standard deviation of 0.07.
    assert!(ratios.iter().all(|ratio| (ratio - 1.0).abs() < 0.3), "{ratios:?}");
    let mean = ratios.iter().sum::<f64>() / n as f64;
    assert!((mean - 1.0).abs() < 0.04, "{mean}");
    // The data say something of most nodes, not of all.
    let known = (0..n).filter(|k| covariance[(*k, *k)] < 0.5 * 0.25).count();
    assert!(known > 10 && known < n, "{known}");
}

/// Frames held out leave fewer data, beside which the prior weighs more: the density is the same.
#[test]
fn exact_losses_are_densities_over_data() {
    let prior = prior(Roughness::Half);
    let simulated = Simulated::new(&prior);
    let x = prior.drawn(20);
    let of = |frames: &[usize]| {
        simulated.with(&simulated.data, &prior, |problem| {
            let problem = LinearProblem { frames, ..*problem };
            let count = (frames.len() * simulated.model.pixels()) as f64;
            let start = problem.least(Some(&x), 0).unwrap();
            (start.value - problem.misfit(&x).unwrap()) * count
        })
    };
    let expected = prior.value_and_gradient(&x, 1.0, &mut vec![0.0; x.len()]);
    for frames in [&FRAMES[..], &FRAMES[..2]] {
        assert!((of(frames) / expected - 1.0).abs() < 1e-9, "{} {expected}", of(frames));
    }
}

#[test]
fn numbers_of_another_grid_are_refused() {
    let prior = prior(Roughness::Half);
    let simulated = Simulated::new(&prior);
    let error = simulated.with(&simulated.data, &prior, |problem| {
        let voxels = Voxels::cube(NODES + 1, 5.0, Degree::Linear);
        let problem = LinearProblem { voxels, ..*problem };
        problem.solve(&LinearSettings::default(), &mut |_| ControlFlow::Continue(())).unwrap_err()
    });
    assert!(error.to_string().contains("nodes of the prior = 125 "), "{error}");
}
