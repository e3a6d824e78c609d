//! Cost of a ray by method and tolerance, by what is requested of it, and on SIMD lanes: 64 × 64 rays, α, β ∈ [−8, 8],
//! i = 60°, a = 0.94. Every benchmark asserts its answer first.
//!
//! `cargo bench -p kerrlight-geodesic` (with `RAYON_NUM_THREADS=1` for one core)

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use kerrlight_geodesic::simd::{Crossings, InstructionSet, Samples};
use kerrlight_geodesic::{
    Inclination, Integrator, Kerr, Method, Observer, Path, Placement, Quantities, Ray, RayTable,
    Request, Tracer, derivatives,
};
use std::hint::black_box;

struct Screen {
    hole: Kerr,
    observer: Observer,
    alpha: Vec<f64>,
    beta: Vec<f64>,
    rays: Vec<Ray>,
}

impl Screen {
    /// The screen of an observer at 1000 M or, without `near`, at infinity.
    fn new(near: bool) -> Self {
        let hole = Kerr::new(0.94).expect("a spin");
        let inclination = Inclination::from_degrees(60.0).expect("an inclination");
        let observer = match near {
            true => Observer::at_radius(inclination, 1000.0).expect("a radius"),
            false => Observer::at_infinity(inclination),
        };
        let at = |k: usize| -8.0 + 16.0 * k as f64 / 63.0;
        let (alpha, beta): (Vec<f64>, Vec<f64>) =
            (0..64 * 64).map(|k| (at(k % 64), at(k / 64))).unzip();
        let ray = |(alpha, beta): (&f64, &f64)| observer.ray(&hole, *alpha, *beta).expect("a ray");
        let rays = alpha.iter().zip(&beta).map(ray).collect();
        Screen { hole, observer, alpha, beta, rays }
    }

    /// Shows the path of each ray.
    fn follow(&self, tracer: &Tracer, quantities: Quantities, mut see: impl FnMut(usize, &Path)) {
        let mut path = Path::new();
        for (k, ray) in self.rays.iter().enumerate() {
            tracer.trace(&self.hole, ray, quantities, &mut path);
            see(k, &path);
        }
    }

    fn trace(&self, tolerance: f64, request: &Request) -> RayTable {
        let Screen { hole, observer, alpha, beta, .. } = self;
        let traced = Integrator::TaylorMino.trace(hole, observer, alpha, beta, tolerance, request);
        traced.expect("rays")
    }

    fn differentiate(&self, tolerance: f64, request: &Request) -> derivatives::Differentiated {
        let Screen { hole, observer, alpha, beta, .. } = self;
        derivatives::trace(hole, observer, alpha, beta, tolerance, request).expect("rays")
    }
}

/// Rays with azimuth and time from 1000 M, whose Mino times add up to those of a small tolerance.
fn methods(c: &mut Criterion) {
    let screen = Screen::new(true);
    let quantities = Quantities { azimuth: true, time: true, velocity: false };
    let total = |tracer: &Tracer| {
        let mut total = 0.0;
        screen.follow(tracer, quantities, |_, path| total += path.mino_total());
        total
    };
    let exact = total(&Tracer::new(1e-13).expect("a tolerance"));
    let mut group = c.benchmark_group("4096 rays, azimuth and time");
    group.throughput(Throughput::Elements(4096)).sample_size(10);
    for method in [Method::Taylor, Method::Dop853, Method::Rk45] {
        for tolerance in [1e-4f64, 1e-6, 1e-8, 1e-10, 1e-12, 1e-14] {
            let tracer = Tracer::with_method(method, tolerance).expect("a tolerance");
            let found = total(&tracer);
            assert!((found / exact - 1.0).abs() < 10.0 * tolerance.max(1e-11), "{found} {exact}");
            let name = BenchmarkId::new(format!("{method:?}"), format!("{tolerance:e}"));
            group.bench_function(name, |b| b.iter(|| black_box(total(&tracer))));
        }
    }
    group.finish();
}

