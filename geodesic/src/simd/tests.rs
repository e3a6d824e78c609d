use super::*;
use crate::analytic::{ClosedForm, CriticalCurve};
use crate::{Inclination, Outcome, Path, Quantities, Tracer};

fn observer(degrees: f64, radius: f64) -> Observer {
    let inclination = Inclination::from_degrees(degrees).unwrap();
    if radius == f64::INFINITY {
        return Observer::at_infinity(inclination);
    }
    Observer::at_radius(inclination, radius).unwrap()
}

fn grid(n: usize, half: f64) -> (Vec<f64>, Vec<f64>) {
    let at = |k: usize| -half + 2.0 * half * k as f64 / (n - 1) as f64;
    (0..n * n).map(|k| (at(k % n), at(k / n))).unzip()
}

/// Returns the factors by which dφ = a dr/Δ and dt = (r² + a²) dr/Δ amplify relative errors of r:
/// without bound at the horizon.
fn amplification(hole: &Kerr, r: f64) -> f64 {
    1.0 + (r * r + hole.spin().powi(2)) / hole.delta(r).abs().max(1e-20)
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
        tracer.trace(&hole, &ray, Quantities::ALL, &mut path);
        let found = samples.ray(k);
        assert_eq!(found.escapes, path.outcome() == Outcome::Escaped, "ray {k}");
        let step = found.mino_total / (found.radius.len() - 1) as f64;
        for j in 0..found.radius.len() {
            let expected = path.at(step * j as f64);
            if expected.radius() == f64::INFINITY || found.radius[j] == f64::INFINITY {
                assert_eq!(found.radius[j], f64::INFINITY);
                assert_eq!(found.delay[j].abs(), f64::INFINITY);
                assert!(expected.radius() > 1e9 && found.delay[j] * expected.delay > 0.0);
                assert!((found.azimuth[j] - expected.azimuth).abs() < 1e-9);
                continue;
            }
            let r = expected.radius();
            let amplified = amplification(&hole, r);
            let misses = [
                (found.radius[j] / r - 1.0).abs(),
                (found.theta[j] - expected.theta()).abs(),
                (found.azimuth[j] - expected.azimuth).abs() / amplified,
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
        (0.94, 60.0, f64::INFINITY, 100),
        (-1.0, 90.0, f64::INFINITY, 12),
        (0.3, 0.0, f64::INFINITY, 31),
        (1.0, 75.0, 5.0, 40),
        (0.0, 30.0, 7.0, 9),
    ];
    for (spin, degrees, radius, per_ray) in cases {
        let (alpha, beta) = grid(24, 8.0f64.min(0.65 * radius));
        let mut samples = Samples::default();
        let hole = Kerr::new(spin).unwrap();
        samples.trace(&hole, &observer(degrees, radius), &alpha, &beta, per_ray).unwrap();
        let worst = compare(spin, degrees, radius, &samples, (&alpha, &beta), 1);
        assert!(worst.iter().all(|w| *w < 1e-9), "a = {spin}, i = {degrees}: {worst:?}");
    }
}

/// Every set computes the same, to rounding.
#[test]
fn exact_same_samples_at_every_width() {
    let hole = Kerr::new(0.94).unwrap();
    let observer = observer(60.0, 1000.0);
    let (alpha, beta) = grid(16, 8.0);
    let mut scalar = Samples::default();
    scalar.trace_at(InstructionSet::Scalar, &hole, &observer, &alpha, &beta, 40).unwrap();
    for set in InstructionSet::ALL {
        if !set.available() {
            continue;
        }
        let mut wide = Samples::default();
        wide.trace_at(set, &hole, &observer, &alpha, &beta, 40).unwrap();
        for (a, b) in [
            (scalar.radius(), wide.radius()),
            (scalar.theta(), wide.theta()),
            (scalar.azimuth(), wide.azimuth()),
            (scalar.delay(), wide.delay()),
        ] {
            for (x, y) in a.iter().zip(b) {
                assert!((x - y).abs() < 1e-10 * x.abs().max(1.0), "{set:?}: {x} {y}");
            }
        }
    }
}

/// Compares [`Crossings`] and the tracer at its tightest on the same rays: the largest differences
/// of Mino time and radius (relative), azimuth (whole turns count) and delay (relative to max(1,
/// ·)), and of the radius in closed form.
fn compare_crossings(hole: &Kerr, observer: &Observer, rays: (&[f64], &[f64])) -> [f64; 5] {
    const COUNT: usize = 4;
    let mut crossings = Crossings::default();
    crossings.trace(hole, observer, rays.0, rays.1, COUNT).unwrap();
    let tracer = Tracer::new(1e-14).unwrap();
    let mut path = Path::new();
    let mut worst = [0.0f64; 5];
    for (k, (alpha, beta)) in rays.0.iter().zip(rays.1).enumerate() {
        let ray = observer.ray(hole, *alpha, *beta).unwrap();
        tracer.trace(hole, &ray, Quantities::ALL, &mut path);
        let closed = ClosedForm::new(hole, &ray);
        let returned = match path.turning_point() {
            Some((turning, _)) if !observer.is_at_infinity() => 2.0 * turning,
            _ => f64::INFINITY,
        };
        let times: Vec<f64> =
            path.equatorial_crossings().filter(|time| *time < returned).take(COUNT).collect();
        let found: Vec<Crossing> = crossings.ray(k).collect();
        assert_eq!(found.len(), times.len(), "({alpha}, {beta}): {times:?} {found:?}");
        for (number, (time, found)) in (1..).zip(times.iter().zip(&found)) {
            let expected = path.at(*time);
            let r = expected.radius();
            let amplified = amplification(hole, r);
            let closed = closed.crossing(number).unwrap();
            let misses = [
                (found.mino_time / time - 1.0).abs(),
                (found.radius / r - 1.0).abs(),
                (found.azimuth - expected.azimuth).abs() / amplified,
                (found.delay - expected.delay).abs() / (expected.delay.abs().max(1.0) * amplified),
                (found.radius / closed.radius - 1.0).abs(),
            ];
            for (worst, miss) in worst.iter_mut().zip(misses) {
                assert!(!miss.is_nan(), "({alpha}, {beta}), crossing {number}");
                *worst = worst.max(miss);
            }
        }
    }
    worst
}

/// Crossings, up to four of every ray, agree for every kind of hole and place of the observer, rays
/// through the axis among them.
#[test]
fn code_crossings_agree_with_the_runge_kutta_tracer_and_the_closed_form() {
    for spin in [0.0, 1e-9, 0.5, 0.94, 1.0, -0.7, -1.0] {
        let hole = Kerr::new(spin).unwrap();
        for degrees in [0.0, 1e-6, 17.0, 60.0, 90.0, 120.0, 180.0] {
            for radius in [f64::INFINITY, 1000.0, 5.0] {
                let observer = observer(degrees, radius).with_azimuth(0.25);
                let half = 8.1f64.min(0.65 * radius);
                let (mut alpha, mut beta) = grid(8, half);
                for (x, y) in [(0.0, 0.4), (-0.0, 0.4), (0.0, -0.4), (-0.0, -0.9), (0.4, 0.0)] {
                    alpha.push(x * half);
                    beta.push(y * half);
                }
                let worst = compare_crossings(&hole, &observer, (&alpha, &beta));
                assert!(
                    worst.iter().all(|w| *w < 1e-10),
                    "a = {spin}, i = {degrees}, r = {radius}: {worst:?}"
                );
            }
        }
    }
}

/// Rays at a relative distance δ from the critical curve: the photon orbit amplifies rounding
/// by 1/δ, in any method.
#[test]
fn code_crossings_next_to_the_critical_curve() {
    for spin in [0.0, 0.5, 0.94, -0.998] {
        let hole = Kerr::new(spin).unwrap();
        for degrees in [0.0, 17.0, 60.0, 90.0] {
            let observer = observer(degrees, f64::INFINITY);
            let curve = CriticalCurve::new(&hole, observer.inclination());
            for delta in [1e-2, 1e-3, 1e-4, 1e-5] {
                let (alpha, beta): (Vec<f64>, Vec<f64>) = (0..12)
                    .map(|k| {
                        let point = curve.point(0.1 + 0.52 * f64::from(k));
                        let part = 1.0 + if k % 2 == 0 { delta } else { -delta };
                        (part * point.alpha, part * point.beta)
                    })
                    .unzip();
                let worst = compare_crossings(&hole, &observer, (&alpha, &beta));
                // 3e-11 is what the quadrature may leave.
                let allowed = 3e-11 + 1e-14 / delta;
                assert!(
                    worst.iter().all(|w| *w < allowed),
                    "a = {spin}, i = {degrees}, {delta}: {worst:?}"
                );
            }
        }
    }
}

/// Numbers in [0, 1) in no particular order.
struct Numbers(u64);

impl Numbers {
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        (self.0 >> 11) as f64 / (1u64 << 53) as f64
    }

    fn hole(&mut self) -> Kerr {
        Kerr::new(if self.next() < 0.3 { 1.0 - 1e-3 * self.next() } else { self.next() }).unwrap()
    }

    fn observer(&mut self) -> Observer {
        let radius = if self.next() < 0.5 { f64::INFINITY } else { 10.0 / self.next().max(1e-3) };
        observer(180.0 * self.next(), radius)
    }

    /// A ray anywhere, or at a relative distance of 0.1 to 1e-7 from the critical curve.
    fn ray(&mut self, hole: &Kerr, observer: &Observer, close: bool) -> [f64; 2] {
        if !close {
            return [16.0 * self.next() - 8.0, 16.0 * self.next() - 8.0];
        }
        let point = CriticalCurve::new(hole, observer.inclination()).point(6.2 * self.next());
        let delta = 10f64.powf(-1.0 - 6.0 * self.next());
        let part = if self.next() < 0.5 { 1.0 + delta } else { 1.0 - delta };
        [part * point.alpha, part * point.beta]
    }
}

