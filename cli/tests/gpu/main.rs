//! Pictures with rays, and fits with steps, on whatever graphics device there is, against those of the processor.
//!
//! `cargo test --release -p kerrlight --features gpu --test gpu -- --nocapture` prints the differences.

#[cfg(target_os = "linux")]
mod faults;
mod paths;

use kerrlight_render::image::Picture;
use kerrlight_render::image::exr;
use std::ffi::OsStr;
use std::fmt::Display;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

fn kerrlight(folder: &Path, arguments: &[&str]) -> Output {
    kerrlight_in(folder, &[], arguments)
}

/// The same in an environment.
fn kerrlight_in(folder: &Path, variables: &[(&str, &OsStr)], arguments: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_kerrlight"));
    let command = command.current_dir(folder).envs(variables.iter().copied()).args(arguments);
    command.output().expect("the program runs")
}

fn succeed(folder: &Path, arguments: &[&str]) -> String {
    let output = kerrlight(folder, arguments);
    let errors = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(output.status.success(), "{arguments:?}: {errors}");
    errors
}

/// Says that something is not tested, past the harness, which keeps what passing tests print; with KERRLIGHT_TEST_ALL it
/// fails.
fn skipped(why: impl Display) {
    // What cannot be said is no failure of what was to be tested.
    let _ = writeln!(std::io::stderr(), "SKIPPED: {why}");
    let all = std::env::var_os("KERRLIGHT_TEST_ALL").is_some_and(|value| !value.is_empty());
    assert!(!all, "KERRLIGHT_TEST_ALL: {why}");
}

