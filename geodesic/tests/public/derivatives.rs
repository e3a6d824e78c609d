//! Exact derivatives against central differences.

use kerrlight_geodesic::derivatives::{self, Gradient};
use kerrlight_geodesic::{
    Double, Dual, Elementary, Inclination, Integrator, Kerr, Observer, Outcome, Path, PathPoint,
    Placement, Quantities, Request, Scalar, trace_series,
};

type Number = Dual<f64, 4>;

/// A ray: spin, inclination in radians, α, β.
type Place = [f64; 4];

#[derive(Clone, Copy)]
struct Case {
    spin: f64,
    degrees: f64,
    alpha: f64,
    beta: f64,
    radius: Option<f64>,
}

const fn case(spin: f64, degrees: f64, alpha: f64, beta: f64) -> Case {
    Case { spin, degrees, alpha, beta, radius: None }
}

const fn near(spin: f64, degrees: f64, alpha: f64, beta: f64) -> Case {
    Case { spin, degrees, alpha, beta, radius: Some(50.0) }
}

/// Generic, captured, scattered; several crossings; the equator and nearly the pole; every kind of
/// spin; from infinity and from 50 M.
const CASES: [Case; 16] = [
    case(0.0, 60.0, -6.0, 2.0),
    case(0.0, 60.0, 1.0, 2.0),
    case(0.5, 17.0, 3.0, -5.0),
    case(0.5, 90.0, 4.0, 3.0),
    case(0.5, 90.0, -1.0, 2.0),
    case(0.5, 0.3, 5.5, 1.0),
    case(-0.94, 60.0, 5.0, 4.0),
    case(-0.94, 0.3, -0.5, 2.0),
    case(0.998, 60.0, -6.5, 2.5),
    case(0.998, 80.0, 1.0, 5.5),
    case(0.998, 90.0, 3.0, 1.0),
    case(0.94, 120.0, 30.0, -20.0),
    near(0.94, 60.0, -6.0, 2.0),
    near(0.0, 30.0, 2.0, 1.0),
    near(-0.94, 90.0, 7.0, 3.0),
    near(0.998, 0.3, -5.0, 3.0),
];

fn observer<T: Elementary>(case: &Case, inclination: Inclination<T>) -> Observer<T> {
    match case.radius {
        Some(radius) => Observer::at_radius(inclination, radius).unwrap(),
        None => Observer::at_infinity(inclination),
    }
}

fn dual_path(case: &Case) -> Path<Number> {
    let inclination = Inclination::from_degrees(case.degrees).unwrap().parameter(1);
    let hole = Kerr::from_spin(Number::parameter(case.spin, 0)).unwrap();
    let [alpha, beta] = [Number::parameter(case.alpha, 2), Number::parameter(case.beta, 3)];
    let ray = observer(case, inclination).ray(&hole, alpha, beta).unwrap();
    let mut path = Path::empty();
    trace_series(1e-14, &hole, &ray, Quantities::ALL, &mut path).unwrap();
    path
}

/// The same with about 28 digits, at parameters moved by `step` in direction `k`.
fn moved_path(case: &Case, k: usize, step: f64) -> Path<Double> {
    let angle = Double::from(case.degrees) * Double::PI / Double::from(180.0);
    let mut place = [Double::from(case.spin), angle, case.alpha.into(), case.beta.into()];
    place[k] = place[k] + Double::from(step);
    let [spin, angle, alpha, beta] = place;
    let hole = Kerr::from_spin(spin).unwrap();
    let inclination = Inclination::from_radians(angle).unwrap();
    let ray = observer(case, inclination).ray(&hole, alpha, beta).unwrap();
    let mut path = Path::empty();
    trace_series(1e-29, &hole, &ray, Quantities::ALL, &mut path).unwrap();
    path
}

fn quantities<T: Elementary>(point: &PathPoint<T>) -> [T; 5] {
    [point.mino_time, point.radius(), point.theta(), point.azimuth, point.delay]
}

const NAMES: [&str; 5] = ["mino time", "r", "theta", "azimuth", "delay"];

/// Crossings nearer than 1e4 M and not at the observer: an observer in the equatorial plane moves
/// out of it with the inclination, and its rays then cross the plane at |β|/h or at once.
fn crossings<T: Elementary>(path: &Path<T>) -> Vec<[T; 5]> {
    let points = path.equatorial_crossings().map(|time| path.at(time));
    let there = |p: &PathPoint<T>| p.inverse_radius.value() > 1e-4 && p.mino_time.value() > 1e-5;
    points.filter(there).map(|p| quantities(&p)).collect()
}