/// The largest miss of the positions of a ray's samples from its path, by the estimate of it. The
/// first and last one are where they are by definition.
fn samples_by_estimate(ray: RaySamples<'_>, path: &Path) -> f64 {
    let step = ray.mino_total / (ray.radius.len() - 1) as f64;
    let miss = |j: usize| {
        let expected = path.at(step * j as f64);
        let radius = (ray.radius[j] / expected.radius() - 1.0).abs();
        let theta = (ray.theta[j] - expected.theta()).abs();
        radius.max(theta).max((ray.azimuth[j] - expected.azimuth).abs())
    };
    // No number is no small miss.
    let larger = |most: f64, miss: f64| if miss.is_nan() { f64::INFINITY } else { most.max(miss) };
    (1..ray.radius.len() - 1).map(miss).fold(0.0, larger) / ray.error
}

/// Estimates bound 99 of 100 misses, near the critical curve too, and are no more than a hundred
/// times too large in the middle of rays taken anywhere.
#[test]
fn code_error_estimates_bound_the_misses() {
    let mut numbers = Numbers(5);
    let tracer = Tracer::new(1e-14).unwrap();
    let mut path = Path::new();
    for close in [false, true] {
        let (mut sampled, mut crossed) = (Vec::new(), Vec::new());
        for k in 0..600 {
            let hole = numbers.hole();
            let observer = numbers.observer();
            let [alpha, beta] = numbers.ray(&hole, &observer, close);
            let (mut samples, mut crossings) = (Samples::default(), Crossings::default());
            let per_ray = [20, 100, 300][k % 3];
            if samples.trace(&hole, &observer, &[alpha], &[beta], per_ray).is_err() {
                continue; // beyond the reach of an observer close by
            }
            crossings.trace(&hole, &observer, &[alpha], &[beta], 4).unwrap();
            tracer.trace(
                &hole,
                &observer.ray(&hole, alpha, beta).unwrap(),
                Quantities::ALL,
                &mut path,
            );
            sampled.push(samples_by_estimate(samples.ray(0), &path));
            for (found, time) in crossings.ray(0).zip(path.equatorial_crossings()) {
                let expected = path.at(time);
                let radius = (found.radius / expected.radius() - 1.0).abs();
                let azimuth = (found.azimuth - expected.azimuth).abs();
                crossed.push(radius.max(azimuth) / found.error);
            }
        }
        for mut part in [sampled, crossed] {
            assert!(part.len() > 400);
            part.sort_by(f64::total_cmp);
            let (middle, most) = (part[part.len() / 2], part[part.len() * 99 / 100]);
            assert!(most < 1.0, "99 % below {most}");
            assert!(close || middle > 0.01, "half of them below {middle}");
        }
    }
}

