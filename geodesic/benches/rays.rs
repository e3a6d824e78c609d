//! Cost of a ray by what is requested and by tolerance: 64 × 64 rays, α, β ∈ [−8, 8],
//! i = 60°, a = 0.94. Every benchmark asserts its answer.
//!
//! `cargo bench -p kerrlight-geodesic --features affine`

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use kerrlight_geodesic::simd::{Crossings, InstructionSet, Samples};
use kerrlight_geodesic::{Inclination, Kerr, Observer, Path, Quantities, Ray, Tracer};
use std::hint::black_box;

/// Sum of the Mino times of all rays, by the tracer at a tolerance of 1e-13.
const MINO_TOTAL: f64 = 2868.316443169;

fn rays() -> (Kerr, Vec<Ray>) {
    let hole = Kerr::new(0.94).expect("a spin");
    let inclination = Inclination::from_degrees(60.0).expect("an inclination");
    let observer = Observer::at_infinity(inclination);
    let at = |k: usize| -8.0 + 16.0 * k as f64 / 63.0;
    let rays = (0..64 * 64).map(|k| observer.ray(&hole, at(k % 64), at(k / 64)).expect("a ray"));
    (hole, rays.collect())
}

fn trace_all(tracer: &Tracer, hole: &Kerr, rays: &[Ray], want: Quantities, path: &mut Path) -> f64 {
    let mut total = 0.0;
    for ray in rays {
        tracer.trace(hole, ray, want, path);
        total += path.mino_total();
    }
    total
}

const WANTS: [(&str, Quantities); 4] = [
    ("r, theta", Quantities::POLAR),
    ("and time", Quantities { azimuth: false, time: true, velocity: false }),
    ("and azimuth", Quantities { azimuth: true, time: false, velocity: false }),
    ("everything", Quantities::ALL),
];

fn requests(c: &mut Criterion) {
    let (hole, rays) = rays();
    let tracer = Tracer::new(1e-9).expect("a tolerance");
    let mut group = c.benchmark_group("trace 4096 rays, rk45-mino at 1e-9");
    group.throughput(Throughput::Elements(rays.len() as u64)).sample_size(10);
    for (name, want) in WANTS {
        let mut path = Path::new();
        let total = trace_all(&tracer, &hole, &rays, want, &mut path);
        assert!((total / MINO_TOTAL - 1.0).abs() < 1e-8, "{total}");
        group.bench_function(name, |b| {
            b.iter(|| black_box(trace_all(&tracer, &hole, &rays, want, &mut path)));
        });
    }
    group.finish();
}

fn tolerances(c: &mut Criterion) {
    let (hole, rays) = rays();
    let mut group = c.benchmark_group("trace 4096 rays, rk45-mino, everything");
    group.throughput(Throughput::Elements(rays.len() as u64)).sample_size(10);
    for exponent in [6, 8, 10, 12] {
        let tolerance = 10f64.powi(-exponent);
        let tracer = Tracer::new(tolerance).expect("a tolerance");
        let mut path = Path::new();
        let total = trace_all(&tracer, &hole, &rays, Quantities::ALL, &mut path);
        assert!((total / MINO_TOTAL - 1.0).abs() < 0.1 * tolerance.max(1e-11), "{total}");
        group.bench_function(BenchmarkId::from_parameter(tolerance), |b| {
            b.iter(|| black_box(trace_all(&tracer, &hole, &rays, Quantities::ALL, &mut path)));
        });
    }
    group.finish();
}

fn samples(c: &mut Criterion) {
    let (hole, rays) = rays();
    let tracer = Tracer::new(1e-9).expect("a tolerance");
    let mut paths = vec![Path::new(); 64];
    for (path, ray) in paths.iter_mut().zip(rays.iter().step_by(64)) {
        tracer.trace(&hole, ray, Quantities::ALL, path);
        let end = path.at(path.mino_total());
        assert!(end.radius() < 2.0 || end.radius() > 1e6);
    }
    let mut group = c.benchmark_group("64 rays x 100 samples of a traced path");
    group.throughput(Throughput::Elements(6400));
    group.bench_function("everything", |b| {
        b.iter(|| {
            let mut sum = 0.0;
            for path in &paths {
                for k in 0..100 {
                    sum += path.at(path.mino_total() * f64::from(k) / 100.0).inverse_radius;
                }
            }
            black_box(sum)
        });
    });
    group.finish();
}

/// The hole, an observer at 1000 M, and `n` × `n` rays.
fn picture(n: usize) -> (Kerr, Observer, Vec<f64>, Vec<f64>) {
    let hole = Kerr::new(0.94).expect("a spin");
    let inclination = Inclination::from_degrees(60.0).expect("an inclination");
    let observer = Observer::at_radius(inclination, 1000.0).expect("a radius");
    let at = |k: usize| -8.0 + 16.0 * k as f64 / (n - 1) as f64;
    let (alpha, beta) = (0..n * n).map(|k| (at(k % n), at(k / n))).unzip();
    (hole, observer, alpha, beta)
}

