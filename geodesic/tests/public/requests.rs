//! Requests bring weights that integrate, equidistant samples, momenta that are null, and nothing
//! that was not requested.

use crate::{at_infinity, at_radius};
use kerrlight_geodesic::{
    Error, Integrator, Kerr, Observer, Outcome, Path, Placement, Points, Quantities, RayTable,
    Request, Tracer,
};

fn everything(samples: Placement) -> Request {
    Request {
        crossings: 5,
        samples,
        azimuth: true,
        time: true,
        momentum: true,
        weight: true,
        uncertainty: true,
    }
}

fn trace(spin: f64, observer: &Observer, at: [f64; 2], request: &Request) -> RayTable {
    let hole = Kerr::new(spin).unwrap();
    let ([alpha], [beta]) = ([[at[0]]], [[at[1]]]);
    Integrator::TaylorMino.trace(&hole, observer, &alpha, &beta, 1e-13, request).unwrap()
}

/// ∫ f ds over the samples.
fn integral(points: &Points, f: impl Fn(usize) -> f64) -> f64 {
    (0..points.len()).map(|k| points.weight[k] * f(k)).sum()
}

/// A radial ray without spin has dr = ±ds: the weights between two radii add up to their
/// difference, and integrate powers of r. In Mino time r = r₂/(1 + …) is a rational function, so
/// that the rule converges geometrically.
#[test]
fn exact_gauss_legendre_weights_on_radial_rays() {
    let (from, to) = (3.0, 30.0);
    let misses = [4, 8, 16, 24].map(|points| {
        let request = everything(Placement::GaussLegendre { points, from, to });
        let table = trace(0.0, &at_infinity(50.0), [0.0, 0.0], &request);
        let samples = &table.samples;
        assert_eq!((table.outcome[0], samples.len()), (Outcome::Captured, points));
        let length = integral(samples, |_| 1.0) - (to - from);
        let square = integral(samples, |k| samples.radius[k].powi(-2)) - (1.0 / from - 1.0 / to);
        [length, square]
    });
    for pair in misses.windows(2) {
        assert!(pair[1][0].abs() < 0.1 * pair[0][0].abs() + 1e-12, "{misses:?}");
        // ∫dr/r² is the Mino time itself, a constant in it: exact by every rule.
        assert!(pair[0][1].abs() < 1e-13, "{misses:?}");
    }
    assert!(misses[3][0].abs() < 1e-10, "{misses:?}");
}

/// The affine length of a Schwarzschild ray between two radii, by its own energy equation
/// (dr/ds)² = 1 − b²/r² (1 − 2/r), integrated here from its turning point: both legs count.
#[test]
fn exact_gauss_legendre_weights_on_both_legs() {
    let (b, to) = (8.0f64, 20.0);
    let request = everything(Placement::GaussLegendre { points: 40, from: 1.0, to });
    let table = trace(0.0, &at_infinity(90.0), [b, 0.0], &request);
    let turning = table.turning_radius[0];
    // r = r₀ + x² takes the root away: dr = 2x dx.
    let slope = |x: f64| {
        let r = turning + x * x;
        2.0 * x / (1.0 - b * b / (r * r) * (1.0 - 2.0 / r)).sqrt()
    };
    let top = (to - turning).sqrt();
    let rule = kerrlight_geodesic::quadrature::gauss_legendre(60);
    let leg: f64 = rule.iter().map(|(x, w)| w * top * slope(top * x)).sum();
    let found = integral(&table.samples, |_| 1.0);
    assert!((found / (2.0 * leg) - 1.0).abs() < 1e-11, "{found} {leg}");
}

/// On a spinning hole, where Σ depends on θ: the length between two radii does not depend on
/// the rule, and samples on the equator alone have Σ = r².
#[test]
fn exact_gauss_legendre_weights_converge_around_a_spinning_hole() {
    for (degrees, at) in [(60.0, [-5.0, 4.0]), (90.0, [3.0, 0.0]), (17.0, [1.0, 1.0])] {
        let length = |points: usize| {
            let request = everything(Placement::GaussLegendre { points, from: 2.5, to: 40.0 });
            integral(&trace(0.9, &at_infinity(degrees), at, &request).samples, |_| 1.0)
        };
        let best = length(64);
        let misses = [8, 16, 48].map(|points| (length(points) / best - 1.0).abs());
        assert!(misses[1] < 0.1 * misses[0] + 1e-12, "{misses:?}");
        assert!(misses[2] < 1e-10, "{misses:?}");
    }
}