/// The first crossing has a way of its own, and so has every set.
#[test]
fn exact_same_crossings_however_they_are_found() {
    let hole = Kerr::new(0.94).unwrap();
    let observer = observer(60.0, 1000.0);
    let (alpha, beta) = grid(15, 8.0);
    let mut all = Crossings::default();
    all.trace_at(InstructionSet::Scalar, &hole, &observer, &alpha, &beta, 3).unwrap();
    for set in [InstructionSet::Scalar].into_iter().chain(InstructionSet::ALL) {
        if !set.available() {
            continue;
        }
        for per_ray in [1, 3] {
            let mut some = Crossings::default();
            some.trace_at(set, &hole, &observer, &alpha, &beta, per_ray).unwrap();
            assert_eq!((some.rays(), some.per_ray()), (225, per_ray));
            for k in 0..225 {
                let expected = all.ray(k).take(per_ray);
                assert_eq!(some.ray(k).count(), expected.count());
                for (x, y) in some.ray(k).zip(all.ray(k)) {
                    assert!((x.radius - y.radius).abs() < 1e-10 * y.radius, "{set:?}: {k}");
                    assert!((x.azimuth - y.azimuth).abs() < 1e-10, "{set:?}: {k}");
                    assert!((x.delay - y.delay).abs() < 1e-10 * y.delay, "{set:?}: {k}");
                    assert!((x.mino_time - y.mino_time).abs() < 1e-12, "{set:?}: {k}");
                }
            }
        }
    }
}

