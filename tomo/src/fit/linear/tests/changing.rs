//! Fields that change while matter carries them.

use super::super::change::Change;
use super::*;
use crate::fit::Region;
use crate::fit::linear::StopRule;
use crate::representation::{Allowed, Carrier, Changing};

const ALLOWED: [Allowed; 2] = [Allowed::Any, Allowed::Births];

fn knots(allowed: Allowed) -> Knots {
    Knots { first: 0.05, spacing: 0.2, count: 4, allowed }
}

/// Rays with or without delays.
fn delayed(mut model: ForwardModel<f64>, delay: bool) -> ForwardModel<f64> {
    if delay {
        // Light from farther along x comes later: as good as any for what is tested here.
        model.delay = model.position[0].iter().map(|x| 0.03 * x).collect();
        let pairs = model.rate.iter().zip(&model.delay);
        model.phase = pairs.map(|(rate, delay)| -rate * delay).collect();
    }
    model
}

fn changing(velocity: AngularVelocity, voxels: &Voxels, knots: Knots) -> Changing<f64> {
    let carrier = Carrier { axis: axis(), velocity, limits: [0.0, 5.0] };
    Changing::new(Box::new(voxels.field().unwrap()), knots, Some(carrier)).unwrap()
}

fn images(model: &ForwardModel<f64>, field: &Changing<f64>, x: &[f64]) -> Vec<f64> {
    let field = Field { representation: field, parameters: x, axis: axis(), occupancy: None };
    super::images(model, field)
}

/// Images of a spot that shines with these shares of its brightness at the knots, and its values there.
fn shining(model: &ForwardModel<f64>, knots: Knots, shares: [f64; 4]) -> (Vec<f64>, Vec<f64>) {
    let voxels = Voxels::cube(9, 5.0, Degree::Linear);
    let spot = initial_fields::spot(&voxels);
    let truth: Vec<f64> = shares.iter().flat_map(|s| spot.iter().map(move |e| s * e)).collect();
    let field = changing(AngularVelocity::bhnerf(), &voxels, knots);
    (images(model, &field, &truth), truth)
}

/// ‖A x‖² by the sparse matrix, where all nodes or some count, is that of the representation's images; so is its transpose.
/// The same of matter that falls.
#[test]
fn exact_sparse_operator_is_the_changing_field_and_sums() {
    let voxels = Voxels { nodes: [7, 6, 8], ..Voxels::cube(2, 5.0, Degree::Linear) };
    for (allowed, delay) in ALLOWED.into_iter().flat_map(|a| [(a, false), (a, true)]) {
        let knots = knots(allowed);
        let field = changing(AngularVelocity::bhnerf(), &voxels, knots);
        compare_with_images(&delayed(forward_model(), delay), &field, voxels, knots);
        let knots = Knots { first: 1.0, spacing: 4.0, ..knots };
        let field = changing(falling(), &voxels, knots);
        compare_with_images(&delayed(falling_model(), delay), &field, voxels, knots);
    }
}

fn compare_with_images(
    model: &ForwardModel<f64>,
    field: &Changing<f64>,
    voxels: Voxels,
    knots: Knots,
) {
    for (share, budget) in [(1.0, usize::MAX), (1.0, 0), (0.4, usize::MAX), (0.4, 0)] {
        let is_active: Vec<bool> =
            random(4 * voxels.count(), 4).iter().map(|x| *x < share).collect();
        let active = Active::new(&is_active, &voxels.corners(), 0);
        let walk = Walk::new(model, axis(), voxels, knots);
        let operator = Operator::new(walk, active, &FRAMES, budget);
        is_transposed(&operator, model, |emission| images(model, field, emission));
    }
}

fn births() -> Change {
    Change { knots: knots(Allowed::Births), weight: 0.0, within: None, sharpen: None }
}

fn solve(model: &ForwardModel<f64>, pixels: Vec<f64>, change: Change) -> LinearSolution<f64> {
    let term = ImageTerm::new(pixels, model.pixels(), 1e-3).unwrap();
    let terms = [Weighted { weight: 1.0, term: &term as &dyn FrameTerm<f64> }];
    let voxels = Voxels::cube(9, 5.0, Degree::Linear);
    let problem = LinearProblem { upper: 2.0, change, ..of_images(model, &terms, voxels) };
    let settings = LinearSettings {
        coarse: None,
        iterations: 800,
        rounds: 1,
        tolerance: 1e-7,
        ..LinearSettings::default()
    };
    solved(&problem, settings)
}