/// Equidistant samples are the trapezoidal rule from end to end, for a finite observer: its
/// error falls with the square of their distance. A radial ray from r_o to the horizon has
/// length r_o − r₊.
#[test]
fn exact_mino_time_weights_are_the_trapezoidal_rule() {
    let (r, hole) = (12.0, Kerr::new(0.0).unwrap());
    let miss = [51, 101, 201, 401].map(|points| {
        let request = everything(Placement::MinoTime(points));
        let table = trace(0.0, &at_radius(50.0, r), [0.0, 0.0], &request);
        assert!((table.samples.radius[0] / r - 1.0).abs() < 1e-13);
        integral(&table.samples, |_| 1.0) - (r - hole.horizon())
    });
    for pair in miss.windows(2) {
        assert!((pair[0] / pair[1] - 4.0).abs() < 0.05, "{miss:?}");
    }
    // Mino time itself, whatever the number of samples: ∫ds/Σ.
    for (spin, observer) in [(0.9, at_radius(60.0, 30.0)), (-0.5, at_radius(10.0, 8.0))] {
        let hole = Kerr::new(spin).unwrap();
        let table = trace(spin, &observer, [4.0, 2.0], &everything(Placement::MinoTime(7)));
        let samples = &table.samples;
        let inverse = |k: usize| 1.0 / hole.sigma(samples.radius[k], samples.theta[k].cos());
        assert!((integral(samples, inverse) / table.mino_total[0] - 1.0).abs() < 1e-13);
    }
}

/// The affine length between neighbours is the same: r itself on a radial ray without spin, and by
/// a dense Gauss–Legendre rule on a bent one.
#[test]
fn exact_path_length_samples_are_equidistant() {
    let (n, radius) = (9, 20.0);
    let request = everything(Placement::PathLength { points: n, radius });
    let table = trace(0.0, &at_infinity(30.0), [0.0, 0.0], &request);
    let step = (radius - 2.0) / n as f64;
    for (k, r) in table.samples.radius.iter().enumerate() {
        let expected = radius - step * (k as f64 + 0.5);
        assert!((r - expected).abs() < 1e-9, "{r} {expected}");
        assert!((table.samples.weight[k] - step).abs() < 1e-10);
    }
    let far = everything(Placement::PathLength { points: 4, radius: 1e6 });
    let samples = trace(0.0, &at_infinity(30.0), [0.0, 0.0], &far).samples;
    for (k, r) in samples.radius.iter().enumerate() {
        let expected = 1e6 - (1e6 - 2.0) / 4.0 * (k as f64 + 0.5);
        assert!((r / expected - 1.0).abs() < 1e-9, "{r} {expected}");
    }
    // A bent ray around a spinning hole: the length between samples by a rule of 200 nodes.
    let hole = Kerr::new(0.95).unwrap();
    let table = trace(0.95, &at_infinity(70.0), [-6.0, 3.0], &request);
    let dense = everything(Placement::GaussLegendre { points: 200, from: 1.0, to: radius });
    let whole = integral(&trace(0.95, &at_infinity(70.0), [-6.0, 3.0], &dense).samples, |_| 1.0);
    assert_eq!(table.samples.len(), n);
    for weight in &table.samples.weight {
        assert!((weight * n as f64 / whole - 1.0).abs() < 1e-10, "{weight} {whole}");
    }
    let ray = at_infinity(70.0).ray(&hole, -6.0, 3.0).unwrap();
    let mut path = Path::new();
    let tracer = Tracer::new(1e-13).unwrap();
    tracer.trace(&hole, &ray, Quantities::POLAR, &mut path);
    let rule = kerrlight_geodesic::quadrature::gauss_legendre(40);
    for pair in table.samples.mino_time.windows(2) {
        let length: f64 = rule
            .iter()
            .map(|(x, w)| {
                let p = path.at(pair[0] + (pair[1] - pair[0]) * x);
                w * (pair[1] - pair[0]) * hole.sigma(p.radius(), p.cos_theta())
            })
            .sum();
        assert!((length * n as f64 / whole - 1.0).abs() < 1e-9, "{length} {whole}");
    }
}

