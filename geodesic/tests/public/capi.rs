//! The functions for C, called from Rust where misuse is concerned, and from a compiled C program.
#![cfg(feature = "capi")]

use crate::{at_infinity, inclination};
use kerrlight_geodesic::analytic::CriticalCurve;
use kerrlight_geodesic::capi::{self, PointColumns, RayColumns, SamplePlacement, Scene};
use kerrlight_geodesic::{
    Camera, Integrator, Kerr, Motion, Outcome, Placement, Quantities, RayTable, Request, Tracer,
};
use std::fmt::Display;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::ptr::{null, null_mut};

const NOTHING: PointColumns = PointColumns {
    stride: 0,
    count: null_mut(),
    mino_time: null_mut(),
    radius: null_mut(),
    theta: null_mut(),
    azimuth: null_mut(),
    delay: null_mut(),
    momentum: null_mut(),
    weight: null_mut(),
};

const NO_RAYS: RayColumns = RayColumns {
    outcome: null_mut(),
    mino_total: null_mut(),
    turning_radius: null_mut(),
    crossing_count: null_mut(),
    uncertainty: null_mut(),
    crossings: NOTHING,
    samples: NOTHING,
};

const SCENE: Scene = Scene {
    spin: 0.94,
    inclination_degrees: 60.0,
    observer_radius: f64::INFINITY,
    tolerance: 1e-10,
    integrator: 0,
};

const ALPHA: [f64; 3] = [-6.0, 0.5, 8.0];
const BETA: [f64; 3] = [2.0, 0.5, -3.0];

fn call(scene: &Scene, placement: *const SamplePlacement, out: &RayColumns) -> i32 {
    // SAFETY: the columns of every test below are null or long enough.
    unsafe { capi::kerrlight_trace(scene, 3, ALPHA.as_ptr(), BETA.as_ptr(), placement, out) }
}

fn message() -> String {
    let mut buffer = [0u8; 256];
    // SAFETY: a buffer of that size.
    let length = unsafe { capi::kerrlight_last_error(buffer.as_mut_ptr().cast(), buffer.len()) };
    String::from_utf8(buffer[..length].to_vec()).unwrap()
}

/// The rays of the test below, traced by a call from Rust.
fn from_rust() -> RayTable {
    let hole = Kerr::new(0.94).unwrap();
    let request = Request {
        crossings: 2,
        samples: Placement::GaussLegendre { points: 4, from: 4.0, to: 20.0 },
        azimuth: true,
        momentum: true,
        weight: true,
        uncertainty: true,
        ..Request::default()
    };
    Integrator::TaylorMino.trace(&hole, &at_infinity(60.0), &ALPHA, &BETA, 1e-10, &request).unwrap()
}

#[test]
fn exact_same_columns_as_from_rust() {
    let (mut outcome, mut total) = ([9i32; 3], [0.0; 3]);
    let (mut crossed, mut doubt) = ([0u32; 3], [0.0; 12]);
    let (mut count, mut radius, mut azimuth) = ([0u32; 3], [0.0; 6], [0.0; 6]);
    let (mut number, mut r, mut weight) = ([0u32; 3], [0.0; 24], [0.0; 24]);
    let mut momentum = [0.0; 96];
    let out = RayColumns {
        outcome: outcome.as_mut_ptr(),
        mino_total: total.as_mut_ptr(),
        crossing_count: crossed.as_mut_ptr(),
        uncertainty: doubt.as_mut_ptr(),
        crossings: PointColumns {
            stride: 2,
            count: count.as_mut_ptr(),
            radius: radius.as_mut_ptr(),
            azimuth: azimuth.as_mut_ptr(),
            ..NOTHING
        },
        samples: PointColumns {
            stride: 8,
            count: number.as_mut_ptr(),
            radius: r.as_mut_ptr(),
            weight: weight.as_mut_ptr(),
            momentum: momentum.as_mut_ptr(),
            ..NOTHING
        },
        ..NO_RAYS
    };
    let placement = SamplePlacement { kind: 3, points: 4, from: 4.0, to: 20.0 };
    assert_eq!(call(&SCENE, &placement, &out), capi::OK, "{}", message());

    let rust = from_rust();
    for ray in 0..3 {
        assert_eq!(outcome[ray] == 0, rust.outcome[ray] == Outcome::Captured);
        assert_eq!((total[ray], crossed[ray]), (rust.mino_total[ray], rust.crossing_count[ray]));
        assert_eq!(doubt[4 * ray], rust.uncertainty[ray].radius);
        let found = rust.crossings.of(ray);
        assert_eq!(count[ray] as usize, found.len());
        for k in 0..2 {
            let column = |c: &[f64]| found.clone().nth(k).map_or(f64::NAN, |k| c[k]).to_bits();
            assert_eq!(radius[2 * ray + k].to_bits(), column(&rust.crossings.radius));
            assert_eq!(azimuth[2 * ray + k].to_bits(), column(&rust.crossings.azimuth));
        }
        let (found, samples) = (rust.samples.of(ray), &rust.samples);
        assert_eq!(number[ray] as usize, found.len());
        for (here, place) in (8 * ray..).zip(found) {
            assert_eq!((r[here], weight[here]), (samples.radius[place], samples.weight[place]));
            assert_eq!(momentum[4 * here..4 * here + 4], samples.momentum[place]);
        }
        assert!(r[8 * ray + number[ray] as usize..8 * (ray + 1)].iter().all(|x| x.is_nan()));
    }
}

