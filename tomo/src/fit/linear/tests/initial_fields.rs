//! Data that are not convex in the emission: amplitudes and closure quantities of a small array.

use super::*;
use crate::Error;
use crate::fit::{Scan, ScanTerm};
use kerrlight_vlbi::data_terms::{AmplitudeTerm, ClosureTerm, DataTerm, Residual, VisibilityTerm};
use kerrlight_vlbi::observation::{Basis, Measured, Observation, Row};
use kerrlight_vlbi::operator::{Dtft, ImageGrid, Pulse, Transform};
use kerrlight_vlbi::products::ClosureKind;
use num_complex::Complex;

/// Kinds of data of an array.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(in crate::fit) enum Observable {
    Visibilities,
    Amplitudes,
    Phases,
    LogAmplitudes,
}

fn term(observation: &Observation, seen: Observable) -> Box<dyn DataTerm<f64> + Send> {
    let closure = |kind| Box::new(ClosureTerm::new(observation, kind, 0.0).unwrap());
    match seen {
        Observable::Visibilities => Box::new(VisibilityTerm::new(observation).unwrap()),
        Observable::Amplitudes => Box::new(AmplitudeTerm::new(observation).unwrap()),
        Observable::Phases => closure(ClosureKind::Phase),
        Observable::LogAmplitudes => closure(ClosureKind::LogAmplitude),
    }
}

/// Data without noise of a movie of 9 × 9 pixels, seen by seven stations that turn from frame to frame; errors are a hundredth of
/// the largest visibility.
pub(in crate::fit) fn array(movie: &[f64], seen: Observable) -> ScanTerm<f64> {
    let grid = ImageGrid::new(9, 9, 4e-10).unwrap();
    let frame = |(time, image): (usize, &[f64])| {
        let place = |k: u16| {
            let (sin, cos) = (1.7 * f64::from(k) + 0.3 * time as f64).sin_cos();
            let radius = 6e8 * (1.0 + f64::from(k));
            [radius * cos, radius * sin]
        };
        let pairs: Vec<[u16; 2]> = (0..7).flat_map(|a| (a + 1..7).map(move |b| [a, b])).collect();
        let uv: Vec<[f64; 2]> =
            pairs.iter().map(|[a, b]| [0, 1].map(|c| place(*b)[c] - place(*a)[c])).collect();
        let transform = Dtft::new(grid, Pulse::Triangle, core::slice::from_ref(&uv), usize::MAX);
        let mut visibilities = vec![Complex::new(0.0, 0.0); uv.len()];
        kerrlight_vlbi::operator::Operator::forward(&transform, image, &mut visibilities);
        let largest = visibilities.iter().map(|v| v.norm()).fold(1e-3, f64::max);
        let mut observation = Observation::empty(Basis::Stokes);
        for ((pair, uv), visibility) in pairs.iter().zip(&uv).zip(visibilities) {
            let measured = Measured { visibility, noise_sigma: 0.01 * largest };
            observation.rows.push(Row::total_intensity(time as f64, *pair, *uv, measured));
        }
        Some(Scan { transform: Transform::Direct(transform), term: term(&observation, seen) })
    };
    let scans = movie.chunks(81).enumerate().map(frame).collect();
    ScanTerm::new(&format!("{seen:?}"), 81, seen == Observable::Visibilities, scans)
}

/// A spot beside the axis.
pub(in crate::fit) fn spot(voxels: &Voxels) -> Vec<f64> {
    let light = |k: usize| {
        let [x, y, z] = voxels.position(k);
        (-((x - 1.5).powi(2) + (y + 2.0).powi(2) + (z - 0.5).powi(2)) / 2.0).exp()
    };
    (0..voxels.count()).map(light).collect()
}