/// A field that is born, or appears and fades, explains images of it; a field that matter carries unchanged does not. A
/// price that is too high leaves such a field.
#[test]
fn exact_between_a_field_that_is_carried_and_one_that_is_free() {
    let (model, voxels) = (forward_model(), Voxels::cube(9, 5.0, Degree::Linear));
    for allowed in ALLOWED {
        let knots = knots(allowed);
        let shares = match allowed {
            Allowed::Births => [0.1, 0.0, 1.0, 0.0],
            _ => [0.1, 0.1, 1.0, 0.2],
        };
        let (pixels, _) = shining(&model, knots, shares);
        let value = |weight: f64| {
            let found = solve(&model, pixels.clone(), Change { knots, weight, ..births() });
            let certificate = found.certificate.unwrap();
            assert!(certificate.gap >= 0.0 && certificate.value <= certificate.dark);
            (certificate.value / certificate.dark, found.emission)
        };
        let (free, _) = value(0.0);
        assert!(free < 1e-4, "{allowed:?}: {free:e}");
        let steady = solve(&model, pixels.clone(), Change::NONE);
        let carried = steady.certificate.unwrap();
        let carried = carried.value / carried.dark;
        assert!(carried > 0.05, "{allowed:?}: {carried:e}");
        if allowed == Allowed::Any {
            let (dear, emission) = value(3e4);
            assert!((dear / carried - 1.0).abs() < 0.02, "{dear} {carried}");
            let change = emission
                .chunks_exact(voxels.count())
                .flat_map(|knot| knot.iter().zip(&emission).map(|(a, b)| (a - b).abs()));
            assert!(change.fold(0.0, f64::max) < 0.02);
        }
    }
}

/// A linear price takes light from births, so that flows with few births explain data best; where births that were found
/// cost less, they keep it.
#[test]
fn exact_sharpened_births_keep_their_light() {
    let (model, voxels) = (forward_model(), Voxels::cube(9, 5.0, Degree::Linear));
    let (pixels, truth) = shining(&model, knots(Allowed::Births), [0.0, 0.0, 1.0, 0.0]);
    let term = ImageTerm::new(pixels, model.pixels(), 1e-3).unwrap();
    let terms = [Weighted { weight: 1.0, term: &term as &dyn FrameTerm<f64> }];
    let problem = |sharpen| {
        let change = Change { weight: 100.0, sharpen, ..births() };
        LinearProblem { change, upper: 2.0, ..of_images(&model, &terms, voxels) }
    };
    // What is there from the beginning has no price.
    let light = |x: &[f64]| x[voxels.count()..].iter().sum::<f64>() / truth.iter().sum::<f64>();
    // A first round that ends by itself knows no prices: there is a second one.
    let settings = LinearSettings { iterations: 400, coarse: None, ..LinearSettings::default() };
    let [plain, sharp] =
        [None, Some(0.02)].map(|sharpen| light(&solved(&problem(sharpen), settings).emission));
    assert!(plain < 0.85 && sharp > plain + 0.05 && sharp < 1.0, "{plain} {sharp}");
    let [(plain, left), (sharp, rest)] = [None, Some(0.02)].map(problem).map(|problem| {
        let least = problem.settled(None, StopRule::looking(150)).unwrap();
        (light(&least.x), problem.misfit(&least.x).unwrap())
    });
    assert!(plain < 0.85 && sharp > 0.9 && sharp < 1.0, "{plain} {sharp}");
    assert!(rest < 0.2 * left, "{rest} {left}");
}

/// Births are found where emission may be and nowhere else, and the certificate is one of such fields.
#[test]
fn exact_births_are_within_their_region() {
    let (model, voxels) = (forward_model(), Voxels::cube(9, 5.0, Degree::Linear));
    let (pixels, _) = shining(&model, knots(Allowed::Births), [0.2, 0.0, 1.0, 0.0]);
    let region = Region { r_min: 3.0, r_max: 4.5, z_width: 1.0 };
    for within in [None, Some(region)] {
        let change = Change { weight: 0.0, within, ..births() };
        let found = solve(&model, pixels.clone(), change);
        let outside = |k: usize| {
            let [x, y, z] = voxels.position(k % voxels.count());
            let r = (x * x + y * y + z * z).sqrt();
            !(3.0..4.5).contains(&r) || z.abs() > 1.625
        };
        let light: f64 =
            (0..found.emission.len()).filter(|k| outside(*k)).map(|k| found.emission[k]).sum();
        assert_eq!(light == 0.0, within.is_some(), "{light}");
        let certificate = found.certificate.unwrap();
        assert!(certificate.gap >= 0.0 && certificate.gap < 1e-2 * certificate.dark);
    }
}
