//! Pictures with rays on whatever graphics device there is, against those of the processor.
//!
//! `cargo test --release -p kerrlight --features gpu --test gpu -- --nocapture` prints the differences.

use kerrlight_tomo::image::Picture;
use kerrlight_tomo::image::exr;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

fn kerrlight(folder: &Path, arguments: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_kerrlight"));
    command.current_dir(folder).args(arguments).output().expect("the program runs")
}

fn succeed(folder: &Path, arguments: &[&str]) -> String {
    let output = kerrlight(folder, arguments);
    let errors = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(output.status.success(), "{arguments:?}: {errors}");
    errors
}

/// A folder to write to; where there is no graphics device a test says so and passes.
fn folder() -> Option<tempfile::TempDir> {
    let folder = tempfile::tempdir().unwrap();
    let listed = kerrlight(folder.path(), &["devices"]);
    let listed = String::from_utf8(listed.stdout).unwrap();
    assert!(listed.starts_with("cpu"), "{listed}");
    if listed.contains("no graphics device") {
        eprintln!("SKIPPED, nothing was tested: {listed}");
        return None;
    }
    Some(folder)
}

fn scene(name: &str) -> PathBuf {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap();
    root.join("scenes").join(name)
}

fn decoded(path: &Path) -> Picture {
    exr::decode(&std::fs::read(path).unwrap()).unwrap().0
}

/// The sum of the differences of a channel by the sum of its values.
fn difference(a: &Picture, b: &Picture, channel: &str) -> f64 {
    let [a, b] = [a, b].map(|picture| picture.channel(channel).unwrap());
    let sum =
        |values: &mut dyn Iterator<Item = f32>| values.map(|x| f64::from(x.abs())).sum::<f64>();
    let apart = sum(&mut a.iter().zip(b).map(|(a, b)| if a == b { 0.0 } else { a - b }));
    apart / sum(&mut a.iter().copied())
}

#[test]
fn code_pictures_are_those_of_the_processor() {
    let Some(folder) = folder() else { return };
    // The sky is a checkerboard, of which single pixels change sides.
    for (name, channel, allowed, beside) in [
        ("disc_face_on.toml", "intensity", 2e-6, ""),
        ("disc_plunging.toml", "intensity", 2e-5, ""),
        ("disc_edge_on.toml", "intensity", 2e-5, ""),
        ("sky_checker.toml", "G", 1e-3, ""),
        ("hot_spots.toml", "intensity", 2e-5, "paths that may meet spots"),
        ("gold2020/test3.toml", "intensity", 2e-6, ""),
    ] {
        let path = scene(name);
        let render = |device: &str, file: &str| {
            let size = ["--set", "screen.width=48", "--set", "screen.height=48"];
            let scene = ["render", path.to_str().unwrap(), "-o", file, "--device", device];
            succeed(folder.path(), &[&scene[..], &size].concat())
        };
        render("cpu", "cpu.exr");
        let told = render("gpu", "gpu.exr");
        assert!(told.contains("in floats") && told.contains(beside), "{told}");
        let [cpu, gpu] = ["cpu.exr", "gpu.exr"].map(|file| decoded(&folder.path().join(file)));
        let apart = difference(&cpu, &gpu, channel);
        println!("{name}: {channel} differs by {apart:.1e}");
        assert!(apart < allowed, "{name}: {apart:e}");
        let traced = apart > 0.0 || channel != "intensity" || !beside.is_empty();
        assert!(traced, "{name}: nothing was traced on the device");
    }
}

/// Neither threads nor tiles change a byte; the file names the device.
#[test]
fn exact_a_picture_does_not_depend_on_threads_or_tiles() {
    let Some(folder) = folder() else { return };
    let render = |file: &str, more: &[&str]| {
        let path = scene("disc_plunging.toml");
        let size = ["--set", "screen.width=40", "--device", "gpu", "-o", file];
        let words = [&["render", path.to_str().unwrap()], &size[..], more].concat();
        succeed(folder.path(), &words);
        std::fs::read(folder.path().join(file)).unwrap()
    };
    let first = render("a.exr", &["--threads", "1"]);
    assert_eq!(first, render("b.exr", &["--threads", "3"]));
    assert_eq!(first, render("c.exr", &["--tile", "4096"]));
    let (_, attributes) = exr::decode(&first).unwrap();
    assert!(attributes.contains_key("device"), "{attributes:?}");
}

/// Frames of one device are not taken for those of another.
#[test]
fn exact_films_have_one_device() {
    let Some(folder) = folder() else { return };
    let path = scene("hot_spots.toml");
    let movie = |device: &str| {
        let words = ["movie", path.to_str().unwrap(), "--frames", "2", "--from", "0", "--to", "5"];
        let more = [
            "--set",
            "screen.width=16",
            "--set",
            "screen.height=16",
            "-o",
            "film",
            "--device",
            device,
        ];
        kerrlight(folder.path(), &[&words[..], &more].concat())
    };
    let first = movie("gpu");
    assert!(first.status.success(), "{}", String::from_utf8_lossy(&first.stderr));
    let other = movie("cpu");
    let told = String::from_utf8_lossy(&other.stderr).into_owned();
    assert!(other.status.code() == Some(2) && told.contains("device differs"), "{told}");
}

#[test]
fn devices_that_are_not_there() {
    let Some(folder) = folder() else { return };
    let output = kerrlight(folder.path(), &["render", "--device", "abacus", "-o", "a.exr"]);
    let told = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(2));
    assert!(told.contains("--device abacus") && told.contains("there is"), "{told}");
}
