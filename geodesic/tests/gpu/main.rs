//! The shaders on whatever graphics device there is, against the tracer in doubles.
//!
//! `cargo test --release -p kerrlight-geodesic --features wgpu --test gpu -- --nocapture` prints the errors by class.

mod blocks;
mod classes;
mod compare;
mod paths;

use classes::{Class, classes, critical_factor};
use compare::{Errors, compare, quantile};
use kerrlight_geodesic::gpu::{self, GpuError, GpuTracer};
use kerrlight_geodesic::{DeviceRays, DeviceRequest, Inclination, Kerr, Observer, View};
use std::sync::{Arc, OnceLock};

/// The first device; where there is none a test says so and passes.
fn device() -> Option<Arc<GpuTracer>> {
    static DEVICE: OnceLock<Result<Arc<GpuTracer>, GpuError>> = OnceLock::new();
    let opened = DEVICE
        .get_or_init(|| gpu::adapter(None).and_then(|found| GpuTracer::open(&found).map(Arc::new)));
    if let Err(error) = opened {
        assert_eq!(*error, GpuError::NoAdapter);
        eprintln!("SKIPPED, nothing was tested: {error}");
    }
    opened.as_ref().ok().cloned()
}

fn print(class: &Class, errors: &mut Errors) {
    let steps = quantile(&mut errors.steps, 0.5);
    let most = quantile(&mut errors.steps, 1.0);
    let Errors { rays, flagged, wrong, .. } = errors;
    println!(
        "{}: {rays} rays, {flagged} flagged, {wrong} wrong, {steps} steps ({most} at most)",
        class.name
    );
    for (name, values) in errors.columns() {
        let [half, most, all] = [0.5, 0.99, 1.0].map(|share| quantile(values, share));
        println!("    {name:8} {half:8.1e} {most:8.1e} {all:8.1e}");
    }
}

#[test]
fn code_errors_by_class() {
    let Some(tracer) = device() else { return };
    for class in classes() {
        let mut errors = Errors::default();
        class.pictures.iter().for_each(|picture| compare(&tracer, picture, &mut errors));
        print(&class, &mut errors);
        assert_eq!(errors.wrong, 0, "{}: fates", class.name);
        assert!(errors.flagged as f64 <= class.flagged * errors.rays as f64, "{}", class.name);
        for (name, values) in errors.columns() {
            for (share, allowed) in [0.5, 0.99].into_iter().zip(class.allowed) {
                let error = quantile(values, share);
                assert!(error <= allowed, "{}: {name}, {share}: {error:e}", class.name);
            }
        }
    }
}

#[test]
fn code_paths_are_those_of_the_processor() {
    let Some(tracer) = device() else { return };
    for class in classes() {
        let mut errors = paths::compare(&tracer, &class);
        println!(
            "{}: {} rays, {} unknown, {} wrong",
            class.name, errors.rays, errors.unknown, errors.wrong
        );
        for (name, values) in errors.columns() {
            let [half, most, all] = [0.5, 0.99, 1.0].map(|share| quantile(values, share));
            println!("    {name:8} {half:8.1e} {most:8.1e} {all:8.1e}");
        }
        assert_eq!(errors.wrong, 0, "{}: fates and events", class.name);
        assert!(errors.unknown as f64 <= class.flagged * errors.rays as f64, "{}", class.name);
        for (name, values) in errors.columns() {
            for (share, allowed) in [(0.5, 2e-7), (0.99, 5e-6)] {
                let error = quantile(values, share);
                assert!(error <= allowed, "{}: {name}, {share}: {error:e}", class.name);
            }
        }
    }
}

/// Ever closer to the critical curve: the fate is right as long as the ray is not flagged, and at 1e-13 it is flagged.
#[test]
fn code_near_critical_rays_are_flagged_not_wrong() {
    let Some(tracer) = device() else { return };
    let mut rays = DeviceRays::default();
    for (spin, degrees) in [(0.0, 60.0), (0.94, 17.0), (0.998, 85.0)] {
        let hole = Kerr::new(spin).unwrap();
        let view = View::Screen(Observer::at_infinity(Inclination::from_degrees(degrees).unwrap()));
        let (mut x, mut y, mut inside) = (Vec::new(), Vec::new(), Vec::new());
        for turn in 0..24 {
            let (sin, cos) = (f64::from(turn) * 0.261).sin_cos();
            let factor = critical_factor(&hole, &view, (cos, sin));
            for power in 1..14 {
                for sign in [-1.0, 1.0] {
                    let s = factor * (1.0 + sign * 10f64.powi(-power));
                    x.push(s * cos);
                    y.push(s * sin);
                    inside.push(sign < 0.0);
                }
            }
        }
        tracer.trace(&hole, &view, (&x, &y), &DeviceRequest::default(), &mut rays).unwrap();
        for (k, end) in rays.ends().iter().enumerate() {
            let power = (k / 2) % 13 + 1;
            let captured = end.outcome == kerrlight_geodesic::Outcome::Captured;
            assert!(!end.is_trusted || captured == inside[k], "1e-{power}: {end:?}");
            assert!(end.is_trusted || power > 6, "1e-{power}: {end:?}");
            assert!(!end.is_trusted || power < 12, "1e-{power}: {end:?}");
        }
    }
}

#[test]
fn code_blocks_on_a_device_are_those_without() {
    let Some(tracer) = device() else { return };
    blocks::compare(tracer);
}

#[test]
fn code_many_nodes_of_a_ray_are_all_there() {
    let Some(tracer) = device() else { return };
    blocks::many_nodes(tracer);
}