/// Positions at fixed Mino times, all before the ray's end and after the observer.
fn samples<T: Elementary>(path: &Path<T>, times: &[f64]) -> Vec<[T; 5]> {
    times.iter().map(|time| quantities(&path.at(T::constant(*time)))).collect()
}

/// Five-point differences of lists of numbers along each of the four parameters: for a step `h` they
/// leave out h⁴ times a fifth derivative, and the rounding of the numbers over h.
fn differences<T: Elementary, const N: usize>(
    h: f64,
    at: impl Fn(usize, f64) -> Vec<[T; N]>,
) -> Vec<[[f64; 4]; N]> {
    let mut slopes = vec![[[0.0; 4]; N]; at(0, 0.0).len()];
    for k in 0..4 {
        let at = [1.0, -1.0, 2.0, -2.0].map(|steps| at(k, steps * h));
        for (p, slope) in slopes.iter_mut().enumerate() {
            for (q, slope) in slope.iter_mut().enumerate() {
                let [up, down, up2, down2] = [0, 1, 2, 3].map(|side: usize| at[side][p][q]);
                let (one, two) = ((up - down).value(), (up2 - down2).value());
                slope[k] = (8.0 * one - two) / (12.0 * h);
            }
        }
    }
    slopes
}

/// `exact` and `expected` agree to `tolerance` of the whole gradient's length, or of the number
/// itself where that is larger: a component that nearly vanishes inherits the others' rounding.
fn compare(what: &str, value: f64, exact: &[f64; 4], expected: &[f64; 4], tolerance: f64) -> f64 {
    let length = expected.iter().map(|x| x * x).sum::<f64>().sqrt();
    let mut worst = 0.0f64;
    for (exact, expected) in exact.iter().zip(expected) {
        let miss = (exact - expected).abs() / length.max(value.abs()).max(1e-3);
        assert!(miss < tolerance, "{what}: {exact} is not {expected}: off by {miss:e}");
        worst = worst.max(miss);
    }
    worst
}

/// Compares with differences of rays of 28 digits: what is left is the rounding of the dual numbers
/// themselves, a few hundred units in the last place at most.
fn check(case: &Case, h: f64, tolerance: f64) -> f64 {
    let path = dual_path(case);
    assert!(matches!(path.outcome(), Outcome::Captured | Outcome::Escaped));
    let total = path.mino_total().value;
    let times = [0.1, 0.3, 0.5, 0.7, 0.9].map(|part| part * total);
    let label = format!("a {} i {} ({}, {})", case.spin, case.degrees, case.alpha, case.beta);
    let mut worst = 0.0f64;
    let found = [crossings(&path), samples(&path, &times)];
    let expected = [
        differences(h, |k, step| crossings(&moved_path(case, k, step))),
        differences(h, |k, step| samples(&moved_path(case, k, step), &times)),
    ];
    for (kind, (found, expected)) in ["crossing", "sample"].iter().zip(found.iter().zip(&expected))
    {
        assert_eq!(found.len(), expected.len(), "{label}");
        for (k, (found, expected)) in found.iter().zip(expected).enumerate() {
            for q in 0..5 {
                // The labels: θ of a crossing and τ of a sample do not move.
                let what = format!("{label}, {kind} {k}, {}", NAMES[q]);
                worst = worst.max(compare(
                    &what,
                    found[q].value,
                    &found[q].slope,
                    &expected[q],
                    tolerance,
                ));
            }
        }
    }
    worst
}

#[test]
fn exact_derivatives_of_crossings_and_of_positions_at_fixed_mino_time() {
    for case in &CASES {
        let worst = check(case, 1e-6, 1e-12);
        println!("{:+.3} {:>5}: {worst:.1e}", case.spin, case.degrees);
    }
    assert!(CASES.iter().any(|case| crossings(&dual_path(case)).len() >= 2));
}

/// A relative distance of 1e-3 from the critical curve, which amplifies what moves with it by 1e3.
#[test]
fn exact_derivatives_next_to_the_critical_curve() {
    for spin in [0.0, 0.5, -0.94, 0.998] {
        let hole = Kerr::new(spin).unwrap();
        let inclination = Inclination::from_degrees(60.0).unwrap();
        let (mut inside, mut outside) = (1.0, 9.0);
        for _ in 0..60 {
            let beta = 0.5 * (inside + outside);
            let ray = Observer::at_infinity(inclination).ray(&hole, 0.5, beta).unwrap();
            if ray.potential.captures() { inside = beta } else { outside = beta }
        }
        for side in [-1e-3, 1e-3] {
            let case = case(spin, 60.0, 0.5, inside * (1.0 + side));
            assert!(crossings(&dual_path(&case)).len() >= 2);
            let worst = check(&case, 1e-7, 1e-12);
            println!("{spin:+.3} {side:+}: {worst:.1e}");
        }
    }
}