/// A folder to write to; where there is no graphics device a test says so and passes.
fn folder() -> Option<tempfile::TempDir> {
    let folder = tempfile::tempdir().unwrap();
    let listed = kerrlight(folder.path(), &["devices"]);
    let listed = String::from_utf8(listed.stdout).unwrap();
    assert!(listed.starts_with("cpu"), "{listed}");
    if listed.contains("no graphics device") {
        skipped(listed.trim_end());
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
    for (name, channel, allowed) in [
        ("disc_face_on.toml", "intensity", 2e-6),
        ("disc_plunging.toml", "intensity", 2e-5),
        ("disc_edge_on.toml", "intensity", 2e-5),
        ("sky_checker.toml", "G", 1e-3),
        ("gold2020/test3.toml", "intensity", 2e-6),
    ] {
        let path = scene(name);
        let render = |device: &str, file: &str| {
            let size = ["--set", "screen.width=48", "--set", "screen.height=48"];
            let scene = ["render", path.to_str().unwrap(), "-o", file, "--device", device];
            succeed(folder.path(), &[&scene[..], &size].concat())
        };
        render("cpu", "cpu.exr");
        let told = render("gpu", "gpu.exr");
        assert!(told.contains("in floats") && !told.contains("on this processor"), "{told}");
        let [cpu, gpu] = ["cpu.exr", "gpu.exr"].map(|file| decoded(&folder.path().join(file)));
        let apart = difference(&cpu, &gpu, channel);
        println!("{name}: {channel} differs by {apart:.1e}");
        assert!(apart < allowed, "{name}: {apart:e}");
        assert!(apart > 0.0 || channel != "intensity", "{name}: nothing was traced on the device");
    }
}

/// Neither threads nor tiles change a byte; the file names the device.
#[test]
fn exact_a_picture_does_not_depend_on_threads_or_tiles() {
    let Some(folder) = folder() else { return };
    for name in ["disc_plunging.toml", "hot_spots.toml", "volume.toml"] {
        let render = |file: &str, more: &[&str]| {
            let path = scene(name);
            let size = ["--set", "screen.width=40", "--device", "gpu", "-o", file];
            let words = [&["render", path.to_str().unwrap()], &size[..], more].concat();
            succeed(folder.path(), &words);
            std::fs::read(folder.path().join(file)).unwrap()
        };
        let first = render("a.exr", &["--threads", "1"]);
        assert!(first == render("b.exr", &["--threads", "3"]), "{name}: threads");
        assert!(first == render("c.exr", &["--tile", "4096"]), "{name}: tiles");
        let (_, attributes) = exr::decode(&first).unwrap();
        assert!(attributes.contains_key("device"), "{attributes:?}");
    }
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

/// Words of a fit that takes a moment: of a file of `scenes/fits`, or the built-in one, with changes.
fn fit(file: Option<&str>, changes: &[&str]) -> Vec<String> {
    let mut words = vec!["fit".to_owned()];
    words.extend(file.map(|file| scene(&format!("fits/{file}")).to_str().unwrap().to_owned()));
    for change in changes {
        words.extend(["--set".to_owned(), (*change).to_owned()]);
    }
    words
}

/// BH-NeRF's first scene with fewer pixels, frames and units.
fn scene_1(more: &[&str]) -> Vec<String> {
    let small = [
        "screen.pixels=20",
        "region.nodes={equal-mino-time={per_ray=40}}",
        "simulation.movie.frames=16",
        "representation.network.width=32",
        "training.optimiser=adam",
        "training.steps=150",
        "training.log_every=50",
        "training.batch={pixels=200}",
        "training.start={linear={nodes=16,stride=2,steps=300}}",
        "output.nodes=24",
    ];
    fit(Some("scene_1.toml"), &[&small[..], more].concat())
}

fn fitted(folder: &Path, words: &[String], more: &[&str]) -> (String, serde_json::Value) {
    let words: Vec<&str> = words.iter().map(String::as_str).chain(more.iter().copied()).collect();
    let told = succeed(folder, &words);
    let run = more[more.iter().position(|word| *word == "-o" || *word == "--resume").unwrap() + 1];
    let text = std::fs::read(folder.join(run).join("results.json")).unwrap();
    (told, serde_json::from_slice(&text).unwrap())
}

#[test]
fn code_fits_of_images_are_those_of_the_processor() {
    let Some(folder) = folder() else { return };
    let words = scene_1(&[]);
    let gpu = close(folder.path(), &words, ["cpu", "gpu"]);
    // A broken run goes on, here or there, and ends in the bytes of an unbroken one where the device is the same.
    let read =
        |run: &str| std::fs::read(folder.path().join(run).join("checkpoint.safetensors")).unwrap();
    fitted(folder.path(), &words, &["-o", "again", "--device", "gpu"]);
    assert!(read("gpu") == read("again") && read("gpu") != read("cpu"));
    let (_, resumed) = fitted(folder.path(), &["fit".to_owned()], &["--resume", "again"]);
    assert!(resumed["psnr_db"] == gpu["psnr_db"]);
}

#[test]
fn code_fits_by_muon_are_those_of_the_processor() {
    let Some(folder) = folder() else { return };
    let words = scene_1(&["training.optimiser=muon"]);
    close(folder.path(), &words, ["cpu", "gpu"]);
}

/// Results of a fit on a device, which reaches the PSNR of the processor.
fn close(folder: &Path, words: &[String], [cpu, gpu]: [&str; 2]) -> serde_json::Value {
    let (_, cpu) = fitted(folder, words, &["-o", cpu]);
    let (told, gpu) = fitted(folder, words, &["-o", gpu, "--device", "gpu"]);
    assert!(told.contains("steps on") && !told.contains("on this processor"), "{told}");
    assert!(gpu["device"].is_string() && cpu.get("device").is_none());
    let [of_cpu, of_gpu] = [&cpu, &gpu].map(|results| results["psnr_db"].as_f64().unwrap());
    println!("PSNR {of_cpu} dB on the processor, {of_gpu} dB on {}", gpu["device"]);
    assert!((of_cpu - of_gpu).abs() < 0.1, "{of_cpu} {of_gpu}");
    // That of an empty volume is 1.
    for results in [&cpu, &gpu] {
        assert!(results["nrmse"].as_f64().unwrap() < 0.7, "{}", results["nrmse"]);
    }
    gpu
}

/// Every representation that devices have learns there what it learns on the processor.
#[test]
fn code_each_representation_reaches_the_psnr_of_the_processor() {
    let Some(folder) = folder() else { return };
    let of_events = [
        "representation=mlp4d",
        "training.occupancy=",
        "training.start=drawn",
        "training.batch={pixels=50}",
        "training.steps=20",
    ];
    let cases: [&[&str]; 3] = [
        &of_events,
        &["representation=grid", "training.start=drawn"],
        &["representation=feature-grid"],
    ];
    for (k, changes) in cases.into_iter().enumerate() {
        let words = scene_1(&[&["screen.pixels=14", "training.steps=60"], changes].concat());
        let [cpu, gpu] = ["cpu", "gpu"].map(|device| {
            let run = format!("{device}{k}");
            let (_, results) = fitted(folder.path(), &words, &["-o", &run, "--device", device]);
            ["psnr_db", "loss"].map(|name| results[name].as_f64().unwrap())
        });
        println!("{changes:?}: PSNR and loss {cpu:?} on the processor, {gpu:?} on the device");
        assert!((cpu[0] - gpu[0]).abs() < 0.1 && (gpu[1] / cpu[1] - 1.0).abs() < 1e-3);
        assert!(cpu[1] > 0.0 && cpu != gpu, "{changes:?}: the device did nothing");
    }
}

#[test]
fn code_fits_of_visibilities_are_those_of_the_processor() {
    let Some(folder) = folder() else { return };
    let words = fit(
        None,
        &[
            "representation=bhnerf",
            "representation.network.width=16",
            "screen.pixels=12",
            "simulation.observation.scans=6",
            "training.optimiser=adam",
            "training.steps=30",
            "training.log_every=10",
            "training.start={linear={nodes=10,stride=1,steps=100}}",
            "output.nodes=16",
        ],
    );
    let (_, cpu) = fitted(folder.path(), &words, &["-o", "cpu"]);
    let (told, gpu) = fitted(folder.path(), &words, &["-o", "gpu", "--device", "gpu"]);
    assert!(told.contains("steps on") && !told.contains("on this processor"), "{told}");
    let [of_cpu, of_gpu] = [&cpu, &gpu].map(|results| results["loss"].as_f64().unwrap());
    println!("loss {of_cpu} on the processor, {of_gpu} on {}", gpu["device"]);
    assert!((of_gpu / of_cpu - 1.0).abs() < 1e-3, "{of_cpu} {of_gpu}");
}

#[test]
fn fits_that_devices_do_not_do_are_refused() {
    let Some(folder) = folder() else { return };
    let refused = |words: &[String], more: &[&str], said: &str| {
        let words: Vec<&str> =
            words.iter().map(String::as_str).chain(more.iter().copied()).collect();
        let output = kerrlight(folder.path(), &words);
        let told = String::from_utf8_lossy(&output.stderr).into_owned();
        assert!(output.status.code() == Some(2) && told.contains(said), "{told}");
    };
    let gpu = ["-o", "run", "--device", "gpu"];
    refused(&scene_1(&["training.parts=2"]), &gpu, "training.parts");
    refused(&scene_1(&["representation=linear-grid"]), &gpu, "representation.kind");
    refused(&scene_1(&[]), &["-o", "run", "--device", "abacus"], "--device abacus");
    assert!(!folder.path().join("run").exists());
}