/// g^{μν} p_μ p_ν of Kerr, written out (Bardeen, Press & Teukolsky 1972, eq. 2.4).
fn norm(hole: &Kerr, r: f64, theta: f64, p: [f64; 4]) -> (f64, f64) {
    let (a, s) = (hole.spin(), theta.sin());
    let (sigma, delta) = (hole.sigma(r, theta.cos()), hole.delta(r));
    let area = (r * r + a * a).powi(2) - a * a * delta * s * s;
    let [t, pr, pt, phi] = p;
    let terms = [
        -area / (sigma * delta) * t * t,
        -4.0 * a * r / (sigma * delta) * t * phi,
        delta / sigma * pr * pr,
        pt * pt / sigma,
        (delta - a * a * s * s) / (sigma * delta * s * s) * phi * phi,
    ];
    (terms.iter().sum(), terms.iter().map(|x| x.abs()).sum())
}

#[test]
fn exact_null_momenta() {
    for integrator in [Integrator::TaylorMino, Integrator::Dop853Mino, Integrator::Rk45Mino] {
        for (spin, degrees) in [(0.0, 60.0), (0.94, 60.0), (-0.7, 20.0), (1.0, 90.0)] {
            let hole = Kerr::new(spin).unwrap();
            let alpha = [-6.0, 1.0, 8.0, 0.3, -2.0, 20.0];
            let beta = [2.0, 2.5, -3.0, -0.2, 6.0, 10.0];
            let request = everything(Placement::GaussLegendre { points: 6, from: 3.0, to: 60.0 });
            let observer = at_infinity(degrees);
            let table = integrator.trace(&hole, &observer, &alpha, &beta, 1e-12, &request).unwrap();
            assert!(table.samples.len() >= 36);
            for (ray, alpha) in alpha.iter().enumerate() {
                for k in table.samples.of(ray) {
                    let (points, p) = (&table.samples, table.samples.momentum[k]);
                    let (sum, size) = norm(&hole, points.radius[k], points.theta[k], p);
                    assert!(sum.abs() < 1e-9 * size, "{integrator:?} {sum:e} of {size}");
                    assert_eq!(p[0], -1.0);
                    let lambda = -alpha * degrees.to_radians().sin();
                    assert!((p[3] - lambda).abs() < 1e-13 * lambda.abs().max(1.0));
                }
            }
        }
    }
}

/// The photon flies towards the observer: between the turning point and the observer r grows along
/// its flight, p_r > 0; before it p_r < 0. At the observer p_θ = β, sign included (Bardeen 1973).
#[test]
fn exact_signs_of_momenta() {
    for (beta, degrees) in [(3.0, 60.0), (-3.0, 60.0), (3.0, 90.0), (-3.0, 120.0)] {
        let request = everything(Placement::MinoTime(6));
        let table = trace(0.9, &at_radius(degrees, 100.0), [7.0, beta], &request);
        assert_eq!(table.outcome[0], Outcome::Escaped);
        for (k, p) in table.samples.momentum.iter().enumerate() {
            assert_eq!(p[1] > 0.0, k < 3, "p_r of sample {k}");
        }
        let p_theta = table.samples.momentum[0][2];
        assert!((p_theta - beta).abs() < 1e-12, "p_θ = {p_theta}");
    }
    let request = everything(Placement::MinoTime(5));
    let captured = trace(0.9, &at_infinity(60.0), [1.0, 1.0], &request);
    assert!(captured.samples.momentum[..4].iter().all(|p| p[1] > 0.0));
}

