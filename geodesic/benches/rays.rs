//! Cost of a ray by what is asked for and by tolerance: 64 × 64 rays, α, β ∈ [−8, 8],
//! i = 60°, a = 0.94. Every benchmark asserts its answer.
//!
//! `cargo bench -p kerrlight-geodesic --features affine`

use criterion::{BatchSize, BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use kerrlight_geodesic::bundle::{Samples, Width};
use kerrlight_geodesic::{Inclination, Kerr, Observer, Path, Ray, Tracer, Want};
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

fn trace_all(tracer: &Tracer, hole: &Kerr, rays: &[Ray], want: Want, path: &mut Path) -> f64 {
    let mut total = 0.0;
    for ray in rays {
        tracer.trace(hole, ray, want, path);
        total += path.mino_total();
    }
    total
}

const WANTS: [(&str, Want); 4] = [
    ("r, theta", Want::POLAR),
    ("and time", Want { azimuth: false, time: true }),
    ("and azimuth", Want { azimuth: true, time: false }),
    ("everything", Want::ALL),
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
        let total = trace_all(&tracer, &hole, &rays, Want::ALL, &mut path);
        assert!((total / MINO_TOTAL - 1.0).abs() < 0.1 * tolerance.max(1e-11), "{total}");
        group.bench_function(BenchmarkId::from_parameter(tolerance), |b| {
            b.iter(|| black_box(trace_all(&tracer, &hole, &rays, Want::ALL, &mut path)));
        });
    }
    group.finish();
}

fn samples(c: &mut Criterion) {
    let (hole, rays) = rays();
    let tracer = Tracer::new(1e-9).expect("a tolerance");
    let mut paths = vec![Path::new(); 64];
    for (path, ray) in paths.iter_mut().zip(rays.iter().step_by(64)) {
        tracer.trace(&hole, ray, Want::ALL, path);
        let end = path.at(path.mino_total());
        assert!(end.radius() < 2.0 || end.radius() > 1e6);
    }
    let mut group = c.benchmark_group("64 rays x 100 samples of a traced path");
    group.throughput(Throughput::Elements(6400));
    group.bench_function("everything", |b| {
        b.iter_batched(
            || (),
            |()| {
                let mut sum = 0.0;
                for path in &paths {
                    for k in 0..100 {
                        sum += path.at(path.mino_total() * f64::from(k) / 100.0).inverse_radius;
                    }
                }
                black_box(sum)
            },
            BatchSize::SmallInput,
        );
    });
    group.finish();
}

/// The whole of (t, r, θ, φ) at 100 points of every ray, from an observer at 1000 M, by
/// number of lanes.
fn bundles(c: &mut Criterion) {
    let hole = Kerr::new(0.94).expect("a spin");
    let inclination = Inclination::from_degrees(60.0).expect("an inclination");
    let observer = Observer::at_radius(inclination, 1000.0).expect("a radius");
    let at = |k: usize| -8.0 + 16.0 * k as f64 / 63.0;
    let (alpha, beta): (Vec<f64>, Vec<f64>) =
        (0..64 * 64).map(|k| (at(k % 64), at(k / 64))).unzip();
    let tracer = Tracer::new(1e-12).expect("a tolerance");
    let mut path = Path::new();
    let mut length = |(alpha, beta): (&f64, &f64)| {
        let ray = observer.ray(&hole, *alpha, *beta).expect("a ray");
        tracer.trace(&hole, &ray, Want::POLAR, &mut path);
        path.turning_point().map_or(path.mino_total(), |(turning, _)| 2.0 * turning)
    };
    let expected: f64 = alpha.iter().zip(&beta).map(&mut length).sum();
    let mut group = c.benchmark_group("4096 rays x 100 samples, bundle");
    group.throughput(Throughput::Elements(409_600));
    for width in [Width::Scalar, Width::Avx2, Width::Avx512] {
        if !width.available() {
            continue;
        }
        let mut samples = Samples::default();
        let run = |samples: &mut Samples| {
            samples.trace_at(width, &hole, &observer, &alpha, &beta, 100).expect("rays");
        };
        run(&mut samples);
        let total: f64 = (0..4096).map(|k| samples.ray(k).mino_total).sum();
        assert!((total / expected - 1.0).abs() < 1e-7, "{total} {expected}");
        group.bench_function(format!("{width:?}"), |b| b.iter(|| run(&mut samples)));
    }
    group.finish();
}

criterion_group!(benches, requests, tolerances, samples, bundles);
criterion_main!(benches);