/// Everything that the columns hold, values first.
fn columns(rays: &kerrlight_geodesic::RayTable, crossings: bool) -> Vec<[f64; 7]> {
    let points = if crossings { &rays.crossings } else { &rays.samples };
    let column = |column: &[f64], k: usize| column.get(k).copied().unwrap_or(0.0);
    let row = |k: usize| {
        let p_theta = points.momentum[k][2];
        let weight = column(&points.weight, k);
        let (t, r) = (points.mino_time[k], points.radius[k]);
        [t, r, points.theta[k], points.azimuth[k], points.delay[k], weight, p_theta]
    };
    (0..points.len()).map(row).collect()
}

fn gradients(rays: &derivatives::Differentiated, crossings: bool) -> Vec<[[f64; 4]; 7]> {
    let g = if crossings { &rays.crossings } else { &rays.samples };
    let column = |column: &[Gradient], k: usize| column.get(k).copied().unwrap_or_default();
    let row = |k: usize| {
        let weight = column(&g.weight, k);
        [
            g.mino_time[k],
            g.radius[k],
            g.theta[k],
            g.azimuth[k],
            g.delay[k],
            weight,
            g.momentum[k][2],
        ]
        .map(Gradient::to_array)
    };
    (0..g.radius.len()).map(row).collect()
}

fn traced(case: &Case, place: Place, request: &Request) -> kerrlight_geodesic::RayTable {
    let [spin, angle, alpha, beta] = place;
    let hole = Kerr::new(spin).unwrap();
    let observer = observer(case, Inclination::from_radians(angle).unwrap());
    let traced = Integrator::TaylorMino.trace(&hole, &observer, &[alpha], &[beta], 1e-14, request);
    traced.unwrap()
}

/// The column API on every placement: the derivative of a point moves with its label. Five-point
/// differences of doubles with h = 2e-3 leave out 1e-11 of a fifth derivative and 1e-12 of
/// rounding; what an order of magnitude more of either gives is the tolerance.
#[test]
fn exact_columns_of_derivatives_on_every_placement() {
    let placements = [
        Placement::MinoTime(4),
        Placement::PathLength { points: 4, radius: 15.0 },
        Placement::GaussLegendre { points: 3, from: 4.0, to: 20.0 },
    ];
    let cases = [
        case(0.9, 50.0, -6.0, 3.0),
        case(0.5, 70.0, 2.0, 2.0),
        near(-0.7, 40.0, 6.0, -4.0),
        near(0.3, 50.0, 2.0, 1.0),
    ];
    for (samples, case) in placements.iter().flat_map(|p| cases.iter().map(move |c| (*p, c))) {
        let request = Request {
            crossings: 2,
            samples,
            azimuth: true,
            time: true,
            momentum: true,
            weight: true,
            uncertainty: true,
        };
        let place = [case.spin, case.degrees.to_radians(), case.alpha, case.beta];
        let hole = Kerr::new(case.spin).unwrap();
        let observer = observer(case, Inclination::from_radians(place[1]).unwrap());
        let (alpha, beta) = ([case.alpha], [case.beta]);
        let found = derivatives::trace(&hole, &observer, &alpha, &beta, 1e-14, &request).unwrap();
        assert_eq!(found.values.uncertainty.len(), 1);
        for crossings in [true, false] {
            let expected = differences(2e-3, |k, step| {
                let mut place = place;
                place[k] += step;
                columns(&traced(case, place, &request), crossings)
            });
            let values = columns(&found.values, crossings);
            assert!(values.len() == expected.len() && (crossings || !expected.is_empty()));
            let plain = columns(&traced(case, place, &request), crossings);
            for ((value, plain), (found, expected)) in
                values.iter().zip(&plain).zip(gradients(&found, crossings).iter().zip(&expected))
            {
                for q in 0..7 {
                    assert!((value[q] - plain[q]).abs() <= 1e-10 * plain[q].abs().max(1.0));
                    let horizon = value[1] < hole.horizon() * (1.0 + 1e-9);
                    if horizon && q > 2 {
                        continue;
                    }
                    let what = format!("{samples:?} crossings {crossings} column {q}");
                    compare(&what, value[q], &found[q], &expected[q], 1e-8);
                }
            }
        }
    }
}