#[test]
fn misuse_returns_a_code_and_a_message() {
    let mut outcome = [7i32; 3];
    let out = RayColumns { outcome: outcome.as_mut_ptr(), ..NO_RAYS };
    let (a, b) = (ALPHA.as_ptr(), BETA.as_ptr());
    // SAFETY: null pointers are what is tested; the others are valid.
    let codes = unsafe {
        [
            capi::kerrlight_trace(null(), 3, a, b, null(), &out),
            capi::kerrlight_trace(&SCENE, 3, null(), b, null(), &out),
            capi::kerrlight_trace(&SCENE, 3, a, null(), null(), &out),
            capi::kerrlight_trace(&SCENE, 3, a, b, null(), null()),
        ]
    };
    assert_eq!(codes, [capi::NULL_POINTER; 4]);
    assert!(message().contains("out is null"), "{}", message());
    // SAFETY: no rays, so nothing is read or written.
    assert_eq!(unsafe { capi::kerrlight_trace(&SCENE, 0, null(), null(), null(), &NO_RAYS) }, 0);

    let cases = [
        (Scene { spin: 1.5, ..SCENE }, "spin = 1.5"),
        (Scene { inclination_degrees: f64::NAN, ..SCENE }, "inclination = NaN"),
        (Scene { observer_radius: 1.0, ..SCENE }, "observer radius = 1"),
        (Scene { tolerance: 0.0, ..SCENE }, "tolerance = 0"),
        (Scene { integrator: 17, ..SCENE }, "integrator = 17"),
        (Scene { integrator: -1, ..SCENE }, "integrator = -1"),
    ];
    for (scene, text) in cases {
        assert_eq!(call(&scene, null(), &out), capi::OUT_OF_RANGE);
        assert!(message().contains(text), "{}", message());
    }
    let wide = RayColumns { crossings: PointColumns { stride: usize::MAX, ..NOTHING }, ..NO_RAYS };
    assert_eq!(call(&SCENE, null(), &wide), capi::OUT_OF_RANGE);
    let placement = SamplePlacement { kind: 3, points: 5, from: 3.0, to: 9.0 };
    let tight = RayColumns { samples: PointColumns { stride: 9, ..NOTHING }, ..NO_RAYS };
    assert_eq!(call(&SCENE, &placement, &tight), capi::NO_ROOM);
    assert!(message().contains("samples.stride"));
    let strange = SamplePlacement { kind: 4, ..placement };
    assert_eq!(call(&SCENE, &strange, &tight), capi::OUT_OF_RANGE);
    assert_eq!(outcome, [7; 3], "no array is touched by a call that fails");

    // A short buffer gets the beginning, ended by 0.
    let mut short = [1u8; 5];
    // SAFETY: a buffer of that size.
    let length = unsafe { capi::kerrlight_last_error(short.as_mut_ptr().cast(), 5) };
    assert_eq!((length, &short), (message().len(), b"plac\0"));
    // SAFETY: nothing is written.
    assert_eq!(unsafe { capi::kerrlight_last_error(null_mut(), 0) }, length);
}

fn folder() -> PathBuf {
    PathBuf::from(env!("CARGO_TARGET_TMPDIR"))
}

