//! Cost of the direct Fourier transform of a movie and of its adjoint, for a fit to ngEHT data; the
//! dot-product test comes first, so that nothing wrong is timed.

use criterion::{Criterion, criterion_group, criterion_main};
use kerrlight_common::units::MICROARCSECOND;
use kerrlight_vlbi::array::built_in;
use kerrlight_vlbi::earth::{Frame, SourcePosition, Ut1};
use kerrlight_vlbi::operator::{Dtft, Float, ImageGrid, Nufft, Operator, Pulse};
use kerrlight_vlbi::schedule::{Clock, Schedule, Setup, observe};
use num_complex::Complex;
use std::hint::black_box;

const FRAMES: u32 = 64;
const PIXELS: usize = 64;

/// (u, v) of Sgr A* with ngEHT, a list a frame.
fn frames() -> Vec<Vec<[f64; 2]>> {
    let schedule =
        Schedule { mjd: 57850, clock: Clock::Utc, start_h: 4.0, stop_h: 15.5, scans: FRAMES };
    let setup = Setup {
        frequency_hz: 226_191_789_062.5,
        bandwidth_hz: 1.856e9,
        integration_s: 60.0,
        elevation_deg: [10.0, 85.0],
        ut1: Ut1::Table,
        frame: Frame::Catalogue,
    };
    let array = built_in("ngEHT").expect("a built-in array");
    let rows = observe(&array, SourcePosition::SGR_A, &schedule, &setup).expect("rows").rows;
    let of = |time: f64| rows.iter().filter(move |row| row.time_h == time).map(|row| row.uv);
    schedule.hours().map(|time| of(time).collect()).collect()
}

fn measure<T: Float>(criterion: &mut Criterion, name: &str, tolerance: f64, budget: usize) {
    let grid = ImageGrid::new(PIXELS, PIXELS, 85.0 * MICROARCSECOND).expect("a grid");
    let operator = Dtft::<T>::new(grid, Pulse::Triangle, &frames(), budget);
    let count = FRAMES as usize * grid.pixels();
    let movie: Vec<T> = (0..count).map(|k| T::of((k as f64).sin() + 1.0)).collect();
    let mut data = vec![Complex::new(T::zero(), T::zero()); operator.data()];
    let mut back = vec![T::zero(); count];
    operator.forward(&movie, &mut data);
    operator.adjoint(&data, &mut back);
    let norm: f64 = data.iter().map(|v| v.norm_sqr().double()).sum();
    let dot: f64 = back.iter().zip(&movie).map(|(a, b)| a.double() * b.double()).sum();
    assert!((dot / norm - 1.0).abs() < tolerance, "{dot} {norm}");
    let megabytes = operator.memory_kept() as f64 / 1e6;
    println!("{name}: {} visibilities, {megabytes:.1} MB kept", operator.data());
    criterion.bench_function(name, |bencher| {
        bencher.iter(|| {
            operator.forward(black_box(&movie), &mut data);
            operator.adjoint(&data, &mut back);
        });
    });
}

fn benches(criterion: &mut Criterion) {
    measure::<f32>(criterion, "ngEHT 64 x 64 x 64 frames, f32", 1e-4, usize::MAX);
    measure::<f64>(criterion, "ngEHT 64 x 64 x 64 frames, f64", 1e-12, usize::MAX);
    measure::<f64>(criterion, "ngEHT 64 x 64 x 64 frames, f64, nothing kept", 1e-12, 0);
}

/// One frame of `pixels`² and random (u, v): the direct transform against the fast one.
fn single(criterion: &mut Criterion, pixels: usize, visibilities: usize) {
    let grid = ImageGrid::new(pixels, pixels, 160.0 * MICROARCSECOND).expect("a grid");
    let at = |k: usize| [(k as f64).sin() * 1e10, (k as f64 * 1.7).cos() * 1e10];
    let uv = vec![(0..visibilities).map(at).collect::<Vec<_>>()];
    let movie: Vec<f64> = (0..grid.pixels()).map(|k| (k as f64).sin() + 1.0).collect();
    let mut back = vec![0.0; movie.len()];
    let mut run = |name: &str, operator: &dyn Operator<f64>| {
        let mut data = vec![Complex::new(0.0, 0.0); visibilities];
        let name = format!("{pixels} x {pixels} pixels, {visibilities} visibilities, {name}");
        criterion.bench_function(&name, |bencher| {
            bencher.iter(|| {
                operator.forward(black_box(&movie), &mut data);
                operator.adjoint(&data, &mut back);
            });
        });
    };
    run("direct, kept", &Dtft::<f64>::new(grid, Pulse::Triangle, &uv, usize::MAX));
    run("direct", &Dtft::<f64>::new(grid, Pulse::Triangle, &uv, 0));
    for accuracy in [1e-6, 1e-10] {
        let fast = Nufft::new(grid, Pulse::Triangle, &uv, accuracy).expect("an accuracy");
        run(&format!("fast, {accuracy:e}"), &fast);
    }
}

fn sizes(criterion: &mut Criterion) {
    for (pixels, visibilities) in [(64, 100), (256, 100), (256, 1000), (1024, 100), (1024, 10_000)]
    {
        single(criterion, pixels, visibilities);
    }
}

criterion_group!(all, benches, sizes);
criterion_main!(all);
