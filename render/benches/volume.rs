//! Drawing a volume: six views of 256 × 256 rays through 64³ nodes, and comparing two such volumes.

use criterion::{Criterion, criterion_group, criterion_main};
use kerrlight_render::volume::Volume;
use kerrlight_render::volume::metrics::compare;
use kerrlight_render::volume::projection::{Surroundings, View, project};

fn volume() -> Volume {
    let new = |values| Volume::new([64; 3], [-5.0; 3], [5.0; 3], values).unwrap();
    let empty = new(vec![0.0; 64 * 64 * 64]);
    let light = |k| (-empty.position(k).iter().map(|x| x * x).sum::<f64>() / 8.0).exp() as f32;
    new((0..64 * 64 * 64).map(light).collect())
}

fn drawing(c: &mut Criterion) {
    let volume = volume();
    let around =
        Surroundings { hole_radius: 2.0, axis: [0.0, 0.0, 1.0], ring_radius: 5.0, half_width: 5.5 };
    c.bench_function("six views of 256 x 256", |b| {
        b.iter(|| {
            (0..6).for_each(|k| {
                let view = View { azimuth: 60.0 * f64::from(k), elevation: 20.0 };
                std::hint::black_box(project(&volume, view, &around, 256));
            });
        });
    });
    c.bench_function("compare 64 x 64 x 64", |b| b.iter(|| compare(&volume, &volume, None)));
}

criterion_group!(benches, drawing);
criterion_main!(benches);