/// A ray in the equatorial plane does not cross it; no ray, no crossing.
#[test]
fn exact_no_crossings() {
    let hole = Kerr::new(0.5).unwrap();
    let mut crossings = Crossings::default();
    for radius in [f64::INFINITY, 100.0] {
        crossings.trace(&hole, &observer(90.0, radius), &[3.0, -9.0], &[0.0, 0.0], 2).unwrap();
        assert!(crossings.radius().iter().all(|r| r.is_nan()));
        // Along the axis.
        crossings.trace(&hole, &observer(0.0, radius), &[0.0], &[0.0], 1).unwrap();
        assert_eq!(crossings.ray(0).count(), 0);
    }
    crossings.trace(&hole, &observer(90.0, 100.0), &[], &[], 2).unwrap();
    assert_eq!((crossings.rays(), crossings.ray(7).count()), (0, 0));
}

/// Nothing that can be requested panics, and what cannot be is refused by name.
#[test]
fn rays_that_cannot_be_are_refused() {
    let hole = Kerr::new(0.5).unwrap();
    let (mut samples, mut crossings) = (Samples::default(), Crossings::default());
    let mut both = |observer: &Observer, alpha: &[f64], beta: &[f64], count: usize| {
        let found = samples.trace(&hole, observer, alpha, beta, count);
        let crossed = crossings.trace(&hole, observer, alpha, beta, count);
        assert_eq!(found.is_ok(), crossed.is_ok(), "{found:?} {crossed:?}");
        found.err().map(|error| error.to_string())
    };
    let near = observer(60.0, 100.0);
    assert!(both(&near, &[], &[], 10).is_none());
    for edge in [0.0, -0.0, 1e-300, 5e-324, 95.0] {
        assert!(both(&near, &[edge], &[edge.min(1.0)], 10).is_none());
    }
    let far = observer(60.0, f64::INFINITY);
    for edge in [1e12, -1e12, 1e-300, 0.0] {
        assert!(both(&far, &[edge, edge, 0.0], &[edge, 0.0, edge], 10).is_none());
    }
    for alpha in [101.0, 1e200, -1e308, f64::NAN, f64::INFINITY] {
        assert!(both(&near, &[alpha], &[1.0], 10).unwrap().contains("alpha"), "{alpha}");
    }
    assert!(both(&far, &[1.0], &[1e13], 10).unwrap().contains("beta"));
    assert!(both(&far, &[1.0], &[], 10).unwrap().contains("number of beta"));
    assert!(both(&near, &[1.0], &[1.0], 0).unwrap().contains("per ray"));
    assert!(both(&near, &[1.0; 3], &[1.0; 3], usize::MAX / 2).unwrap().contains("memory"));
    assert!(both(&observer(60.0, 3.0), &[1.0], &[1.0], 10).unwrap().contains("[5, 1e30]"));
    assert!(Observer::at_radius(Inclination::from_degrees(60.0).unwrap(), 1e40).is_err());
    assert!(both(&observer(60.0, 0.99e30), &[1.0], &[1.0], 10).is_none());
    assert!(samples.ray(0).azimuth.iter().all(|phi| phi.is_finite()));
    assert!(samples.trace(&hole, &near, &[1.0], &[1.0], 1).is_err());
}
