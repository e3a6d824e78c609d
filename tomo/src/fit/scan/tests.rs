use super::super::linear::Weighted;
use super::super::linear::tests::{forward_model, movie_about, of_images};
use super::super::{ForwardModel, FrameTerm, ImageTerm};
use super::*;
use crate::representation::Degree;

/// No direction is farther from the lattice than its points are from each other: √(4π/500); the best
/// covering by hexagons has 0.0984.
#[test]
fn exact_lattice_covers_the_sphere() {
    let points = lattice(500);
    for target in lattice(77) {
        let nearest = points.iter().map(|p| p.dot(target)).fold(-1.0, f64::max);
        assert!(nearest > 0.1585f64.cos(), "{target:?} {nearest}");
    }
    let mean: Vec<f64> =
        (0..3).map(|c| points.iter().map(|p| p.vector()[c]).sum::<f64>() / 500.0).collect();
    assert!(mean.iter().all(|m| m.abs() < 2e-3), "{mean:?}");
}

fn problem<'a>(
    model: &'a ForwardModel<f64>,
    terms: &'a [Weighted<'a, f64>],
) -> LinearProblem<'a, f64> {
    let voxels = Voxels::cube(9, 5.0, Degree::Linear);
    LinearProblem { upper: 2.0, ..of_images(model, terms, voxels) }
}

const SMALL: AxisSettings = AxisSettings {
    directions: 40,
    coarse: Effort { nodes: 7, iterations: 10 },
    candidates: 2,
    fine: Effort { nodes: 8, iterations: 15 },
    halvings: 1,
};

/// Dark images are explained about every axis.
#[test]
fn exact_losses_that_are_all_the_same_are_refused() {
    let term = ImageTerm::new(vec![0.0; 5 * 81], 81, 1.0).unwrap();
    let terms = [Weighted { weight: 1.0, term: &term as &dyn FrameTerm<f64> }];
    let model = forward_model();
    let error = search(&problem(&model, &terms), &SMALL, &|_, _| true).unwrap_err();
    let Error::Linear(error) = error else { panic!("{error}") };
    assert_eq!(error, LinearError::Alike { axes: 40, loss: 0.0 });
}

/// Amplitudes and closure phases, from lit fields about every axis.
#[test]
fn exact_axis_of_amplitudes_and_closure_phases() {
    use super::super::linear::tests::initial_fields::{Observable, array, spot};
    let (model, voxels) = (forward_model(), Voxels::cube(9, 5.0, Degree::Linear));
    let truth = Axis::new([0.6, -0.3, -0.7]).unwrap();
    let movie = movie_about(truth, &model, &voxels, &spot(&voxels));
    let data = [Observable::Amplitudes, Observable::Phases].map(|seen| array(&movie, seen));
    let terms = [0, 1].map(|k| Weighted { weight: 1.0, term: &data[k] as &dyn FrameTerm<f64> });
    let scan = search(&problem(&model, &terms), &SMALL, &|_, _| true).unwrap().unwrap();
    assert!(scan.map.iter().all(|at| at.loss.is_finite() && at.loss > 0.0));
    assert!(scan.best.axis.dot(truth) > 0.9, "{:?}", scan.best);
}

/// A spot that turns about a known axis, in the field that the fine grid can represent.
#[test]
fn exact_axis_of_its_own_movie_on_any_number_of_threads() {
    let (model, voxels) = (forward_model(), Voxels::cube(9, 5.0, Degree::Linear));
    let truth = Axis::new([0.6, -0.3, -0.7]).unwrap();
    let light = |k: usize| {
        let [x, y, z] = voxels.position(k);
        (-((x - 1.5).powi(2) + (y + 2.0).powi(2) + (z - 2.0).powi(2)) / 2.0).exp()
    };
    let field: Vec<f64> = (0..voxels.count()).map(light).collect();
    let pixels = movie_about(truth, &model, &voxels, &field);
    let term = ImageTerm::new(pixels, model.pixels(), 1.0).unwrap();
    let terms = [Weighted { weight: 1.0, term: &term as &dyn FrameTerm<f64> }];
    let problem = problem(&model, &terms);
    let settings = AxisSettings {
        directions: 60,
        coarse: Effort { nodes: 8, iterations: 10 },
        fine: Effort { nodes: 9, iterations: 30 },
        ..AxisSettings::default()
    };
    let run = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| search(&problem, &settings, &|_, _| true)).unwrap().unwrap()
    };
    let scan = run(1);
    assert_eq!(scan, run(4));
    assert_eq!(scan.map.len(), 60);
    assert!(scan.best.axis.dot(truth) > 0.99, "{:?}", scan.best);
    assert!(scan.runner_up.axis.dot(scan.best.axis) < 0.0);
    assert!(scan.best.loss < scan.runner_up.loss);
    assert_eq!(search(&problem, &settings, &|_, _| false).unwrap(), None);
    let none = AxisSettings { directions: 2, ..settings };
    let text = search(&problem, &none, &|_, _| true).unwrap_err().to_string();
    assert!(text.contains("directions = 2 "), "{text}");
}