fn solve(terms: &[Weighted<'_, f64>], flux: Option<f64>) -> Result<LinearSolution<f64>, Error> {
    let model = forward_model();
    let voxels = Voxels::cube(11, 5.0, Degree::Linear);
    let problem = LinearProblem { upper: 2.0, flux, ..of_images(&model, terms, voxels) };
    let settings = LinearSettings { iterations: 60, rounds: 3, ..LinearSettings::default() };
    problem.solve(&settings, &mut |_| ControlFlow::Continue(()))
}

/// A dark field has no slope: it is left all the same, and no certificate is claimed.
#[test]
fn exact_amplitudes_are_solved_from_lit_fields() {
    let (model, voxels) = (forward_model(), Voxels::cube(11, 5.0, Degree::Linear));
    let movie = movie(&model, &voxels, &spot(&voxels));
    let flux = movie.iter().sum::<f64>() / FRAMES.len() as f64;
    let dark = vec![0.0; 81];
    for kinds in [&[Observable::Amplitudes][..], &[Observable::Amplitudes, Observable::Phases]] {
        let data: Vec<ScanTerm<f64>> = kinds.iter().map(|seen| array(&movie, *seen)).collect();
        let terms: Vec<Weighted<'_, f64>> =
            data.iter().map(|term| Weighted { weight: 1.0, term: term as _ }).collect();
        let solution = solve(&terms, None).unwrap();
        assert!(solution.certificate.is_none());
        let at = solution.stationarity.unwrap();
        let of_dark: f64 =
            data.iter().map(|term| term.value_and_gradient(0, &dark, 0.0, &mut dark.clone())).sum();
        assert!(at.value < 1.0 && at.value < 0.02 * at.start, "{kinds:?}: {at:?}");
        assert!(at.relative_violation() < 1e-2 && of_dark > 100.0, "{kinds:?}: {at:?}");
        let found = super::movie(&model, &voxels, &solution.emission);
        let found = found.iter().sum::<f64>() / FRAMES.len() as f64;
        assert!((found / flux - 1.0).abs() < 0.05, "{kinds:?}: {found} {flux}");
    }
}

#[test]
fn exact_closures_alone_need_a_flux_and_dark_data_have_no_light() {
    let (model, voxels) = (forward_model(), Voxels::cube(11, 5.0, Degree::Linear));
    let movie = movie(&model, &voxels, &spot(&voxels));
    let closures = array(&movie, Observable::LogAmplitudes);
    let terms = [Weighted { weight: 1.0, term: &closures as &dyn FrameTerm<f64> }];
    assert!(matches!(solve(&terms, None), Err(Error::Linear(LinearError::NoFlux(_)))));
    assert!(matches!(
        solve(&terms, Some(-1.0)),
        Err(Error::Render(kerrlight_render::Error::Range(_)))
    ));
    let error = solve(&terms, Some(1e6)).unwrap_err();
    assert!(matches!(error, Error::Linear(LinearError::TooBright { .. })), "{error}");
    let none = array(&vec![0.0; movie.len()], Observable::Amplitudes);
    let terms = [Weighted { weight: 1.0, term: &none as &dyn FrameTerm<f64> }];
    assert!(matches!(solve(&terms, None), Err(Error::Linear(LinearError::NoLight(_)))));
}

/// χ² that is no number in one of its frames.
struct Broken {
    convex: bool,
}

impl FrameTerm<f64> for Broken {
    fn name(&self) -> &str {
        "broken"
    }
    fn frames(&self) -> usize {
        FRAMES.len()
    }
    fn pixels(&self) -> usize {
        81
    }
    fn degrees_of_freedom(&self, _frame: usize) -> usize {
        1
    }
    fn is_quadratic(&self) -> bool {
        self.convex
    }
    fn value_and_gradient(&self, frame: usize, _: &[f64], _: f64, _: &mut [f64]) -> f64 {
        if frame == 4 { f64::NAN } else { 1.0 }
    }
    fn residuals(&self, frame: usize, _: &[f64]) -> Vec<Residual> {
        let value = if frame == 4 { f64::NAN } else { 1.0 };
        vec![Residual { value, datum: 0.0, freedom: 1.0, stations: Vec::new() }]
    }
}

#[test]
fn exact_a_loss_that_is_no_number_is_named() {
    for convex in [true, false] {
        let broken = Broken { convex };
        let terms = [Weighted { weight: 1.0, term: &broken as &dyn FrameTerm<f64> }];
        let error = solve(&terms, None).unwrap_err().to_string();
        assert!(error.contains("broken of frame 4: χ² is NaN"), "{error}");
    }
}
