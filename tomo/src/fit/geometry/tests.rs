//! Images of geometries, and the search for the geometry of a hot spot.

use super::*;
use crate::fit::RingRays;
use crate::fit::forward::pixel_rays::PixelRays;
use crate::fit::linear::{Change, StopRule, Weighted};
use crate::fit::tests::{Blobs, images};
use crate::fit::{
    Batch, Field, ForwardModel, FrameTerm, ImageTerm, Motion, Observable, Redshift, Region,
};
use crate::representation::{Degree, Representation};
use core::f64::consts::{FRAC_PI_2, PI};
use kerrlight_geodesic::{Inclination, Kerr, Observer};
use kerrlight_render::dynamics::{AngularVelocity, Axis};
use rand::{RngExt, SeedableRng};
use rand_distr::StandardNormal;
use rand_pcg::Pcg64;

mod beside_births;
mod beside_prior;
mod mirror_solution;

/// A parameter that is known to lie between two values.
pub(super) fn uniform(parameter: Parameter, low: f64, high: f64) -> Free {
    Free { parameter, prior: Prior::Uniform { low, high } }
}

/// A direction to the observer of which nothing is known.
pub(super) const ANY_INCLINATION: Free =
    Free { parameter: Parameter::Inclination, prior: Prior::Isotropic { low: 0.0, high: PI } };

fn model(law: Law) -> GeometryModel {
    // Rays that stay where gas on circular orbits is slower than light: beyond, weights have a kink.
    let at = |k: usize| {
        let (sin, cos) = (0.7 * k as f64).sin_cos();
        ((7.0 + 0.15 * k as f64) * cos, (7.0 + 0.15 * k as f64) * sin)
    };
    let (x, y) = (0..30).map(at).unzip();
    GeometryModel {
        x,
        y,
        ring: None,
        parts: None,
        observer_radius: None,
        region: Region { r_min: 0.0, r_max: 17.0, z_width: f64::INFINITY },
        order: 12,
        split: 1,
        slow_light: true,
        redshift: Some(Redshift { power: 2.5 }),
        law,
        axis: Axis::new([0.1, -0.2, 1.0]).unwrap(),
        motion: Motion {
            velocity: AngularVelocity::Keplerian { drag: 0.0 },
            reference: 3.0,
            injection: None,
            times: vec![0.0, 9.0, 30.0],
        },
        jy: 0.3,
        polarization: None,
        seen: Observable::Images,
    }
}

fn parameters(blobs: Blobs) -> (Blobs, Vec<f64>) {
    let mut parameters = vec![0.0; Representation::parameters(&blobs)];
    blobs.initialise(5, &mut parameters);
    (blobs, parameters)
}

#[test]
fn exact_position_angle_turns_the_spin_from_north_to_east() {
    let plain = Geometry::new(0.5, 1.0);
    let turned = plain.with(Parameter::PositionAngle, FRAC_PI_2);
    // East is left: what the spin points at lies at negative x.
    let place = |geometry: Geometry, x: f64, y: f64| model::turn(&geometry)([x, y]);
    let [alpha, beta] = place(turned, -3.0, 0.0);
    assert!(alpha.abs() < 1e-15 && (beta - 3.0).abs() < 1e-15, "{alpha} {beta}");
    assert_eq!(place(plain, 1.0, 2.0), [1.0, 2.0]);
}

#[test]
fn exact_geometries_out_of_range_are_refused() {
    let geometry = Geometry::new(1.0, 0.5);
    assert_eq!(geometry.checked().unwrap_err().field(), Some("spin"));
    let error = model(Law::CircularOrbits).sightlines(&geometry).unwrap_err();
    assert!(error.to_string().contains("-0.999"), "{error}");
}

/// A screen of so many pixels over 20 M, in single precision as fits have it.
fn screen(side: usize, frames: usize) -> GeometryModel {
    let at = |k: usize| 20.0 * ((k as f64 + 0.5) / side as f64 - 0.5);
    let (x, y) = (0..side * side).map(|k| (at(k % side), -at(k / side))).unzip();
    let mut model = model(Law::CircularOrbits);
    model.region = Region { r_min: 3.0, r_max: 9.0, z_width: 4.0 };
    model.axis = Axis::new([0.0, 0.0, 1.0]).unwrap();
    model.motion.reference = 0.0;
    model.motion.times = (0..frames).map(|k| 120.0 * k as f64 / frames as f64).collect();
    GeometryModel { x, y, order: 4, redshift: Some(Redshift { power: 2.0 }), ..model }
}

