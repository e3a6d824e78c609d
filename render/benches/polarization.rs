//! Cost of the polarisation at a point of a ray: `cargo bench -p kerrlight-render -- polarization`.

use criterion::{Criterion, criterion_group, criterion_main};
use kerrlight_geodesic::{
    Inclination, Kerr, Observer, Path, Quantities, ScreenPoint, Tracer, ZamoFrame,
};
use kerrlight_render::polarization::{Gas, MagneticField, PowerLaw, view, view_at};
use std::hint::black_box;

fn polarization(c: &mut Criterion) {
    let hole = Kerr::new(0.94).unwrap();
    let inclination = Inclination::from_degrees(60.0).unwrap();
    let ray = Observer::at_infinity(inclination).ray(&hole, -6.0, 2.0).unwrap();
    let mut path = Path::new();
    Tracer::new(1e-12).unwrap().trace(&hole, &ray, Quantities::ALL, &mut path);
    let point = path.at(0.4 * path.mino_total());
    let screen = ScreenPoint::new(&hole, inclination.sin(), -6.0, 2.0);
    let momentum = point.momentum(&hole, ray.lambda);
    let field = MagneticField { vertical: 0.4, radial: -0.6, toroidal: 0.7 };
    let frame = ZamoFrame::of(&hole, &point).unwrap();
    let photon = frame.covariant(momentum);
    let gas = Gas::boosted(0.4, -1.2).unwrap();
    let velocity = frame.to_coordinates(gas.0);
    let place = [point.radius(), point.cos_theta()];
    let seen = view(&frame, &screen, photon, gas, field.at(&frame)).unwrap();
    // The angle that is timed is one of a polarised photon.
    assert!((seen.direction[0].hypot(seen.direction[1]) - 1.0).abs() < 1e-12);
    let mut group = c.benchmark_group("polarization");
    group.bench_function("view, frame known", |b| {
        b.iter(|| view(black_box(&frame), &screen, black_box(photon), gas, field.at(&frame)));
    });
    group.bench_function("view_at, from Boyer-Lindquist components", |b| {
        b.iter(|| view_at(&hole, &screen, black_box(place), black_box(momentum), velocity, &field));
    });
    for (name, index, gamma) in
        [("I, Q, U, index 1", 1.0, None), ("I, Q, U, V, index 0.7", 0.7, Some(300.0))]
    {
        let law = PowerLaw::new(index, gamma).unwrap();
        group.bench_function(name, |b| b.iter(|| law.of_volume(black_box(&seen))));
    }
    group.finish();
}

criterion_group!(benches, polarization);
criterion_main!(benches);
