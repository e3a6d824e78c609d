//! Places where derivatives and footprints could break: axes, the equator, spins next to ±1, screen
//! coordinates of 0 and of a million, rays next to the critical curve.

use crate::{at_infinity, at_radius, inclination};
use kerrlight_geodesic::derivatives::{self, Gradient};
use kerrlight_geodesic::{
    Double, Inclination, Integrator, Kerr, Observer, Outcome, Path, Placement, Quantities,
    RayTable, Request, footprint, trace_series,
};

const SPINS: [f64; 9] =
    [0.0, 1e-12, -1e-6, 0.5, -0.94, 0.998, 1.0 - 1e-12, -1.0 + 1e-9, 1.0 - f64::EPSILON / 2.0];
const DEGREES: [f64; 9] = [0.0, 1e-9, 0.3, 17.0, 60.0, 90.0, 90.0 + 1e-9, 135.0, 180.0];
const SCREEN: [f64; 13] = [
    0.0,
    -0.0,
    1e-12,
    -1e-3,
    0.5,
    -2.0,
    3.3,
    5.196152422706632,
    -5.19615242270663,
    7.0,
    -30.0,
    1e3,
    1e6,
];

fn screen() -> (Vec<f64>, Vec<f64>) {
    SCREEN.iter().flat_map(|alpha| SCREEN.iter().map(move |beta| (*alpha, *beta))).unzip()
}

fn observers(degrees: f64) -> [Observer; 2] {
    [at_infinity(degrees), at_radius(degrees, 1e9)]
}

fn defined(gradients: &[Gradient]) -> usize {
    gradients.iter().filter(|g| g.to_array().iter().all(|x| x.is_finite())).count()
}

#[test]
fn exact_derivatives_are_numbers_everywhere() {
    let (alpha, beta) = screen();
    let request = Request {
        crossings: 3,
        samples: Placement::GaussLegendre { points: 3, from: 4.0, to: 30.0 },
        azimuth: true,
        time: true,
        weight: true,
        ..Request::default()
    };
    let mut count = [0; 2];
    for (spin, degrees) in SPINS.iter().flat_map(|a| DEGREES.iter().map(move |i| (*a, *i))) {
        let hole = Kerr::new(spin).unwrap();
        for observer in observers(degrees) {
            let rays =
                derivatives::trace(&hole, &observer, &alpha, &beta, 1e-10, &request).unwrap();
            for g in [&rays.crossings, &rays.samples] {
                for column in [&g.mino_time, &g.radius, &g.theta, &g.azimuth, &g.delay, &g.weight] {
                    count[0] += column.len();
                    count[1] += defined(column);
                }
            }
            for (ray, outcome) in rays.values.outcome.iter().enumerate() {
                let place = format!("a {spin} i {degrees} ({}, {})", alpha[ray], beta[ray]);
                let values = &rays.values;
                for (kind, points, g) in [
                    ("sample", &values.samples, &rays.samples),
                    ("crossing", &values.crossings, &rays.crossings),
                ] {
                    for k in points.of(ray) {
                        let all =
                            [g.mino_time[k], g.radius[k], g.theta[k], g.azimuth[k], g.delay[k]];
                        assert_eq!(defined(&all), 5, "{place} {outcome:?}: {kind} {k} {all:?}");
                    }
                }
            }
        }
    }
    println!("{} of {} derivatives are numbers", count[1], count[0]);
}