/// The whole of (t, r, θ, φ) at 100 points of every ray, from an observer at 1000 M, by
/// instruction set and number of rays. `tests.rs` of the module holds every point against the tracer;
/// here the sum of all Mino times is.
fn pictures(c: &mut Criterion) {
    let (hole, observer, alpha, beta) = picture(64);
    let tracer = Tracer::new(1e-12).expect("a tolerance");
    let mut path = Path::new();
    let mut length = |(alpha, beta): (&f64, &f64)| {
        let ray = observer.ray(&hole, *alpha, *beta).expect("a ray");
        tracer.trace(&hole, &ray, Quantities::POLAR, &mut path);
        path.turning_point().map_or(path.mino_total(), |(turning, _)| 2.0 * turning)
    };
    let expected: f64 = alpha.iter().zip(&beta).map(&mut length).sum();
    let mut group = c.benchmark_group("4096 rays x 100 samples, simd");
    group.throughput(Throughput::Elements(409_600));
    for set in InstructionSet::ALL.into_iter().filter(|set| set.available()) {
        let mut samples = Samples::default();
        let run = |samples: &mut Samples| {
            samples.trace_at(set, &hole, &observer, &alpha, &beta, 100).expect("rays");
        };
        run(&mut samples);
        let total: f64 = (0..4096).map(|k| samples.ray(k).mino_total).sum();
        assert!((total / expected - 1.0).abs() < 1e-7, "{total} {expected}");
        group.bench_function(format!("{set:?}"), |b| b.iter(|| run(&mut samples)));
    }
    group.finish();
    let mut group = c.benchmark_group("rays x 100 samples, simd");
    for n in [16, 32, 64, 128] {
        let (hole, observer, alpha, beta) = picture(n);
        let mut samples = Samples::default();
        let run = |samples: &mut Samples| {
            samples.trace(&hole, &observer, &alpha, &beta, 100).expect("rays");
        };
        // Before it is measured: a filter may leave the measurement out.
        run(&mut samples);
        // All but a few rays next to the critical curve.
        let lost = (0..n * n).filter(|k| samples.ray(*k).error > 1e-9).count();
        assert!(lost * 1000 <= n * n, "{lost} of {}", n * n);
        group.throughput(Throughput::Elements(100 * (n * n) as u64));
        group.bench_function(BenchmarkId::from_parameter(n * n), |b| b.iter(|| run(&mut samples)));
    }
    group.finish();
}

/// First equatorial crossings, (t, r, φ), of the same rays, by instruction set and number of rays, each
/// within 1e-9 of the tracer.
fn crossings(c: &mut Criterion) {
    let (hole, observer, alpha, beta) = picture(64);
    let mut group = c.benchmark_group("first crossings of 4096 rays, simd");
    group.throughput(Throughput::Elements(4096));
    for set in InstructionSet::ALL.into_iter().filter(|set| set.available()) {
        let mut found = Crossings::default();
        let run = |found: &mut Crossings| {
            found.trace_at(set, &hole, &observer, &alpha, &beta, 1).expect("rays");
        };
        run(&mut found);
        assert_crossings(&hole, &observer, (&alpha, &beta), &found);
        group.bench_function(format!("{set:?}"), |b| b.iter(|| run(&mut found)));
    }
    group.finish();
    let mut group = c.benchmark_group("first crossings, simd");
    for n in [16, 64, 256] {
        let (hole, observer, alpha, beta) = picture(n);
        let mut found = Crossings::default();
        let run = |found: &mut Crossings| {
            found.trace(&hole, &observer, &alpha, &beta, 1).expect("rays");
        };
        run(&mut found);
        let lost = found.error().iter().filter(|error| **error > 1e-9).count();
        assert!(found.error().len() == n * n && lost * 1000 <= n * n, "{lost} of {}", n * n);
        group.throughput(Throughput::Elements((n * n) as u64));
        group.bench_function(BenchmarkId::from_parameter(n * n), |b| b.iter(|| run(&mut found)));
    }
    group.finish();
}

/// Compares every 7th ray with the tracer.
fn assert_crossings(
    hole: &Kerr,
    observer: &Observer,
    (alpha, beta): (&[f64], &[f64]),
    found: &Crossings,
) {
    let tracer = Tracer::new(1e-13).expect("a tolerance");
    let mut path = Path::new();
    for k in (0..alpha.len()).step_by(7) {
        let ray = observer.ray(hole, alpha[k], beta[k]).expect("a ray");
        tracer.trace(hole, &ray, Quantities::ALL, &mut path);
        let end = path.turning_point().map_or(f64::INFINITY, |(turning, _)| 2.0 * turning);
        let time = path.equatorial_crossings().next().filter(|time| *time < end);
        let crossing = found.ray(k).next();
        assert_eq!(time.is_some(), crossing.is_some(), "ray {k}");
        let (Some(time), Some(crossing)) = (time, crossing) else { continue };
        let expected = path.at(time);
        assert!((crossing.radius / expected.radius() - 1.0).abs() < 1e-9, "ray {k}");
        assert!((crossing.azimuth - expected.azimuth).abs() < 1e-9, "ray {k}");
        assert!((crossing.delay / expected.delay - 1.0).abs() < 1e-9, "ray {k}");
    }
}

criterion_group!(benches, requests, tolerances, samples, pictures, crossings);
criterion_main!(benches);