/// Says that something is not tested, past the harness, which keeps what passing tests print; with KERRLIGHT_TEST_ALL it
/// fails.
fn skipped(why: impl Display) {
    // What cannot be said is no failure of what was to be tested.
    let _ = writeln!(std::io::stderr(), "SKIPPED: {why}");
    let all = std::env::var_os("KERRLIGHT_TEST_ALL").is_some_and(|value| !value.is_empty());
    assert!(!all, "KERRLIGHT_TEST_ALL: {why}");
}

/// A C compiler, if there is one here.
fn compiler() -> Option<String> {
    let cc = std::env::var("CC").unwrap_or_else(|_| "cc".to_owned());
    if !cfg!(unix) || Command::new(&cc).arg("--version").output().is_err() {
        skipped(format_args!("there is no C compiler `{cc}`"));
        return None;
    }
    Some(cc)
}

fn output(command: &mut Command) -> String {
    let output = command.output().expect("the command starts");
    let text = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{command:?}\n{text}");
    String::from_utf8(output.stdout).expect("text")
}

fn compile(cc: &str, source: &Path, library: Option<&Path>, program: &Path) {
    let mut command = Command::new(cc);
    command.args(["-std=c99", "-pedantic", "-Wall", "-Wextra", "-Werror"]);
    command.arg(format!("-I{}/include", env!("CARGO_MANIFEST_DIR"))).arg(source);
    if let Some(library) = library {
        command.arg(library).args(["-lpthread", "-ldl", "-lm"]);
    }
    output(command.arg("-o").arg(program));
}

/// The structures of the header are those of the module, byte for byte.
#[test]
fn exact_layout_of_the_header() {
    let Some(cc) = compiler() else { return };
    let source = folder().join("layout.c");
    let program = folder().join("layout");
    let text = r#"
        #include "kerrlight.h"
        #include <stdio.h>
        #define SIZE(x) printf("%zu ", sizeof(x))
        #define AT(x, y) printf("%zu ", offsetof(x, y))
        int main(void)
        {
            SIZE(kerrlight_scene), AT(kerrlight_scene, integrator);
            SIZE(kerrlight_placement), AT(kerrlight_placement, points), AT(kerrlight_placement, to);
            SIZE(kerrlight_points), AT(kerrlight_points, count), AT(kerrlight_points, weight);
            SIZE(kerrlight_rays), AT(kerrlight_rays, crossings), AT(kerrlight_rays, samples);
            printf("%d %d", KERRLIGHT_INTERNAL, KERRLIGHT_NO_ROOM);
            return 0;
        }"#;
    std::fs::write(&source, text).unwrap();
    compile(&cc, &source, None, &program);
    use std::mem::{offset_of, size_of};
    let expected = [
        size_of::<Scene>(),
        offset_of!(Scene, integrator),
        size_of::<SamplePlacement>(),
        offset_of!(SamplePlacement, points),
        offset_of!(SamplePlacement, to),
        size_of::<PointColumns>(),
        offset_of!(PointColumns, count),
        offset_of!(PointColumns, weight),
        size_of::<RayColumns>(),
        offset_of!(RayColumns, crossings),
        offset_of!(RayColumns, samples),
        capi::INTERNAL as usize,
        capi::NO_ROOM as usize,
    ];
    let expected = expected.map(|x| x.to_string()).join(" ");
    assert_eq!(output(&mut Command::new(program)), expected);
}

/// The static library as the README says it is made.
fn library() -> PathBuf {
    let target = folder().join("capi-library");
    let mut cargo = Command::new(env!("CARGO"));
    cargo.current_dir(env!("CARGO_MANIFEST_DIR")).env_remove("CARGO_BUILD_TARGET");
    cargo.args(["rustc", "--lib", "--offline", "--no-default-features", "--features", "capi"]);
    cargo.args(["--crate-type", "staticlib", "--target-dir"]).arg(&target);
    output(&mut cargo);
    target.join("debug/libkerrlight_geodesic.a")
}