/// A column that was not requested is empty, and what is requested is not changed by what is not.
#[test]
fn exact_columns_that_were_not_asked_for_are_empty() {
    let placement = Placement::MinoTime(4);
    let bare = Request { crossings: 2, samples: placement, ..Request::default() };
    let observer = at_infinity(60.0);
    let full = trace(0.9, &observer, [-6.0, 2.0], &everything(placement));
    let switches: [(&str, Request); 6] = [
        ("nothing", bare),
        ("azimuth", Request { azimuth: true, ..bare }),
        ("time", Request { time: true, ..bare }),
        ("momentum", Request { momentum: true, ..bare }),
        ("weight", Request { weight: true, ..bare }),
        ("uncertainty", Request { uncertainty: true, ..bare }),
    ];
    for (name, request) in switches {
        let table = trace(0.9, &observer, [-6.0, 2.0], &request);
        let (points, n) = (&table.samples, 4);
        let has = |on: bool| if on { n } else { 0 };
        assert_eq!((points.len(), points.theta.len(), points.mino_time.len()), (n, n, n));
        assert_eq!(points.azimuth.len(), has(request.azimuth), "{name}");
        assert_eq!(points.delay.len(), has(request.time), "{name}");
        assert_eq!(points.momentum.len(), has(request.momentum), "{name}");
        assert_eq!(points.weight.len(), has(request.weight), "{name}");
        assert_eq!(table.uncertainty.len(), usize::from(request.uncertainty), "{name}");
        assert!(table.crossings.weight.is_empty(), "a crossing stands for no piece of path");
        assert!(table.crossings.len() <= 2);
        for k in 0..n {
            assert!((points.radius[k] / full.samples.radius[k] - 1.0).abs() < 1e-11);
            assert!((points.theta[k] - full.samples.theta[k]).abs() < 1e-11);
        }
    }
    let nothing = trace(0.9, &observer, [-6.0, 2.0], &Request::default());
    assert!(nothing.samples.is_empty() && nothing.crossings.is_empty());
    assert!(nothing.crossing_count[0] > 0 && nothing.mino_total[0] > 0.0);
    // What a path was not asked for is exactly 0.
    let (hole, mut path) = (Kerr::new(0.9).unwrap(), Path::new());
    let ray = observer.ray(&hole, -6.0, 2.0).unwrap();
    Tracer::new(1e-11).unwrap().trace(&hole, &ray, Quantities::POLAR, &mut path);
    let point = path.at(0.4 * path.mino_total());
    assert_eq!((point.azimuth, point.delay), (0.0, 0.0));
}

/// Misuse is an error that names the field, its value and what is allowed.
#[test]
fn requests_out_of_range_are_named() {
    let hole = Kerr::new(0.5).unwrap();
    let observer = at_infinity(20.0);
    let attempt = |samples: Placement| -> Error {
        let request = Request::samples(samples);
        Integrator::TaylorMino.trace(&hole, &observer, &[1.0], &[1.0], 1e-9, &request).unwrap_err()
    };
    let cases = [
        (Placement::MinoTime(0), "samples = 0"),
        (Placement::MinoTime(2_000_000), "samples = 2000000"),
        (Placement::GaussLegendre { points: 20_000, from: 2.0, to: 3.0 }, "samples = 20000"),
        (Placement::GaussLegendre { points: 3, from: 3.0, to: 2.0 }, "to = 2"),
        (Placement::GaussLegendre { points: 3, from: f64::NAN, to: 2.0 }, "from = NaN"),
        (Placement::PathLength { points: 3, radius: -1.0 }, "radius of the sphere = -1"),
        (Placement::PathLength { points: 3, radius: f64::INFINITY }, "radius of the sphere = inf"),
    ];
    for (samples, text) in cases {
        let error = attempt(samples).to_string();
        assert!(error.contains(text) && error.contains("not allowed"), "{error}");
    }
}

/// A sphere inside the hole, or one that a ray misses, holds no samples; no ray has a number beyond
/// the last.
#[test]
fn regress_empty_pieces_and_paths() {
    for samples in [
        Placement::PathLength { points: 3, radius: 0.5 },
        Placement::GaussLegendre { points: 3, from: 0.1, to: 0.2 },
        Placement::GaussLegendre { points: 3, from: 2.0, to: 3.0 },
    ] {
        let table = trace(0.5, &at_infinity(20.0), [50.0, 1.0], &Request::samples(samples));
        assert!(table.samples.is_empty() && table.samples.of(0).is_empty());
        assert!(table.samples.of(1).is_empty() && table.samples.of(99).is_empty());
    }
    let path = Path::new();
    assert!(path.at(0.3).radius().is_nan() && path.uncertainty_at(0.3).radius.is_infinite());
    let mut path = Path::new();
    let hole = Kerr::new(0.5).unwrap();
    let ray = at_infinity(20.0).ray(&hole, 5.0, 5.0).unwrap();
    let tracer = Tracer::new(1e-9).unwrap();
    tracer.with_max_steps(0).trace(&hole, &ray, Quantities::ALL, &mut path);
    assert!(path.at(0.0).radius().is_nan());
    tracer.trace(&hole, &ray, Quantities::ALL, &mut path);
    let mut pieces = Vec::new();
    for [lo, hi] in [[3.0, 2.0], [f64::NAN, 2.0], [1.0, f64::NAN], [-1.0, 5.0], [0.0, 0.0]] {
        path.intervals_within(lo, hi, &mut pieces);
        assert!(pieces.is_empty());
    }
    path.intervals_within(0.0, f64::INFINITY, &mut pieces);
    assert_eq!(pieces.len(), 1);
    assert!(path.at(f64::NAN).mino_time.is_nan());
}

