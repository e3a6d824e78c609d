//! Places where derivatives and footprints could break: axes, the equator, spins next to ±1, screen
//! coordinates of 0 and of a million, rays next to the critical curve.

use kerrlight_geodesic::derivatives::{self, Gradient};
use kerrlight_geodesic::{Inclination, Kerr, Observer, Placement, Request, footprint};

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
    let inclination = Inclination::from_degrees(degrees).unwrap();
    [Observer::at_infinity(inclination), Observer::at_radius(inclination, 1e9).unwrap()]
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
                for k in rays.values.samples.of(ray) {
                    let g = &rays.samples;
                    let all = [g.mino_time[k], g.radius[k], g.theta[k], g.azimuth[k], g.delay[k]];
                    assert_eq!(defined(&all), 5, "{place} {outcome:?}: sample {k} {all:?}");
                }
                for k in rays.values.crossings.of(ray) {
                    let g = &rays.crossings;
                    let all = [g.mino_time[k], g.radius[k], g.theta[k], g.azimuth[k], g.delay[k]];
                    assert_eq!(defined(&all), 5, "{place} {outcome:?}: crossing {k} {all:?}");
                }
            }
        }
    }
    println!("{} of {} derivatives are numbers", count[1], count[0]);
}

#[test]
fn exact_footprints_are_numbers_everywhere() {
    let (alpha, beta) = screen();
    for (spin, degrees) in SPINS.iter().flat_map(|a| DEGREES.iter().map(move |i| (*a, *i))) {
        let hole = Kerr::new(spin).unwrap();
        for observer in observers(degrees) {
            let beams = footprint::of_screen(&hole, &observer, &alpha, &beta, 1e-10, 2).unwrap();
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
}
