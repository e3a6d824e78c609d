//! Films: frames that are those of `render`, that are kept, and that do not flicker.

use crate::support::{fail, fail_with, folder_with, object, sets, succeed, told};
use kerrlight_render::Error;
use kerrlight_render::image::exr;
use kerrlight_render::scene::Scene;
use std::path::Path;

const SPOT: &str = r#"
[hole]
spin = 0.7
mass_msun = 4.154e6
distance_kpc = 8.178
[observer]
inclination_deg = 50
[screen]
field_of_view_m = 24.0
width = 24
height = 20
samples_per_pixel = 4
[effects]
redshift = true
spectral_index = 1.0
slow_light = true
[tracer]
integrator = "taylor-mino"
tolerance = 1e-6
[disc]
outer_edge = 10.0
peak_intensity = 1.0
opaque = true
[[spot]]
radius = 7.0
phase_deg = 0.0
sigma = 0.9
peak_emissivity = 1.0
"#;

pub const STARS: &str = r#"
[hole]
spin = 0.9
mass_msun = 4.154e6
distance_kpc = 8.178
[camera]
motion = "path"
radius = 30.0
theta_deg = 80.0
field_of_view_deg = 20.0
yaw_deg = 35.0
[[camera.key]]
time = 0.0
phi_deg = 0.0
[[camera.key]]
time = 1000.0
phi_deg = 360.0
[screen]
width = 48
height = 32
[effects]
ray_bundles = true
[tracer]
integrator = "taylor-mino"
tolerance = 1e-8
[sky.stars]
count = 2000
radius_deg = 0.05
brightness = 1.0
seed = 4
"#;

const MOVIE: [&str; 8] =
    ["movie", "spot.toml", "--frames", "3", "--duration", "60min", "-o", "film"];

fn folder() -> tempfile::TempDir {
    folder_with("spot.toml", SPOT)
}

fn frame(folder: &Path, k: usize) -> Vec<u8> {
    std::fs::read(folder.join(format!("film/frame_{k:04}.exr"))).unwrap()
}

const GAS: &str = r#"
[gas]
profile = "gaussian"
scale_radius = 6.0
flatness = 0.0
motion = { angular-momentum = { l0 = 1.0 } }
emissivity = 3e-18
outer_radius = 20.0
"#;

/// Rendered one by one from what the frames' files say, they are the same, bit for bit, and so is
/// what is said about them, but for what only frames have.
fn frames_are_renderings(text: &str, overrides: &[&str]) {
    let folder = folder_with("spot.toml", text);
    succeed(folder.path(), &[&MOVIE[..], &sets(overrides)].concat());
    let mut lights = Vec::new();
    for k in 0..3 {
        let (picture, mut attributes) = exr::decode(&frame(folder.path(), k)).unwrap();
        // 60 minutes are 175.94 M of 20.4604 s.
        let time: f64 = attributes["frame_time_m"].parse().unwrap();
        assert!((time - k as f64 * 3600.0 / 20.460_4 / 3.0).abs() < 1e-2, "{time}");
        let name = format!("film/frame_{k:04}.exr");
        succeed(folder.path(), &["render", &name, "-o", "again.exr"]);
        let again = std::fs::read(folder.path().join("again.exr")).unwrap();
        attributes.retain(|name, _| !name.starts_with("frame"));
        let same = exr::decode(&again).unwrap() == (picture.clone(), attributes.clone());
        assert!(same, "frame {k}, {overrides:?}: {attributes:?}");
        lights.push(picture.channel("intensity").unwrap().to_vec());
    }
    assert!(lights[0] != lights[1] && lights[1] != lights[2]);
}

#[test]
fn exact_frames_are_renderings() {
    frames_are_renderings(SPOT, &[]);
}

/// Gas shines in physical units.
#[test]
fn exact_frames_with_gas_are_renderings() {
    let text = format!("{SPOT}{GAS}");
    frames_are_renderings(&text, &["tracer.integrator=\"elliptic\"", "effects.redshift=false"]);
}

/// Rays differ from frame to frame.
#[test]
fn exact_refined_frames_are_renderings() {
    let refined = ["screen.samples_per_pixel=1", "screen.image_error=0.05"];
    frames_are_renderings(SPOT, &refined);
}