/// Every integrator fills the same columns with the same answers. Samples of captured rays may
/// end a relative 1e-8 outside the horizon, which shifts all of them by as little.
#[test]
fn code_all_integrators_agree() {
    let hole = Kerr::new(0.94).unwrap();
    let (alpha, beta) = ([-6.0, 1.0, 7.0, 4.5, 8.0], [2.0, 0.5, 0.0, -4.0, 7.0]);
    for degrees in [0.0, 60.0, 90.0] {
        let observer = at_radius(degrees, 100.0);
        let request = Request {
            crossings: 2,
            weight: true,
            uncertainty: true,
            ..Request::samples(Placement::MinoTime(12))
        };
        let trace = |integrator: Integrator| {
            integrator.trace(&hole, &observer, &alpha, &beta, 1e-13, &request).unwrap()
        };
        let expected = trace(Integrator::TaylorMino);
        for integrator in Integrator::ALL {
            let found = trace(*integrator);
            let context = format!("{} at {degrees}", integrator.name());
            assert_eq!(found.outcome, expected.outcome, "{context}");
            assert_eq!(found.crossing_count, expected.crossing_count, "{context}");
            for (a, b) in
                [(&found.crossings, &expected.crossings), (&found.samples, &expected.samples)]
            {
                assert_eq!(a.len(), b.len(), "{context}");
                for k in 0..a.len() {
                    assert!((a.mino_time[k] - b.mino_time[k]).abs() < 1e-7, "{context}");
                    // The end of a captured ray lies where each stops short of the horizon.
                    if b.radius[k] > 1.001 * hole.horizon() {
                        assert!((a.radius[k] / b.radius[k] - 1.0).abs() < 1e-7, "{context}");
                        assert!((a.theta[k] - b.theta[k]).abs() < 1e-7, "{context}");
                        assert!((a.delay[k] - b.delay[k]).abs() < 1e-6 * b.delay[k].abs().max(1.0));
                    }
                }
            }
        }
    }
}

/// Requests that the closed form does not serve are traced as with the default integrator, to the
/// bit; and a ray next to the critical curve has its digits.
#[test]
fn code_elliptic_serves_every_request() {
    let hole = Kerr::new(0.94).unwrap();
    let (far, near) = (at_radius(60.0, 100.0), at_radius(60.0, 3.0));
    let trace = |integrator: Integrator, observer: &Observer, request: &Request| {
        let (alpha, beta) = ([-3.0, 0.5, 1.0], [2.0, 0.5, 1.0]);
        integrator.trace(&hole, observer, &alpha, &beta, 1e-11, request).unwrap()
    };
    let momentum = Request { momentum: true, ..Request::crossings(2) };
    let length = Request::samples(Placement::PathLength { points: 9, radius: 20.0 });
    let nodes = Request::samples(Placement::GaussLegendre { points: 9, from: 2.0, to: 20.0 });
    let times = Request::samples(Placement::MinoTime(9));
    for (observer, request) in [(far, momentum), (far, length), (far, nodes), (near, times)] {
        let [closed, series] = [Integrator::Elliptic, Integrator::TaylorMino]
            .map(|integrator| trace(integrator, &observer, &request));
        // As text: columns have NaN where rays do not turn.
        assert_eq!(format!("{closed:?}"), format!("{series:?}"));
    }
    let hole = Kerr::new(0.0).unwrap();
    let alpha = [27f64.sqrt() * (1.0 + 1e-9)];
    let request = Request { uncertainty: true, ..Request::crossings(3) };
    let [closed, series] = [Integrator::Elliptic, Integrator::TaylorMino].map(|integrator| {
        integrator.trace(&hole, &at_infinity(60.0), &alpha, &[0.0], 1e-12, &request).unwrap()
    });
    assert_eq!(closed.crossings, series.crossings);
    assert_eq!(closed.uncertainty, series.uncertainty);
}
