use super::active::Active;
use super::data::{Data, Weighted};
use super::operator::Operator;
use super::ray_weights::Walk;
use super::*;
use crate::fit::tests::{beside, dot, images, moved, slope};
use crate::fit::{
    Field, ForwardModel, FrameTerm, ImageTerm, Motion, Region, Regulariser, Sampling,
    SightlineRequest, Sightlines,
};
use crate::representation::{Degree, Knots};
use core::ops::ControlFlow;
use kerrlight_geodesic::{Inclination, Kerr, Observer};
use kerrlight_render::dynamics::{AngularVelocity, Axis, Velocity};
use rand::{RngExt, SeedableRng};
use rand_distr::StandardNormal;
use rand_pcg::Pcg64;

mod changing;
mod gaussian;
pub(in crate::fit) mod initial_fields;
mod kept;
mod log_normal;
mod profile;
mod quiescent;
mod settled;

pub(in crate::fit) const FRAMES: [usize; 5] = [0, 1, 2, 3, 4];

pub(in crate::fit) fn forward_model() -> ForwardModel<f64> {
    forward_model_of(AngularVelocity::bhnerf(), 1.0)
}

fn falling() -> AngularVelocity {
    let law = Velocity::Infall { xi: 0.8, beta_r: 0.9, beta_phi: 0.95, drag: None };
    law.angular(0, 0.0).unwrap()
}

fn falling_model() -> ForwardModel<f64> {
    forward_model_of(falling(), 20.0)
}

/// Times are in units of `unit` M.
fn forward_model_of(velocity: AngularVelocity, unit: f64) -> ForwardModel<f64> {
    let hole = Kerr::new(0.0).unwrap();
    let observer = Observer::at_radius(Inclination::from_degrees(60.0).unwrap(), 1000.0).unwrap();
    let at = |k: usize| -5.0 + 10.0 * k as f64 / 8.0;
    let (alpha, beta): (Vec<f64>, Vec<f64>) = (0..81).map(|k| (at(k % 9), at(k / 9))).unzip();
    let request = SightlineRequest {
        region: Region { r_min: 0.0, r_max: 5.0, z_width: f64::INFINITY },
        sampling: Sampling::EqualMinoTime { per_ray: 40 },
        delay: false,
        momentum: false,
    };
    let lines = Sightlines::trace(&hole, &observer, &alpha, &beta, &request).unwrap();
    let motion = Motion {
        velocity,
        reference: 0.0,
        injection: None,
        times: [0.0, 0.2, 0.35, 0.6, 0.9].map(|time| unit * time).to_vec(),
    };
    ForwardModel::new(&lines, &motion, &hole, None).unwrap()
}

fn axis() -> Axis {
    Axis::new([0.3, -0.2, 0.9]).unwrap()
}

pub(super) fn normal(count: usize, seed: u64) -> Vec<f64> {
    let mut random = Pcg64::seed_from_u64(seed);
    (0..count).map(|_| random.sample::<f64, _>(StandardNormal)).collect()
}

/// A problem without penalties, priors or a bound that acts.
pub(in crate::fit) fn of_images<'a>(
    model: &'a ForwardModel<f64>,
    terms: &'a [Weighted<'a, f64>],
    voxels: Voxels,
) -> LinearProblem<'a, f64> {
    LinearProblem {
        model,
        axis: axis(),
        frames: &FRAMES,
        terms,
        voxels,
        upper: 1e3,
        flux: None,
        priors: &[],
        gaussian: None,
        change: Change::NONE,
    }
}

pub(in crate::fit) fn solved(
    problem: &LinearProblem<'_, f64>,
    settings: LinearSettings,
) -> LinearSolution<f64> {
    problem.solve(&settings, &mut |_| ControlFlow::Continue(())).unwrap()
}

fn random(count: usize, seed: u64) -> Vec<f64> {
    let mut random = Pcg64::seed_from_u64(seed);
    (0..count).map(|_| random.random::<f64>()).collect()
}

fn movie(model: &ForwardModel<f64>, voxels: &Voxels, x: &[f64]) -> Vec<f64> {
    movie_about(axis(), model, voxels, x)
}

/// Images of values at the nodes by way of the representation.
pub(in crate::fit) fn movie_about(
    axis: Axis,
    model: &ForwardModel<f64>,
    voxels: &Voxels,
    x: &[f64],
) -> Vec<f64> {
    let grid = voxels.field().unwrap();
    images(model, Field { representation: &grid, parameters: x, axis, occupancy: None })
}

