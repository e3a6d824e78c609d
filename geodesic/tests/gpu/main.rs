//! The shaders on whatever graphics device there is, against the tracer in doubles.
//!
//! `cargo test --release -p kerrlight-geodesic --features wgpu --test gpu -- --nocapture` prints the errors by class.

mod blocks;
mod classes;
mod compare;
mod paths;

use classes::{Class, classes, critical_factor};
use compare::{Errors, STEPS, quantile};
use kerrlight_geodesic::gpu::{self, GpuError, GpuTracer};
use kerrlight_geodesic::{DeviceRays, DeviceRequest, Inclination, Kerr, Observer, View};
use std::fmt::Display;
use std::io::Write;
use std::sync::{Arc, OnceLock};

/// Says that something is not tested, past the harness, which keeps what passing tests print; with KERRLIGHT_TEST_ALL it
/// fails.
fn skipped(why: impl Display) {
    // What cannot be said is no failure of what was to be tested.
    let _ = writeln!(std::io::stderr(), "SKIPPED: {why}");
    let all = std::env::var_os("KERRLIGHT_TEST_ALL").is_some_and(|value| !value.is_empty());
    assert!(!all, "KERRLIGHT_TEST_ALL: {why}");
}

/// The first device; where there is none a test says so and passes.
fn device() -> Option<Arc<GpuTracer>> {
    static DEVICE: OnceLock<Result<Arc<GpuTracer>, GpuError>> = OnceLock::new();
    let opened = DEVICE
        .get_or_init(|| gpu::adapter(None).and_then(|found| GpuTracer::open(&found).map(Arc::new)));
    if let Err(error) = opened {
        assert_eq!(*error, GpuError::NoAdapter);
        skipped(error);
    }
    opened.as_ref().ok().cloned()
}

/// Prints the errors of a class that half of them, 99 in 100 and all keep, and compares the first two.
fn judge(class: &Class, errors: Errors, allowed: [f64; 2]) {
    let (name, Errors { rays, flagged, wrong, of }) = (class.name, errors);
    println!("{name}: {rays} rays, {flagged} flagged, {wrong} wrong");
    assert!(rays > 0 && !of.is_empty(), "{name}: nothing was compared");
    for (what, mut errors) in of {
        assert!(errors.iter().all(|x| x.is_finite()), "{name}: {what}");
        let [half, most, all] = [0.5, 0.99, 1.0].map(|share| quantile(&mut errors, share));
        println!("    {what:8} {half:8.1e} {most:8.1e} {all:8.1e}");
        assert!(half <= allowed[0] && most <= allowed[1], "{name}: {what}");
    }
    assert_eq!(wrong, 0, "{name}: fates and events");
    assert!(flagged as f64 <= class.flagged * rays as f64, "{name}");
}

#[test]
fn code_errors_by_class() {
    let Some(tracer) = device() else { return };
    for class in classes() {
        let mut errors = Errors::default();
        class.pictures.iter().for_each(|picture| compare::compare(&tracer, picture, &mut errors));
        let mut steps = errors.of.remove(STEPS).unwrap_or_default();
        println!("{} steps, {} at most", quantile(&mut steps, 0.5), quantile(&mut steps, 1.0));
        judge(&class, errors, class.allowed);
    }
}

#[test]
fn code_paths_are_those_of_the_processor() {
    let Some(tracer) = device() else { return };
    for class in classes() {
        let mut errors = Errors::default();
        class.pictures.iter().for_each(|picture| paths::compare(&tracer, picture, &mut errors));
        judge(&class, errors, [2e-7, 5e-6]);
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