/// Returns the output of examples/c/shadow.c, from Rust.
fn expected_picture() -> (String, Vec<[f64; 3]>) {
    let hole = Kerr::new(0.998).unwrap();
    let place = |k: i32| (0.25 * f64::from(k % 60) - 5.5, 6.0 - 0.5 * f64::from(k / 60));
    let (alpha, beta): (Vec<f64>, Vec<f64>) = (0..25 * 60).map(place).unzip();
    let tracer = Integrator::TaylorMino;
    let rays =
        tracer.trace(&hole, &at_infinity(90.0), &alpha, &beta, 1e-6, &Request::default()).unwrap();
    let mut picture = String::new();
    for (k, outcome) in rays.outcome.iter().enumerate() {
        let lensed = rays.crossing_count[k] > 1;
        picture.push(if *outcome == Outcome::Captured {
            ' '
        } else {
            ['.', 'o'][usize::from(lensed)]
        });
        if k % 60 == 59 {
            picture.push('\n');
        }
    }
    let one = tracer
        .trace(&hole, &at_infinity(60.0), &[-5.5], &[1.0], 1e-12, &Request::crossings(3))
        .unwrap()
        .crossings;
    let row = |k: usize| [one.radius[k], one.azimuth[k], one.delay[k]];
    (picture, (0..one.len()).map(row).collect())
}

#[test]
fn exact_c_example_prints_what_rust_finds() {
    let Some(cc) = compiler() else { return };
    let program = folder().join("shadow");
    let source = Path::new(env!("CARGO_MANIFEST_DIR")).join("examples/c/shadow.c");
    compile(&cc, &source, Some(&library()), &program);
    let printed = output(&mut Command::new(program));
    let (picture, rows) = expected_picture();
    let rest = printed.strip_prefix(&picture).expect("the same picture");
    assert!(picture.contains("  ") && picture.contains('o') && !rows.is_empty());
    let lines: Vec<&str> = rest.lines().collect();
    assert_eq!(lines.len(), rows.len(), "{rest}");
    for (line, row) in lines.iter().zip(rows) {
        let numbers = line.split([' ', ',']).filter_map(|word| word.parse::<f64>().ok());
        let numbers: Vec<f64> = numbers.collect();
        assert_eq!(numbers.len(), 3, "{line}");
        for (number, expected) in numbers.iter().zip(row) {
            assert!((number - expected).abs() <= 1e-14 * expected.abs().max(1.0), "{line}");
        }
    }
}

/// Returns the output of examples/c/sky.c: the picture, the shift ahead, the width of the shadow, and the redshift of
/// an orbit.
fn expected_sky() -> (String, [f64; 3]) {
    let hole = Kerr::new(0.9).unwrap();
    let place = inclination(85.0);
    let camera = Camera::new(&hole, place, 12.0, Motion::FreeFall).unwrap();
    let point = |k: i32| (0.04 * f64::from(k % 61 - 30), 0.08 * f64::from(10 - k / 61));
    let (x, y): (Vec<f64>, Vec<f64>) = (0..21 * 61).map(point).unzip();
    let mut picture = String::new();
    let mut path = kerrlight_geodesic::Path::new();
    for (k, (x, y)) in x.iter().zip(&y).enumerate() {
        let ray = camera.ray(*x, *y).unwrap();
        Tracer::new(1e-8).unwrap().trace(&hole, &ray, Quantities::ALL, &mut path);
        let [a, b, _] = path.at(path.mino_total()).direction;
        let even = (b.atan2(a) / 0.3).floor() as i64 % 2 == 0;
        let escapes = path.outcome() == Outcome::Escaped;
        picture.push(if escapes { ['#', '.'][usize::from(even)] } else { ' ' });
        picture.push_str(if k % 61 == 60 { "\n" } else { "" });
    }
    let curve = CriticalCurve::new(&hole, place);
    let alpha = |k: u32| curve.point(std::f64::consts::TAU * f64::from(k) / 360.0).alpha;
    let (left, right) =
        (0..360).map(alpha).fold((0.0f64, 0.0f64), |(l, r), a| (l.min(a), r.max(a)));
    // Ω = 1/(r^{3/2} + a) and u^t by the metric.
    let (r, a) = (6.0f64, 0.9f64);
    let rate = 1.0 / (r.powf(1.5) + a);
    let norm = 1.0 - 2.0 / r + 4.0 * a * rate / r - (r * r + a * a + 2.0 * a * a / r) * rate * rate;
    let shift = camera.blueshift(camera.direction(0.0, 0.0));
    (picture, [shift, right - left, norm.sqrt() / (1.0 - 4.0 * rate)])
}

