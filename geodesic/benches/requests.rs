//! Cost of a ray by what is requested of it: 64 × 64 rays, α, β ∈ [−8, 8], i = 60°, a = 0.94,
//! taylor-mino at 1e-9. Every benchmark asserts its answer first.
//!
//! `cargo bench -p kerrlight-geodesic --bench requests` (with `RAYON_NUM_THREADS=1` for one core)

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use kerrlight_geodesic::{
    Inclination, Integrator, Kerr, Observer, Placement, RayTable, Request, derivatives, footprint,
};
use std::hint::black_box;

/// Tolerance of everything that is measured.
const TOLERANCE: f64 = 1e-9;

struct Screen {
    hole: Kerr,
    observer: Observer,
    alpha: Vec<f64>,
    beta: Vec<f64>,
}

impl Screen {
    fn new() -> Self {
        let inclination = Inclination::from_degrees(60.0).expect("an inclination");
        let at = |k: usize| -8.0 + 16.0 * k as f64 / 63.0;
        let (alpha, beta) = (0..64 * 64).map(|k| (at(k % 64), at(k / 64))).unzip();
        let hole = Kerr::new(0.94).expect("a spin");
        Screen { hole, observer: Observer::at_infinity(inclination), alpha, beta }
    }

    fn trace(&self, tolerance: f64, request: &Request) -> RayTable {
        let Screen { hole, observer, alpha, beta } = self;
        let traced = Integrator::TaylorMino.trace(hole, observer, alpha, beta, tolerance, request);
        traced.expect("rays")
    }

    fn differentiate(&self, request: &Request) -> derivatives::Differentiated {
        let Screen { hole, observer, alpha, beta } = self;
        derivatives::trace(hole, observer, alpha, beta, TOLERANCE, request).expect("rays")
    }
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

fn run(c: &mut Criterion, name: &str, first: Request) {
    let screen = Screen::new();
    let mut group = c.benchmark_group(name);
    group.throughput(Throughput::Elements(screen.alpha.len() as u64)).sample_size(10);
    for (name, request) in ladder(first) {
        agree(&screen.trace(TOLERANCE, &request), &screen.trace(1e-13, &request));
        group.bench_function(name, |b| b.iter(|| black_box(screen.trace(TOLERANCE, &request))));
    }
    // Derivatives of positions, azimuth and time.
    let request = Request { azimuth: true, time: true, ..first };
    let exact = screen.trace(1e-13, &request);
    agree(&screen.differentiate(&request).values, &exact);
    group.bench_function("derivatives of (time, r, theta, azimuth)", |b| {
        b.iter(|| black_box(screen.differentiate(&request)));
    });
    group.finish();
}

fn crossings(c: &mut Criterion) {
    let first = Request { crossings: 1, ..Request::default() };
    run(c, "4096 rays, first equatorial crossing", first);
}

fn samples(c: &mut Criterion) {
    let samples = Placement::GaussLegendre { points: 16, from: 2.0, to: 50.0 };
    run(c, "4096 rays, 16 nodes a passage", Request { samples, ..Request::default() });
}

fn placements(c: &mut Criterion) {
    let screen = Screen::new();
    let mut group = c.benchmark_group("4096 rays, positions of 32 samples");
    group.throughput(Throughput::Elements(screen.alpha.len() as u64)).sample_size(10);
    for (name, samples) in [
        ("Mino time", Placement::MinoTime(32)),
        ("path length", Placement::PathLength { points: 32, radius: 50.0 }),
    ] {
        let request = Request { samples, ..Request::default() };
        let (found, exact) = (screen.trace(TOLERANCE, &request), screen.trace(1e-13, &request));
        assert_eq!((found.samples.len(), &found.outcome), (exact.samples.len(), &exact.outcome));
        group.bench_function(name, |b| b.iter(|| black_box(screen.trace(TOLERANCE, &request))));
    }
    group.finish();
}

fn footprints(c: &mut Criterion) {
    let Screen { hole, observer, alpha, beta } = Screen::new();
    let run = |crossings| {
        footprint::of_screen(&hole, &observer, &alpha, &beta, TOLERANCE, crossings).expect("rays")
    };
    let beams = run(1);
    let escaped = beams.sky.iter().flatten().count();
    let captured = beams.outcome.iter().filter(|o| o.name() == "captured").count();
    assert_eq!(escaped + captured, 4096);
    let mut group = c.benchmark_group("4096 rays, footprints");
    group.throughput(Throughput::Elements(4096)).sample_size(10);
    group.bench_function("sky and first crossing", |b| b.iter(|| black_box(run(1))));
    group.finish();
}

criterion_group!(benches, crossings, samples, placements, footprints);
criterion_main!(benches);