fn spot(at: [f64; 3]) -> f64 {
    let square = (at[0] - 5.5).powi(2) + at[1].powi(2) + at[2].powi(2);
    (-0.5 * square / 0.49).exp()
}

/// Pixels of the ring are means over their rays.
#[test]
fn exact_pixels_of_the_ring_are_means_over_rays() {
    let mut model = model(Law::CircularOrbits);
    // The third pixel is far from the critical curve.
    (model.x, model.y) = (vec![5.3, -3.9, 9.0], vec![0.2, 3.4, 0.0]);
    let ring = RingRays { count: 8, spacing: 0.5, lattice: 3 };
    let geometry = Geometry::new(0.3, 0.9);
    let (blobs, parameters) = parameters(Blobs::STEADY);
    let (representation, parameters) = (&blobs, &parameters[..]);
    let field = Field { representation, parameters, axis: model.axis, occupancy: None };
    let inclination = Inclination::from_radians(0.9).unwrap();
    let (hole, observer) = (Kerr::new(0.3).unwrap(), Observer::at_infinity(inclination));
    let rays = PixelRays::new(ring, &hole, &observer, [&model.x, &model.y], |place| place);
    assert_eq!(rays.starts, [0, 8, 16, 17]);
    let (x, y) = rays.places.iter().map(|[x, y]| (*x, *y)).unzip();
    let single = GeometryModel { x, y, ..model.clone() };
    let all = images(&single.forward(&geometry).unwrap(), field);
    let ringed = GeometryModel { ring: Some(ring), ..model };
    let seen = images(&ringed.forward(&geometry).unwrap(), field);
    for frame in 0..3 {
        for (pixel, range) in [0..8, 8..16, 16..17].into_iter().enumerate() {
            let of_rays = &all[frame * 17..][range.clone()];
            let mean = of_rays.iter().sum::<f64>() / range.len() as f64;
            let found = seen[frame * 3 + pixel];
            assert!((found - mean).abs() < 1e-8 * (1.0 + mean), "{frame} {pixel}");
        }
    }
}

/// The search for the geometry of a hot spot in twelve frames.
fn of_hot_spot<'a>(
    model: &'a GeometryModel,
    free: &'a [Free],
    terms: &'a [Weighted<'a, f32>],
) -> GeometryProblem<'a, f32> {
    GeometryProblem {
        memory: Default::default(),
        model,
        known: Geometry::new(0.0, 0.5),
        free,
        frames: &[0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11],
        terms,
        half_width: 9.0,
        upper: 3.0,
        flux: None,
        penalties: &[],
        change: Change::NONE,
        gaussian: None,
        scale: 1.0,
        effort: Effort { nodes: 16, degree: Degree::Linear, patience: StopRule::looking(30) },
    }
}

/// Steps end at the bounds of an inclination, but at a pole only where a position angle is known: beyond it they go on.
#[test]
fn exact_bounds_shorten_steps() {
    let model = screen(20, 12);
    let part = |low: f64, turns: f64| {
        let free = [
            uniform(Parameter::Inclination, low, 1.5),
            uniform(Parameter::PositionAngle, -PI * turns, PI * turns),
        ];
        let problem = of_hot_spot(&model, &free, &[]);
        let from = Geometry::new(0.0, low + 0.01);
        problem.part_within(&from, &[-1.0, 0.0]) * Parameter::Inclination.scale()
    };
    assert!((part(0.05, 1.0) - 0.01).abs() < 1e-12);
    assert!((part(0.0, 0.5) - 0.01).abs() < 1e-12);
    assert_eq!(part(0.0, 1.0), Parameter::Inclination.scale());
}