#[test]
fn exact_c_sky_prints_what_rust_finds() {
    let Some(cc) = compiler() else { return };
    let program = folder().join("sky");
    let source = Path::new(env!("CARGO_MANIFEST_DIR")).join("examples/c/sky.c");
    compile(&cc, &source, Some(&library()), &program);
    let printed = output(&mut Command::new(program));
    let (picture, numbers) = expected_sky();
    let rest = printed.strip_prefix(&picture).expect("the same picture");
    assert!(["  ", "#", "."].iter().all(|mark| picture.contains(mark)), "{picture}");
    for (line, expected) in rest.lines().zip(numbers) {
        let number =
            line.split(' ').find_map(|word| word.parse::<f64>().ok().filter(|x| x.fract() != 0.0));
        assert!((number.unwrap() - expected).abs() < 1e-4, "{line}: {expected}");
    }
    assert_eq!(rest.lines().count(), 3);
}

#[test]
fn misuse_of_sky_functions_returns_a_code_and_a_message() {
    use kerrlight_geodesic::capi::{
        CameraPlace, SkyColumns, kerrlight_critical_curve, kerrlight_keplerian_redshift,
        kerrlight_sky,
    };
    let place = CameraPlace {
        radius: 12.0,
        inclination_degrees: 80.0,
        azimuth: 0.0,
        yaw: 0.0,
        pitch: 0.0,
        roll: 0.0,
        motion: 1,
    };
    let (mut outcome, mut direction) = ([7i32; 3], [7.0; 9]);
    let out = SkyColumns {
        outcome: outcome.as_mut_ptr(),
        direction: direction.as_mut_ptr(),
        blueshift: null_mut(),
    };
    let (a, b) = (ALPHA.as_ptr(), BETA.as_ptr());
    for (camera, field) in [
        (CameraPlace { radius: 1.0, ..place }, "camera radius"),
        (CameraPlace { motion: 9, ..place }, "motion"),
        (CameraPlace { yaw: f64::NAN, ..place }, "yaw"),
        (CameraPlace { azimuth: f64::INFINITY, ..place }, "azimuth"),
        (CameraPlace { inclination_degrees: 200.0, ..place }, "inclination"),
    ] {
        // SAFETY: columns of three rays.
        let code = unsafe { kerrlight_sky(&SCENE, &camera, 3, a, b, &out) };
        assert_eq!((code, message().contains(field)), (capi::OUT_OF_RANGE, true), "{}", message());
    }
    assert_eq!((outcome, direction), ([7; 3], [7.0; 9]));
    // SAFETY: null pointers are what is tested; the others are valid.
    unsafe {
        assert_eq!(kerrlight_sky(&SCENE, null(), 3, a, null(), &out), capi::NULL_POINTER);
        assert_eq!(kerrlight_sky(&SCENE, null(), 3, a, b, null()), capi::NULL_POINTER);
        assert_eq!(kerrlight_sky(&SCENE, null(), 3, a, b, &out), capi::OK);
        let mut g = 7.0;
        assert_eq!(kerrlight_keplerian_redshift(0.9, 1.2, 0.0, &mut g), capi::OUT_OF_RANGE);
        assert_eq!(kerrlight_keplerian_redshift(0.9, 6.0, 0.0, null_mut()), capi::NULL_POINTER);
        assert_eq!((g, kerrlight_keplerian_redshift(0.9, 6.0, 0.0, &mut g)), (7.0, capi::OK));
        let mut curve = [[0.0; 8]; 2];
        let [alpha, beta] = curve.each_mut().map(|column| column.as_mut_ptr());
        assert_eq!(kerrlight_critical_curve(2.0, 60.0, 8, alpha, beta), capi::OUT_OF_RANGE);
        assert_eq!(kerrlight_critical_curve(0.0, 60.0, 8, alpha, beta), capi::OK);
        for (alpha, beta) in curve[0].iter().zip(curve[1]) {
            assert!((alpha.hypot(beta) - 27f64.sqrt()).abs() < 1e-12);
        }
    }
    // A screen's directions: unit vectors, or no numbers.
    assert_eq!(outcome, [1, 0, 1]);
    for (ray, outcome) in direction.chunks(3).zip(outcome) {
        let length = ray.iter().map(|x| x * x).sum::<f64>();
        assert!(if outcome == 1 { (length - 1.0).abs() < 1e-9 } else { length.is_nan() });
    }
}