/// At the horizon r moves with r₊ = 1 + √(1 − a²) alone, and azimuth and delay have no slope.
#[test]
fn exact_derivatives_at_the_horizon() {
    let hole = Kerr::new(0.6).unwrap();
    let observer = Observer::at_infinity(Inclination::from_degrees(30.0).unwrap());
    let request = Request::samples(Placement::MinoTime(3));
    let rays = derivatives::trace(&hole, &observer, &[1.0], &[2.0], 1e-13, &request).unwrap();
    let last = rays.samples.radius[2].to_array();
    for (found, expected) in last.iter().zip([-0.75, 0.0, 0.0, 0.0]) {
        assert!((found - expected).abs() < 1e-9, "{last:?}");
    }
    assert!(rays.samples.azimuth[2].spin.is_nan() && rays.samples.delay[2].alpha.is_nan());
    assert!(rays.samples.azimuth[1].spin.is_finite());
}

/// dr/dτ, dθ/dτ, dφ/dτ and d(delay)/dτ are slopes of the path; and with them a derivative at
/// fixed Mino time is that of the dual path there.
#[test]
fn exact_rates_and_derivatives_at_fixed_mino_time() {
    let case = case(0.8, 55.0, -5.0, 4.0);
    let inclination = Inclination::from_degrees(case.degrees).unwrap();
    let hole = Kerr::new(case.spin).unwrap();
    let place = Observer::at_infinity(inclination);
    let request = Request::samples(Placement::MinoTime(6));
    let rays =
        derivatives::trace(&hole, &place, &[case.alpha], &[case.beta], 1e-14, &request).unwrap();
    let path = dual_path(&case);
    for k in 0..6 {
        let time = rays.values.samples.mino_time[k];
        let (rate, h) = (rays.samples.rate[k], 1e-4);
        let at = [1.0, -1.0, 2.0, -2.0]
            .map(|steps| quantities(&path.at(Number::constant(time + steps * h))));
        let rates = [1.0, rate.radius, rate.theta, rate.azimuth, rate.delay];
        for (q, rate) in rates.iter().enumerate() {
            let [up, down, up2, down2] = [0, 1, 2, 3].map(|side: usize| at[side][q].value);
            let expected = (8.0 * (up - down) - (up2 - down2)) / (12.0 * h);
            let miss = (rate - expected).abs() / expected.abs().max(1.0);
            assert!(miss < 1e-8, "{}: {rate} {expected}", NAMES[q]);
        }
        let fixed = rays.samples.at_fixed_mino_time(k).unwrap();
        let there = quantities(&path.at(Number::constant(time)));
        let found = [fixed.radius, fixed.theta, fixed.azimuth, fixed.delay];
        for (q, found) in found.iter().enumerate() {
            compare(NAMES[q + 1], 0.0, &found.to_array(), &there[q + 1].slope, 1e-11);
        }
    }
    assert_eq!(rays.samples.at_fixed_mino_time(6), None);
}

/// Seen from the axis itself the derivative with respect to inclination exists but for θ at the
/// observer: it is the limit of that at a small inclination.
#[test]
fn exact_derivatives_seen_from_the_pole() {
    let request = Request::crossings(2);
    let hole = Kerr::new(0.9).unwrap();
    let at = |degrees: f64| {
        let observer = Observer::at_infinity(Inclination::from_degrees(degrees).unwrap());
        derivatives::trace(&hole, &observer, &[3.0], &[5.0], 1e-13, &request).unwrap()
    };
    let (pole, aside) = (at(0.0), at(1e-7));
    assert!(!pole.crossings.radius.is_empty());
    let columns = |rays: &derivatives::Differentiated| {
        let c = &rays.crossings;
        [c.mino_time[0], c.radius[0], c.azimuth[0], c.delay[0]].map(Gradient::to_array)
    };
    for (q, (pole, aside)) in columns(&pole).iter().zip(columns(&aside)).enumerate() {
        compare(&format!("column {q}"), 0.0, pole, &aside, 1e-7);
    }
}

#[test]
fn what_has_no_derivative_is_refused_or_nan() {
    let observer = Observer::at_infinity(Inclination::from_degrees(30.0).unwrap());
    let request = Request::crossings(1);
    let text =
        derivatives::trace(&Kerr::new(1.0).unwrap(), &observer, &[1.0], &[1.0], 1e-9, &request)
            .unwrap_err()
            .to_string();
    assert!(text.contains("spin = 1") && text.contains("(-1, 1)"), "{text}");
    let hole = Kerr::new(0.5).unwrap();
    assert!(derivatives::trace(&hole, &observer, &[1.0], &[], 1e-9, &request).is_err());
    assert!(derivatives::trace(&hole, &observer, &[1.0], &[1.0], 1e-20, &request).is_err());
    let rays = derivatives::trace(&hole, &observer, &[1.0], &[1.0], 1e-9, &request).unwrap();
    assert!(rays.turning_radius[0].spin.is_nan() && rays.mino_total[0].spin.is_finite());
}