/// Images of a volume through pixels that are means leave residuals through single rays that point all the way to the means.
#[test]
fn exact_residuals_point_to_the_model_that_made_the_data() {
    let (model, side) = (screen(20, 12), 20);
    let means = GeometryModel { parts: Some((1.0, 2)), ..model.clone() };
    let geometry = Geometry::new(0.6, 1.05);
    let effort = Effort { nodes: 12, degree: Degree::Linear, patience: StopRule::looking(30) };
    let volume: Vec<f64> = (0..12usize.pow(3)).map(|k| (0.37 * k as f64).sin().powi(2)).collect();
    let none: [Weighted<'_, f32>; 0] = [];
    let maker = GeometryProblem { effort, ..of_hot_spot(&means, &[], &none) };
    let data = maker.images(geometry, &maker.voxels(), &volume).unwrap();
    let sigma = 1e-2 * f64::from(data.iter().fold(0.0f32, |most, x| most.max(*x)));
    let term = ImageTerm::new(data, side * side, sigma).unwrap();
    let terms = [Weighted { weight: 4800.0, term: &term as &dyn FrameTerm<f32> }];
    let single = GeometryProblem { effort, ..of_hot_spot(&model, &[], &terms) };
    let right = GeometryProblem { effort, ..of_hot_spot(&means, &[], &terms) };
    let chi2 = |problem: &GeometryProblem<'_, f32>| {
        let images = problem.images(geometry, &problem.voxels(), &volume).unwrap();
        let of = |(frame, image): (usize, &[f32])| {
            let residuals = term.residuals(frame, image);
            residuals.iter().map(|r| r.value.powi(2)).sum::<f64>()
        };
        images.chunks_exact(side * side).enumerate().map(of).sum::<f64>()
    };
    let at = Estimate { geometry, x: volume.clone(), chi2: chi2(&single), value: 0.0 };
    assert!(chi2(&right) < 1e-6 * at.chi2);
    let gain = single.gain(&at, &right).unwrap();
    assert!((gain / (0.5 * at.chi2) - 1.0).abs() < 1e-4, "{gain} {}", at.chi2);
    // Nothing points away from the right model.
    assert!(right.gain(&at, &single).unwrap() < 1e-4 * gain);
    assert_eq!(single.gain(&at, &single).unwrap(), 0.0);
}

/// Steps lead from nearby to the best geometry, with images of other rays and noise of 1 %: the errors hold what is left.
#[test]
fn exact_steps_lead_to_the_best_geometry() {
    let (mut model, side) = (screen(20, 12), 20);
    model.ring = Some(RingRays { count: 8, spacing: 1.0, lattice: 0 });
    let truth = Geometry::new(0.6, 1.05).with(Parameter::PositionAngle, 0.7);
    let forward: ForwardModel<f32> = model.seen_along(5).forward(&truth).unwrap();
    let wide = |[x, y, z]: [f64; 3]| {
        let square = (x - 5.5).powi(2) + y * y + z * z;
        (-0.5 * square / 1.44).exp()
    };
    let movie = forward.movie_of(model.axis, &wide, &mut Batch::default());
    let brightest = movie.iter().fold(0.0f64, |most, x| most.max(*x));
    let sigma = 1e-2 * brightest;
    let mut random = Pcg64::seed_from_u64(3);
    let mut noise = || -> f64 { random.sample(StandardNormal) };
    let data: Vec<f32> = movie.iter().map(|x| (x + sigma * noise()) as f32).collect();
    let count = data.len() as f64;
    let term = ImageTerm::new(data, side * side, sigma).unwrap();
    let terms = [Weighted { weight: count, term: &term as &dyn FrameTerm<f32> }];
    let free = [ANY_INCLINATION, uniform(Parameter::PositionAngle, -PI, PI)];
    let patience = StopRule { looking: 60, rounds: 1, settling: 200 };
    let effort = Effort { nodes: 18, degree: Degree::Linear, patience };
    let problem = GeometryProblem { known: truth, effort, ..of_hot_spot(&model, &free, &terms) };
    let away = truth.with(Parameter::Inclination, 1.13).with(Parameter::PositionAngle, 0.6);
    let start = problem.solve(away).unwrap();
    let found = problem.polish(&start).unwrap();
    assert!(found.best.value < start.value);
    let further = found.further.unwrap();
    for free in &free {
        let step = further.get(free.parameter) - found.best.geometry.get(free.parameter);
        assert!(step.abs() < 0.01, "{step}");
    }
    let sigma: Vec<f64> = [0, 3].iter().map(|k| found.covariance[*k].sqrt()).collect();
    let apart: Vec<f64> = free
        .iter()
        .map(|free| (found.best.geometry.get(free.parameter) - truth.get(free.parameter)).abs())
        .collect();
    assert!(apart.iter().all(|apart| *apart < 0.01), "{apart:?} {sigma:?}");
    assert!(sigma.iter().all(|sigma| *sigma > 1e-4 && *sigma < 0.01), "{sigma:?}");
    // The bowl beneath the ripples, along other rays too, has its middle there, within what it says.
    let other_model = model.seen_along(2);
    let other = GeometryProblem { model: &other_model, ..problem };
    let mut surroundings = problem.around(&found).unwrap().unwrap();
    surroundings.look(&other).unwrap();
    let envelope = surroundings.envelope(&problem, 1.0).unwrap();
    for (k, free) in free.iter().enumerate() {
        let apart = envelope.geometry.get(free.parameter) - truth.get(free.parameter);
        let sigma = envelope.covariance[3 * k].sqrt();
        assert!(apart.abs() < 3.0 * sigma && sigma < 0.02, "{:?}: {apart} {sigma}", free.parameter);
    }
    assert!(envelope.ripple >= 0.0);
}