/// A second run renders what is missing and nothing else; other settings are refused.
#[test]
fn exact_second_run_goes_on() {
    let folder = folder();
    succeed(folder.path(), &MOVIE);
    let before: Vec<_> = (0..3).map(|k| frame(folder.path(), k)).collect();
    std::fs::remove_file(folder.path().join("film/frame_0001.exr")).unwrap();
    let said = told(folder.path(), &[&MOVIE[..], &["--gif", "a.gif"][..]].concat());
    assert!(said.contains("1 frames rendered") && said.contains("2 were there"), "{said}");
    let after: Vec<_> = (0..3).map(|k| frame(folder.path(), k)).collect();
    assert!(before == after);
    let gif = std::fs::read(folder.path().join("a.gif")).unwrap();
    assert!(gif.starts_with(b"GIF89a"));
    let other = [&MOVIE[..], &["--set", "hole.spin=0.5"][..]].concat();
    fail_with(folder.path(), &other, &["scene_resolved", "another folder"]);
    fail_with(
        folder.path(),
        &[&MOVIE[..], &["--half"]].concat(),
        &["frame_options", "another folder"],
    );
    let fewer = ["movie", "spot.toml", "--frames", "2", "--duration", "60min", "-o", "film"];
    assert!(fail(folder.path(), &fewer).contains("frame_0002.exr"));
    assert!(fail(folder.path(), &MOVIE[..4]).contains("--output"));
    let no_time = ["movie", "spot.toml", "--frames", "2", "-o", "film"];
    assert!(fail(folder.path(), &no_time).contains("--duration"));
}

/// Parts in any order, one of them twice: the frames of the whole film, which share the scale of the first.
#[test]
fn exact_parts_are_frames_of_the_whole() {
    let folder = folder();
    let at = folder.path();
    let film = |frames: &str, output: &str, more: &[&str]| {
        let words = ["movie", "spot.toml", "--duration", "60", "--frames", frames, "-o", output];
        let scale = ["--set", "screen.total_flux_jy=2.5"];
        let said = object(at, &[&words, &scale[..], more].concat());
        [said["frames"].as_u64().unwrap(), said["rendered"].as_u64().unwrap()]
    };
    assert_eq!(film("5", "whole", &["--gif", "whole.gif"]), [5, 5]);
    assert_eq!(film("3..4/5", "parts", &[]), [2, 2]);
    assert!(!at.join("parts/frame_0000.exr").exists());
    assert_eq!(film("1..3/5", "parts", &[]), [3, 2]);
    assert_eq!(film("1..3/5", "parts", &[]), [3, 0]);
    assert_eq!(film("0..0/5", "parts", &[]), [1, 1]);
    assert_eq!(film("5", "parts", &["--gif", "parts.gif"]), [5, 0]);
    let gif = |name: &str| std::fs::read(at.join(name)).unwrap();
    assert!(gif("parts.gif") == gif("whole.gif"));
    for k in 0..5 {
        let read =
            |film: &str| std::fs::read(at.join(film).join(format!("frame_{k:04}.exr"))).unwrap();
        assert!(read("parts") == read("whole"), "frame {k}");
    }
    let words = ["movie", "spot.toml", "--duration", "60", "-o", "parts", "--frames"];
    let error = fail(at, &[&words[..], &["0..1/5", "--gif", "x.gif"]].concat());
    assert!(error.contains("show the whole film: give them with --frames 5"), "{error}");
    fail_with(at, &[&words[..], &["3..5/5"]].concat(), &["A..B/N for the frames A to B of N"]);
}

/// Bad cameras name the key and the line.
#[test]
fn regress_errors_of_cameras() {
    let error = |find: &str, replace: &str| -> String {
        assert!(STARS.contains(find));
        let parsed = Scene::parse(&STARS.replacen(find, replace, 1));
        parsed.map(|_| ()).map_err(|e: Error| e.to_string()).unwrap_err()
    };
    assert!(error("radius = 30.0\n", "").contains("`camera.radius` is missing"));
    assert!(error("time = 1000.0", "time = 0.0").contains("camera.key.1.time"));
    assert!(error("theta_deg = 80.0", "theta_deg = 200").contains("camera.theta_deg"));
    assert!(error("radius = 30.0", "radius = 30.0\nphi_deg = 3.0").contains("keys"));
    assert!(error("yaw_deg", "yam_deg").contains("unknown field"));
    assert!(error("time = 1000.0", "time = 10.0").contains("slower than light"));
    let text = error("[hole]", "[observer]\ninclination_deg = 3\n[hole]");
    assert!(text.contains("line 3") && text.contains("observer.inclination_deg"), "{text}");
    let text = STARS.replace("[camera]\nmotion", "[came]\nmotion");
    assert!(Scene::parse(&text).is_err());
    // What is written into a file is the same camera.
    let scene = Scene::parse(STARS).unwrap();
    assert_eq!(Scene::parse(&scene.to_toml()).unwrap().camera, scene.camera);
}