#[test]
fn exact_footprints_are_numbers_everywhere() {
    let (alpha, beta) = screen();
    let (mut rays, mut arrived) = (0, 0);
    for (spin, degrees) in SPINS.iter().flat_map(|a| DEGREES.iter().map(move |i| (*a, *i))) {
        let hole = Kerr::new(spin).unwrap();
        for observer in observers(degrees) {
            let beams = footprint::of_screen(&hole, &observer, &alpha, &beta, 1e-10, 2).unwrap();
            rays += beams.sky.len();
            arrived += beams.sky.iter().flatten().count();
            for (ray, sky) in beams.sky.iter().enumerate() {
                let place = format!("a {spin} i {degrees} ({}, {})", alpha[ray], beta[ray]);
                if let Some(sky) = sky {
                    let ellipse = sky.ellipse();
                    let length = sky.direction.iter().map(|x| x * x).sum::<f64>().sqrt();
                    assert!((length - 1.0).abs() < 1e-8, "{place}: {sky:?}");
                    assert!(ellipse.semi_major.is_finite(), "{place}: {sky:?}");
                    assert!(ellipse.semi_minor <= ellipse.semi_major * (1.0 + 1e-12), "{place}");
                }
                for disc in beams.of(ray) {
                    assert!(disc.ellipse().semi_major.is_finite(), "{place}: {disc:?}");
                }
            }
        }
    }
    // Seven in ten escape.
    assert!(2 * arrived > rays, "{arrived} of {rays}");
}

/// Samples of one ray with their errors; everything that has an outcome is a number.
fn sampled(
    integrator: Integrator,
    (hole, observer): (&Kerr, &Observer),
    [alpha, beta]: [f64; 2],
) -> RayTable {
    let samples = Request::samples(Placement::MinoTime(7));
    let request = Request { crossings: 3, uncertainty: true, weight: true, ..samples };
    let rays = integrator
        .trace(hole, observer, &[alpha], &[beta], 1e-12, &request)
        .expect("a ray arrives");
    if !rays.outcome[0].is_unresolved() {
        let place = format!("{integrator:?} {hole:?} {observer:?} ({alpha}, {beta})");
        assert!(rays.mino_total[0].is_finite(), "{place}");
        for points in [&rays.samples, &rays.crossings] {
            let columns = [&points.radius, &points.theta, &points.azimuth, &points.delay];
            let all = columns.into_iter().chain([&points.mino_time, &points.weight]).flatten();
            assert!(all.copied().all(f64::is_finite), "{place}: {points:?}");
        }
    }
    rays
}

/// A ray that escapes is back at its observer's radius.
fn returns(rays: &RayTable, radius: f64, context: &str) {
    let (last, error) = (rays.samples.radius[6], rays.uncertainty[0].radius);
    let miss = (last / radius - 1.0).abs();
    assert!(miss <= 1e-6_f64.min(error + 1e-14), "{context}: {last} ± {error}");
}

const METHODS: [Integrator; 3] =
    [Integrator::TaylorMino, Integrator::Elliptic, Integrator::Dop853Mino];

/// At the horizon of an extremal hole Δ = (r − 1)² is that of the last float outside, as everywhere else.
#[test]
fn exact_momenta_at_an_extremal_horizon_are_numbers() {
    let observer = at_radius(90.0, 1e9);
    let request = Request { momentum: true, ..Request::samples(Placement::MinoTime(5)) };
    for spin in [1.0, -1.0] {
        let hole = Kerr::new(spin).unwrap();
        let rays = Integrator::TaylorMino
            .trace(&hole, &observer, &[-2.0 * spin], &[0.0], 1e-12, &request)
            .unwrap();
        let momenta = &rays.samples.momentum;
        assert!(momenta.len() == 5 && momenta.iter().flatten().all(|p| p.is_finite()));
    }
}

/// Turns 2e-13 M outside the horizon of an extremal hole. Its time is 2 ∫ dw/√W over the roots of W in 60 digits, and
/// after it there would be one crossing more within 0.01 M⁻¹.
#[test]
fn exact_crossings_are_those_before_the_end() {
    let (hole, inclination) = (Kerr::new(1.0).unwrap(), 1.8968141346913256);
    let observer = Observer::at_infinity(Inclination::from_radians(inclination).unwrap());
    let (alpha, beta) = (-2.111207338568873, -0.977817764618162);
    let mut resolved = 0;
    for integrator in METHODS {
        let rays = sampled(integrator, (&hole, &observer), [alpha, beta]);
        if !rays.outcome[0].is_unresolved() {
            resolved += 1;
            assert_eq!((rays.outcome[0], rays.crossing_count[0]), (Outcome::Escaped, 32));
            assert!((rays.mino_total[0] / 47.3264759353452 - 1.0).abs() < 1e-6);
        }
    }
    assert!(resolved > 1, "{resolved} of 3");
}

