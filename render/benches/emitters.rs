//! Time per ray with 1, 100 and 10,000 hot spots: with the hierarchy and one by one. Both see
//! the same, which is asserted first. `cargo bench -p kerrlight-render --bench emitters`.

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use kerrlight_render::scene::{Scene, Spot};
use kerrlight_render::transport::{PreparedScene, RayResult, Scratch};

const SCENE: &str = r#"
[hole]
spin = 0.9
mass_msun = 4.154e6
distance_kpc = 8.178
[observer]
inclination_deg = 60
[screen]
field_of_view_m = 40.0
width = 16
height = 16
[effects]
redshift = true
spectral_index = 0.0
[tracer]
integrator = "taylor-mino"
tolerance = 1e-7
"#;

/// Spots all over a ball of 16 M that take up the same part of it however many there are.
fn scene(count: u32, slow_light: bool) -> Scene {
    let mut scene = Scene::parse(SCENE).expect("the scene above");
    scene.effects.slow_light = slow_light;
    let part = |k: u32, number: f64| (f64::from(k) * number.sqrt() + 0.3).fract();
    scene.spot = (0..count)
        .map(|k| Spot {
            radius: (64.0 + 4032.0 * part(k, 2.0)).cbrt(),
            phase_deg: 360.0 * part(k, 3.0),
            axis: [part(k, 5.0) - 0.5, part(k, 7.0) - 0.5, part(k, 11.0) - 0.5],
            sigma: 0.3 / f64::from(count).cbrt(),
            peak_emissivity: 1.0,
            sheared_since: None,
            color: [1.0; 3],
        })
        .collect();
    scene
}

/// A grid of side² rays.
fn rays(side: u32) -> (Vec<f64>, Vec<f64>) {
    let along = |k: u32| 40.0 * ((f64::from(k) + 0.5) / f64::from(side) - 0.5);
    (0..side * side).map(|k| (along(k % side), along(k / side))).unzip()
}

fn look(
    prepared: &PreparedScene,
    (alpha, beta): &(Vec<f64>, Vec<f64>),
    scratch: &mut Scratch,
) -> Vec<RayResult> {
    let mut seen = vec![RayResult::default(); alpha.len()];
    prepared
        .observe_block(alpha, beta, &[prepared.time()], scratch, &mut seen)
        .expect("rays of the scene");
    seen
}

fn emitters(criterion: &mut Criterion) {
    for slow_light in [false, true] {
        let name = if slow_light { "emitters, slow light" } else { "emitters, fast light" };
        let mut group = criterion.benchmark_group(name);
        group.sample_size(10);
        group.warm_up_time(std::time::Duration::from_millis(500));
        group.measurement_time(std::time::Duration::from_secs(2));
        for count in [0, 1, 100, 10_000] {
            let prepared =
                PreparedScene::new(&scene(count, slow_light), None).expect("a scene in range");
            let plain = prepared.clone().one_by_one();
            let few = rays(if count > 1000 { 6 } else { 16 });
            let mut scratch = Scratch::default();
            let seen = look(&prepared, &few, &mut scratch);
            assert_eq!(seen, look(&plain, &few, &mut scratch), "{count} spots");
            assert!(count < 100 || seen.iter().any(|ray| ray.intensity > 0.0));
            let many = rays(32);
            group.throughput(Throughput::Elements(many.0.len() as u64));
            group.bench_function(BenchmarkId::new("tree", count), |bench| {
                bench.iter(|| look(&prepared, &many, &mut scratch));
            });
            group.throughput(Throughput::Elements(few.0.len() as u64));
            group.bench_function(BenchmarkId::new("one by one", count), |bench| {
                bench.iter(|| look(&plain, &few, &mut scratch));
            });
        }
        group.finish();
    }
}

criterion_group!(benches, emitters);
criterion_main!(benches);