/// Images of a hot spot with noise of 1 % of the brightest pixel: spin, inclination and position angle from starts all over.
#[test]
fn exact_geometry_of_a_hot_spot_is_found_from_everywhere() {
    let (model, side) = (screen(20, 12), 20);
    let truth = Geometry::new(0.6, 1.05).with(Parameter::PositionAngle, 0.7);
    let forward: ForwardModel<f32> = model.forward(&truth).unwrap();
    let movie = forward.movie_of(model.axis, &spot, &mut Batch::default());
    let brightest = movie.iter().fold(0.0f64, |most, x| most.max(*x));
    let sigma = 1e-2 * brightest;
    let noise = |k: usize| sigma * (1.7 * k as f64 * (k as f64 * 0.37).sin()).sin() * 2f64.sqrt();
    let data: Vec<f32> = movie.iter().enumerate().map(|(k, x)| (x + noise(k)) as f32).collect();
    let count = data.len() as f64;
    let term = ImageTerm::new(data, side * side, sigma).unwrap();
    let terms = [Weighted { weight: count, term: &term as &dyn FrameTerm<f32> }];
    let free = [
        uniform(Parameter::Spin, -0.95, 0.95),
        ANY_INCLINATION,
        uniform(Parameter::PositionAngle, -PI, PI),
    ];
    let problem = of_hot_spot(&model, &free, &terms);
    let apart = |geometry: &Geometry| {
        free.map(|Free { parameter, .. }| {
            parameter.difference(geometry.get(parameter), truth.get(parameter)).abs()
        })
    };
    let mut ends = Vec::new();
    for (k, start) in problem.starts(3).into_iter().enumerate() {
        let how = Exploration { width: 1.5, trials: 400, seed: k as u64 };
        let found = problem.explore(start, None, &how, &mut |_, _| true).unwrap().unwrap();
        let [_, inclination, angle] = apart(&found.best.geometry);
        assert!(inclination < 0.2 && angle < 0.2, "{k}: {:?}", found.best.geometry);
        if k == 0 {
            let again = problem.explore(start, None, &how, &mut |_, _| true).unwrap().unwrap();
            assert_eq!(found.best.geometry, again.best.geometry);
        }
        ends.push(found.best);
    }
    // Voxels of 1.2 M represent a spot of 0.7 M only so well.
    let best = ends.iter().min_by(|a, b| a.value.total_cmp(&b.value)).unwrap();
    assert!(apart(&best.geometry).iter().all(|apart| *apart < 0.1), "{:?}", best.geometry);
    let how = Exploration { width: 1.0, trials: 99, seed: 1 };
    assert!(problem.explore(truth, None, &how, &mut |_, _| false).unwrap().is_none());
}
