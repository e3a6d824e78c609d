use super::*;
use crate::{Inclination, Outcome, Path, Tracer, Want};

fn observer(degrees: f64, radius: f64) -> Observer {
    Observer::at_radius(Inclination::from_degrees(degrees).unwrap(), radius).unwrap()
}

fn grid(n: usize, half: f64) -> (Vec<f64>, Vec<f64>) {
    let at = |k: usize| -half + 2.0 * half * k as f64 / (n - 1) as f64;
    (0..n * n).map(|k| (at(k % n), at(k / n))).unzip()
}

/// Largest errors of r (relative), θ, azimuth and delay (relative to max(1, ·)) against the
/// Runge–Kutta tracer at its tightest, over every `stride`-th ray.
fn compare(
    spin: f64,
    degrees: f64,
    radius: f64,
    samples: &Samples,
    rays: (&[f64], &[f64]),
    stride: usize,
) -> [f64; 4] {
    let hole = Kerr::new(spin).unwrap();
    let observer = observer(degrees, radius);
    let tracer = Tracer::new(1e-14).unwrap();
    let mut path = Path::new();
    let mut worst = [0.0f64; 4];
    for k in (0..rays.0.len()).step_by(stride) {
        let ray = observer.ray(&hole, rays.0[k], rays.1[k]).unwrap();
        tracer.trace(&hole, &ray, Want::ALL, &mut path);
        let found = samples.ray(k);
        assert_eq!(found.escapes, path.outcome() == Outcome::Escaped, "ray {k}");
        let step = found.mino_total / (found.radius.len() - 1) as f64;
        for j in 0..found.radius.len() {
            let expected = path.at(step * j as f64);
            let turn = (found.azimuth[j] - expected.azimuth) / std::f64::consts::TAU;
            // dφ = a dr/Δ and dt = (r² + a²) dr/Δ amplify errors of r at the horizon.
            let r = expected.radius();
            let amplified = 1.0 + r / (r - hole.horizon()).abs().max(1e-12);
            let misses = [
                (found.radius[j] / r - 1.0).abs(),
                (found.theta[j] - expected.theta()).abs(),
                (turn - turn.round()).abs() * std::f64::consts::TAU / amplified,
                (found.delay[j] - expected.delay).abs()
                    / (expected.delay.abs().max(1.0) * amplified),
            ];
            for (worst, miss) in worst.iter_mut().zip(misses) {
                assert!(!miss.is_nan(), "ray {k} ({}, {}), sample {j}", rays.0[k], rays.1[k]);
                *worst = worst.max(miss);
            }
        }
    }
    worst
}

/// The picture of the speed target, and others: other spins, poles, few and many samples.
#[test]
fn code_samples_agree_with_the_runge_kutta_tracer() {
    let cases = [
        (0.94, 60.0, 1000.0, 100),
        (0.0, 17.0, 100.0, 33),
        (-0.7, 90.0, 50.0, 64),
        (1e-9, 120.0, 1000.0, 7),
        (0.998, 0.0, 200.0, 50),
        (0.5, 180.0, 1000.0, 20),
    ];
    for (spin, degrees, radius, per_ray) in cases {
        let (alpha, beta) = grid(24, 8.0);
        let mut samples = Samples::default();
        let hole = Kerr::new(spin).unwrap();
        samples.trace(&hole, &observer(degrees, radius), &alpha, &beta, per_ray).unwrap();
        let worst = compare(spin, degrees, radius, &samples, (&alpha, &beta), 1);
        assert!(worst.iter().all(|w| *w < 1e-9), "a = {spin}, i = {degrees}: {worst:?}");
    }
}

/// Every width computes the same, to rounding.
#[test]
fn exact_same_samples_at_every_width() {
    let hole = Kerr::new(0.94).unwrap();
    let observer = observer(60.0, 1000.0);
    let (alpha, beta) = grid(16, 8.0);
    let mut scalar = Samples::default();
    scalar.trace_at(Width::Scalar, &hole, &observer, &alpha, &beta, 40).unwrap();
    for width in [Width::Avx2, Width::Avx512] {
        if !width.available() {
            continue;
        }
        let mut wide = Samples::default();
        wide.trace_at(width, &hole, &observer, &alpha, &beta, 40).unwrap();
        for (a, b) in [
            (&scalar.radius, &wide.radius),
            (&scalar.theta, &wide.theta),
            (&scalar.azimuth, &wide.azimuth),
            (&scalar.delay, &wide.delay),
        ] {
            for (x, y) in a.iter().zip(b) {
                assert!((x - y).abs() < 1e-10 * x.abs().max(1.0), "{width:?}: {x} {y}");
            }
        }
    }
}

#[test]
fn rays_that_cannot_be_are_refused() {
    let hole = Kerr::new(0.5).unwrap();
    let mut samples = Samples::default();
    let far = Observer::at_infinity(Inclination::from_degrees(60.0).unwrap());
    assert!(samples.trace(&hole, &far, &[1.0], &[1.0], 10).is_err());
    let near = observer(60.0, 100.0);
    assert!(samples.trace(&hole, &near, &[95.0], &[1.0], 10).is_err());
    assert!(samples.trace(&hole, &near, &[f64::NAN], &[1.0], 10).is_err());
    assert!(samples.trace(&hole, &near, &[1.0], &[1.0], 1).is_err());
    assert!(samples.trace(&hole, &near, &[1.0], &[], 10).is_err());
    assert!(samples.trace(&hole, &near, &[], &[], 10).is_ok());
}