/// Images of each node alone.
fn columns(model: &ForwardModel<f64>, voxels: &Voxels) -> Vec<Vec<f64>> {
    let dark = vec![0.0; voxels.count()];
    (0..dark.len()).map(|k| movie(model, voxels, &beside(&dark, k, 1.0))).collect()
}

fn operator<'a>(
    model: &'a ForwardModel<f64>,
    voxels: Voxels,
    is_active: &[bool],
    budget: usize,
) -> Operator<'a, f64> {
    let active = Active::new(is_active, &voxels.corners(), 0);
    Operator::new(Walk::new(model, axis(), voxels, Knots::STEADY), active, &FRAMES, budget)
}

/// ‖A x‖² and Aᵀ of twice the images, where the data are dark and all nodes or some count.
#[test]
fn exact_sparse_operator_is_the_grid_and_sums() {
    for model in [forward_model(), falling_model()] {
        compare_with_the_grid(&model, Degree::Linear);
    }
    for degree in [Degree::Quadratic, Degree::Cubic] {
        compare_with_the_grid(&forward_model(), degree);
    }
}

fn compare_with_the_grid(model: &ForwardModel<f64>, degree: Degree) {
    let voxels = Voxels { nodes: [7, 6, 8], ..Voxels::cube(4, 5.0, degree) };
    let all = vec![true; voxels.count()];
    let some: Vec<bool> = random(all.len(), 4).iter().map(|x| *x < 0.4).collect();
    for is_active in [all, some] {
        let operator = operator(model, voxels, &is_active, usize::MAX);
        assert!(operator.bytes() > 12_000);
        is_transposed(&operator, model, |emission| movie(model, &voxels, emission));
    }
}

/// Compares the square of images and its gradient with those of the images that a field has without a matrix.
fn is_transposed(
    operator: &Operator<'_, f64>,
    model: &ForwardModel<f64>,
    images: impl Fn(&[f64]) -> Vec<f64>,
) {
    let count = FRAMES.len() * model.pixels();
    let dark = ImageTerm::new(vec![0.0; count], model.pixels(), 1.0).unwrap();
    let terms = [Weighted { weight: 1.0, term: &dark as &dyn FrameTerm<f64> }];
    let data = Data::new(&terms, &FRAMES, model.pixels(), 5).unwrap();
    let count = count as f64;
    let x = random(operator.active.count(), 1);
    let seen = images(&operator.active.expand(&x));
    let square = dot(&seen, &seen);
    let (value, gradient) = operator.value_and_gradient(&data, &x, false);
    assert!((value * count / square - 1.0).abs() < 1e-12, "{value} {square}");
    // ⟨y, Aᵀ A x⟩ = ⟨A y, A x⟩.
    let y = random(x.len(), 2);
    let others = images(&operator.active.expand(&y));
    let (forward, back) = (dot(&others, &seen), 0.5 * count * dot(&gradient, &y));
    assert!((back / forward - 1.0).abs() < 1e-12, "{back} {forward}");
    // Over all nodes, without the matrix, it is the same.
    let (_, everywhere) = operator.value_and_gradient(&data, &x, true);
    for (a, b) in operator.active.gather(&everywhere).iter().zip(&gradient) {
        assert!((a - b).abs() < 1e-13);
    }
}

/// The least value over the box by coordinate descent on the normal equations, run to the last digit: independent of
/// operator, steps and scaling.
fn reference(columns: &[Vec<f64>], data: &[f64], upper: f64) -> (Vec<f64>, f64) {
    let squares: Vec<f64> = columns.iter().map(|column| dot(column, column)).collect();
    let (mut x, mut rest) = (vec![0.0f64; columns.len()], data.to_vec());
    for _ in 0..20_000 {
        let mut moved = 0.0f64;
        for (k, column) in columns.iter().enumerate().filter(|(k, _)| squares[*k] > 0.0) {
            let next = (x[k] + dot(column, &rest) / squares[k]).clamp(0.0, upper);
            let step = next - x[k];
            rest.iter_mut().zip(column).for_each(|(r, a)| *r -= step * a);
            moved = moved.max(step.abs());
            x[k] = next;
        }
        if moved < 1e-14 {
            break;
        }
    }
    let value = dot(&rest, &rest) / data.len() as f64;
    (x, value)
}