/// λ ≈ 2a around extremal holes: every number is one, and fate and radii are those of 28 digits.
#[test]
fn exact_rays_on_the_straight_part_of_an_extremal_critical_curve_are_numbers() {
    let betas = [-0.5528916854514749, 0.8994698741176206, 1.3246097831865098, 1.7547873481341332];
    let distances = [0.0, -4e-16, 5e-16, -3e-14, 1.6e-14, 3.3775e-13, 9e-13];
    let (mut resolved, mut returned) = (0, 0);
    for (beta, distance) in betas.iter().flat_map(|b| distances.iter().map(move |d| (*b, *d))) {
        let spin = if beta > 1.0 { -1.0 } else { 1.0 };
        let hole = Kerr::new(spin).unwrap();
        let alpha = -2.0 * spin * (1.0 + distance);
        let [spin, wide_alpha, wide_beta] = [spin, alpha, beta].map(Double::from);
        let wide = Observer::at_infinity(inclination(90.0).widen());
        let ray = wide.ray(&Kerr::from_spin(spin).unwrap(), wide_alpha, wide_beta).unwrap();
        let mut truth = Path::empty();
        trace_series(1e-24, &Kerr::from_spin(spin).unwrap(), &ray, Quantities::POLAR, &mut truth)
            .unwrap();
        for integrator in METHODS {
            let rays = sampled(integrator, (&hole, &at_infinity(90.0)), [alpha, beta]);
            let context = format!("{integrator:?} ({alpha}, {beta})");
            if !rays.outcome[0].is_unresolved() {
                resolved += 1;
                assert_eq!(rays.outcome[0], truth.outcome(), "{context}");
                for k in rays.samples.of(0) {
                    let at = truth.at(Double::from(rays.samples.mino_time[k]));
                    let miss = (rays.samples.radius[k] * at.inverse_radius.hi - 1.0).abs();
                    assert!(miss <= 10.0 * rays.uncertainty[0].radius, "{context}: {k} {miss:e}");
                }
            }
            let rays = sampled(integrator, (&hole, &at_radius(90.0, 200.0)), [alpha, beta]);
            if rays.outcome[0] == Outcome::Escaped {
                returned += 1;
                returns(&rays, 200.0, &context);
            }
        }
    }
    assert!(resolved > 60 && returned > 30, "{resolved} resolved, {returned} returned, of 84");
}

/// The way out to a far observer takes less Mino time than that of a near-critical turning point is known to.
#[test]
fn exact_near_critical_rays_return_to_far_observers() {
    let mut returned = 0;
    for (spin, degrees) in [(0.0, 17.0), (0.5, 1.0), (-0.7, 60.0), (0.998, 90.0)] {
        let hole = Kerr::new(spin).unwrap();
        let screen = at_infinity(degrees);
        for k in 0..4 {
            let (y, x) = (0.4 + 1.6 * f64::from(k)).sin_cos();
            let falls = |b: f64| screen.ray(&hole, b * x, b * y).unwrap().potential.captures();
            let (mut inside, mut outside) = (0.0, 12.0);
            for _ in 0..60 {
                let middle = 0.5 * (inside + outside);
                *(if falls(middle) { &mut inside } else { &mut outside }) = middle;
            }
            for radius in [1e6, 1e9, 1e12, 1e20, 1e30] {
                let far = at_radius(degrees, radius);
                for integrator in METHODS {
                    let rays = sampled(integrator, (&hole, &far), [outside * x, outside * y]);
                    let context = format!("{integrator:?} a = {spin}, {radius}, {k}");
                    if rays.outcome[0] == Outcome::Escaped {
                        returned += 1;
                        returns(&rays, radius, &context);
                    }
                }
            }
        }
    }
    assert!(returned > 120, "{returned} of 240");
    let error = Observer::at_radius(inclination(60.0), 1e300).unwrap_err().to_string();
    assert_eq!(error, "observer radius = 1e300 is not allowed: above 2 and at most 1e30 (M)");
}