/// One request more at a time.
fn ladder(first: Request) -> [(&'static str, Request); 6] {
    let azimuth = Request { azimuth: true, ..first };
    let time = Request { time: true, ..azimuth };
    let momentum = Request { momentum: true, ..time };
    let weight = Request { weight: true, ..momentum };
    let uncertainty = Request { uncertainty: true, ..weight };
    [
        ("positions", first),
        ("+ azimuth", azimuth),
        ("+ time", time),
        ("+ momentum", momentum),
        ("+ weight", weight),
        ("+ uncertainty", uncertainty),
    ]
}

/// Radii, and what else there is, agree with a trace at 1e-13 within what the tolerance allows.
fn agree(found: &RayTable, exact: &RayTable) {
    assert_eq!(found.outcome, exact.outcome);
    for (points, exact) in [(&found.crossings, &exact.crossings), (&found.samples, &exact.samples)]
    {
        assert_eq!(points.len(), exact.len());
        let columns = [
            (&points.radius, &exact.radius),
            (&points.theta, &exact.theta),
            (&points.azimuth, &exact.azimuth),
            (&points.delay, &exact.delay),
            (&points.weight, &exact.weight),
        ];
        for (column, exact) in columns {
            for (x, exact) in column.iter().zip(exact) {
                assert!((x - exact).abs() < 1e-6 * exact.abs().max(1.0), "{x} {exact}");
            }
        }
    }
}

/// Tables of taylor-mino at 1e-9, from infinity.
fn requests(c: &mut Criterion) {
    let (screen, tolerance) = (Screen::new(false), 1e-9);
    let samples = Placement::GaussLegendre { points: 16, from: 2.0, to: 50.0 };
    for (name, first) in [
        ("first equatorial crossing", Request { crossings: 1, ..Request::default() }),
        ("16 nodes a passage", Request { samples, ..Request::default() }),
    ] {
        let mut group = c.benchmark_group(format!("4096 rays, {name}"));
        group.throughput(Throughput::Elements(4096)).sample_size(10);
        for (name, request) in ladder(first) {
            agree(&screen.trace(tolerance, &request), &screen.trace(1e-13, &request));
            group.bench_function(name, |b| {
                b.iter(|| black_box(screen.trace(tolerance, &request)));
            });
        }
        let request = Request { azimuth: true, time: true, ..first };
        let exact = screen.trace(1e-13, &request);
        agree(&screen.differentiate(tolerance, &request).values, &exact);
        group.bench_function("derivatives of (time, r, theta, azimuth)", |b| {
            b.iter(|| black_box(screen.differentiate(tolerance, &request)));
        });
        group.finish();
    }
}

/// The whole of (t, r, θ, φ) at 100 points of every ray, from an observer at 1000 M, by
/// instruction set. `tests.rs` of the module holds every point against the tracer; here the sum of all Mino
/// times is.
fn pictures(c: &mut Criterion) {
    let screen = Screen::new(true);
    let mut expected = 0.0;
    let tracer = Tracer::new(1e-12).expect("a tolerance");
    screen.follow(&tracer, Quantities::POLAR, |_, path| {
        expected += path.turning_point().map_or(path.mino_total(), |(turning, _)| 2.0 * turning);
    });
    let Screen { hole, observer, alpha, beta, .. } = &screen;
    let mut group = c.benchmark_group("4096 rays x 100 samples, simd");
    group.throughput(Throughput::Elements(409_600));
    for set in InstructionSet::ALL.into_iter().filter(|set| set.available()) {
        let mut samples = Samples::default();
        let run = |samples: &mut Samples| {
            samples.trace_at(set, hole, observer, alpha, beta, 100).expect("rays");
        };
        run(&mut samples);
        let total: f64 = (0..4096).map(|k| samples.ray(k).mino_total).sum();
        assert!((total / expected - 1.0).abs() < 1e-7, "{total} {expected}");
        group.bench_function(format!("{set:?}"), |b| b.iter(|| run(&mut samples)));
    }
    group.finish();
}

/// First equatorial crossings, (t, r, φ), of the same rays, by instruction set, each within 1e-9 of the tracer.
fn crossings(c: &mut Criterion) {
    let screen = Screen::new(true);
    let Screen { hole, observer, alpha, beta, .. } = &screen;
    let mut group = c.benchmark_group("first crossings of 4096 rays, simd");
    group.throughput(Throughput::Elements(4096));
    for set in InstructionSet::ALL.into_iter().filter(|set| set.available()) {
        let mut found = Crossings::default();
        let run = |found: &mut Crossings| {
            found.trace_at(set, hole, observer, alpha, beta, 1).expect("rays");
        };
        run(&mut found);
        assert_crossings(&screen, &found);
        group.bench_function(format!("{set:?}"), |b| b.iter(|| run(&mut found)));
    }
    group.finish();
}

/// Compares every 7th ray with the tracer.
fn assert_crossings(screen: &Screen, found: &Crossings) {
    let tracer = Tracer::new(1e-13).expect("a tolerance");
    screen.follow(&tracer, Quantities::ALL, |k, path| {
        if k % 7 != 0 {
            return;
        }
        let end = path.turning_point().map_or(f64::INFINITY, |(turning, _)| 2.0 * turning);
        let time = path.equatorial_crossings().next().filter(|time| *time < end);
        let crossing = found.ray(k).next();
        assert_eq!(time.is_some(), crossing.is_some(), "ray {k}");
        let (Some(time), Some(crossing)) = (time, crossing) else { return };
        let expected = path.at(time);
        assert!((crossing.radius / expected.radius() - 1.0).abs() < 1e-9, "ray {k}");
        assert!((crossing.azimuth - expected.azimuth).abs() < 1e-9, "ray {k}");
        assert!((crossing.delay / expected.delay - 1.0).abs() < 1e-9, "ray {k}");
    });
}

criterion_group!(benches, methods, requests, pictures, crossings);
criterion_main!(benches);