/// A small problem whose data no field explains, with both bounds active.
#[test]
fn exact_solution_and_gap_of_a_dense_problem() {
    let (model, voxels, upper) = (forward_model(), Voxels::cube(5, 5.0, Degree::Linear), 0.8);
    let mut pixels = movie(&model, &voxels, &random(voxels.count(), 7));
    let noise = random(pixels.len(), 8);
    pixels.iter_mut().zip(noise).for_each(|(pixel, n)| *pixel += 2.0 * (n - 0.5));
    let (_, least) = reference(&columns(&model, &voxels), &pixels, upper);
    let term = ImageTerm::new(pixels, model.pixels(), 1.0).unwrap();
    let terms = [Weighted { weight: 1.0, term: &term as &dyn FrameTerm<f64> }];
    let problem = LinearProblem { upper, ..of_images(&model, &terms, voxels) };
    let of = |iterations| LinearSettings { iterations, tolerance: 1e-9, ..Default::default() };
    let coarse = Some(Coarse { nodes: 4, stride: 2, iterations: 5 });
    // Where noise is all that is left, a round ends early, with a value that noise would not tell from the least.
    let count = term.degrees_of_freedom(0) * FRAMES.len();
    let settled = solved(&problem, LinearSettings { settled: 0.1, tolerance: 0.0, ..of(1500) });
    assert_eq!(settled.ending, Ending::Settled);
    let value = settled.certificate.unwrap().value;
    assert!(settled.evaluations < 200 && value > least, "{}", settled.evaluations);
    assert!(value < least * (1.0 + (2.0 / count as f64).sqrt()), "{value} {least}");
    for coarse in [None, coarse] {
        let solution = solved(&problem, LinearSettings { coarse, ..of(1500) });
        let certificate = solution.certificate.unwrap();
        let excess = certificate.value - least;
        assert!(excess.abs() < 1e-6 * certificate.dark, "{coarse:?}: {excess:e}");
        assert!(excess <= certificate.gap + 1e-12, "{coarse:?}");
        assert!(solution.emission.iter().all(|x| (0.0..=upper).contains(x)));
        // Without penalties the value is the loss of the data.
        let misfit = problem.misfit(&solution.emission).unwrap();
        assert!((misfit / certificate.value - 1.0).abs() < 1e-12, "{misfit}");
        // Far from the minimum the gap still bounds what is missing.
        let rough = solved(&problem, LinearSettings { coarse, ..of(3) }).certificate.unwrap();
        assert!(rough.value - least <= rough.gap && rough.value > certificate.value);
    }
}

#[test]
fn exact_threads_change_no_bit() {
    let (model, voxels) = (forward_model(), Voxels::cube(8, 5.0, Degree::Linear));
    let truth: Vec<f64> = random(voxels.count(), 3).iter().map(|x| (x - 0.7).max(0.0)).collect();
    let term = ImageTerm::new(movie(&model, &voxels, &truth), model.pixels(), 0.1).unwrap();
    let prior = Prior { regulariser: Regulariser::Smoothness, weight: 1e-3 };
    let terms = [Weighted { weight: 1.0, term: &term as &dyn FrameTerm<f64> }];
    let priors = &[prior];
    let run = |threads, memory| {
        let problem = LinearProblem { upper: 2.0, priors, ..of_images(&model, &terms, voxels) };
        let settings = LinearSettings { coarse: None, memory, ..LinearSettings::default() };
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| solved(&problem, settings))
    };
    let (one, many) = (run(1, usize::MAX), run(5, usize::MAX));
    assert_eq!(one.emission, many.emission);
    assert_eq!(one.certificate, many.certificate);
    assert!(one.certificate.unwrap().value < 1e-2 * one.certificate.unwrap().dark);
}

#[test]
fn numbers_out_of_range_are_named_and_a_stop_is_heeded() {
    let (model, voxels) = (forward_model(), Voxels::cube(5, 5.0, Degree::Linear));
    let pixels = vec![1.0; FRAMES.len() * model.pixels()];
    let term = ImageTerm::new(pixels, model.pixels(), 1.0).unwrap();
    let terms = [Weighted { weight: 1.0, term: &term as &dyn FrameTerm<f64> }];
    let problem = LinearProblem { upper: 1.0, ..of_images(&model, &terms, voxels) };
    let fail = |problem: LinearProblem<'_, f64>| {
        let go_on = &mut |_: &LinearProgress| ControlFlow::Continue(());
        problem.solve(&LinearSettings::default(), go_on).unwrap_err().to_string()
    };
    assert!(fail(LinearProblem { upper: 0.0, ..problem }).contains("upper = 0 "));
    assert!(fail(LinearProblem { frames: &[5], ..problem }).contains("frame = 5 "));
    assert!(fail(LinearProblem { frames: &[], ..problem }).contains("frames = 0 "));
    let stop = &mut |_: &LinearProgress| ControlFlow::Break(());
    let solution = problem.solve(&LinearSettings::default(), stop).unwrap();
    assert!(solution.ending == Ending::Cancelled && solution.certificate.is_none());
}
