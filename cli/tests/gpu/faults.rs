//! Devices that fail: there is none, their limits are too small, they have no memory, they are lost. A layer of Vulkan
//! (`layer.rs`), compiled here, lets the driver fail in the program that is tested.

use super::{fit, folder, kerrlight, kerrlight_in, scene, succeed};
use std::ffi::OsStr;
use std::path::Path;
use std::process::Command;

const LAYER: &str = "VK_LAYER_KERRLIGHT_faults";

/// Command to run on a device: one word of the command line each.
type Words = Vec<String>;

fn words(words: &[&str], changes: &[&str]) -> Words {
    let changes = changes.iter().flat_map(|change| ["--set", change]);
    let all = words.iter().copied().chain(changes).chain(["--device", "gpu"]);
    all.map(str::to_owned).collect()
}

/// A picture of three bands, in `a.exr`.
fn render() -> Words {
    let disc = scene("disc_plunging.toml");
    let size = ["screen.width=32", "screen.height=48", "screen.rings=regular-grid"];
    words(&["render", disc.to_str().unwrap(), "-o", "a.exr", "--threads", "1"], &size)
}

/// Three frames of a camera that moves, in `film`, one after the other.
fn movie() -> Words {
    let orbit = scene("camera_orbit.toml");
    let size = ["screen.width=16", "screen.height=16", "effects.ray_bundles=false"];
    let times = ["--frames", "3", "--from", "0", "--to", "50", "-o", "film", "--threads", "1"];
    words(&[&["movie", orbit.to_str().unwrap()], &times[..]].concat(), &size)
}

/// Sixty steps of a small network, in `run`.
fn steps() -> Words {
    let small = [
        "screen.pixels=12",
        "region.nodes={equal-mino-time={per_ray=20}}",
        "simulation.movie.frames=6",
        "representation.network.width=16",
        "training.steps=60",
        "training.log_every=20",
        "training.batch={pixels=60}",
        "training.start=drawn",
        "output.nodes=8",
    ];
    let words = fit(Some("scene_1.toml"), &small).into_iter();
    words.chain(["-o", "run", "--device", "gpu"].map(str::to_owned)).collect()
}

/// All three, and what each writes.
fn all() -> [(Words, &'static str); 3] {
    [(render(), "a.exr"), (movie(), "film"), (steps(), "run")]
}

fn borrowed(words: &Words) -> Vec<&str> {
    words.iter().map(String::as_str).collect()
}

/// The program in an environment in which it fails with exit code 2 and without a panic; what it says.
fn fails(folder: &Path, variables: &[(&str, &OsStr)], words: &[&str]) -> String {
    let output = kerrlight_in(folder, variables, words);
    let told = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(2), "{variables:?} {words:?}: {told}");
    assert!(!told.contains("panic"), "{variables:?} {words:?}: {told}");
    told
}

/// A folder with the layer and its manifest, if there is a device.
struct Faults {
    layer: tempfile::TempDir,
}

impl Faults {
    fn new() -> Option<Self> {
        folder()?;
        let layer = tempfile::tempdir().unwrap();
        let source = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/gpu/layer.rs");
        let mut rustc = Command::new(std::env::var_os("RUSTC").unwrap_or_else(|| "rustc".into()));
        rustc.args(["--edition", "2024", "--crate-type", "cdylib", "-o", "libfaults.so"]);
        let made = rustc.arg(source).current_dir(layer.path()).output().expect("rustc runs");
        assert!(made.status.success(), "{}", String::from_utf8_lossy(&made.stderr));
        let manifest = serde_json::json!({ "file_format_version": "1.0.0", "layer": {
            "name": LAYER, "type": "GLOBAL", "library_path": layer.path().join("libfaults.so"),
            "api_version": "1.3.0", "implementation_version": "1", "description": "faults",
        }});
        std::fs::write(layer.path().join("faults.json"), manifest.to_string()).unwrap();
        Some(Self { layer })
    }

    fn variables<'a>(&'a self, fault: &'a str) -> [(&'static str, &'a OsStr); 3] {
        let layer = self.layer.path().as_os_str();
        [
            ("VK_LAYER_PATH", layer),
            ("VK_INSTANCE_LAYERS", LAYER.as_ref()),
            ("FAULT", fault.as_ref()),
        ]
    }

    /// Returns the message about a fault.
    fn told(&self, folder: &Path, fault: &str, words: &Words) -> String {
        fails(folder, &self.variables(fault), &borrowed(words))
    }
}

/// Without a driver each command names the option and what to install, and writes nothing. A fit that has begun is left as
/// it is, and the processor takes it up.
#[test]
fn exact_without_a_driver_nothing_is_written() {
    let (at, none) = (tempfile::tempdir().unwrap(), "no-driver.json");
    let none = [("VK_DRIVER_FILES", none.as_ref()), ("VK_ICD_FILENAMES", none.as_ref())];
    let listed = kerrlight_in(at.path(), &none, &["devices"]);
    let listed = String::from_utf8(listed.stdout).unwrap();
    assert!(listed.starts_with("cpu") && listed.contains("no graphics device"), "{listed}");
    for (words, written) in all() {
        let told = fails(at.path(), &none, &borrowed(&words));
        assert!(told.contains("--device gpu: no graphics device with Vulkan"), "{told}");
        assert!(told.contains("mesa-vulkan-drivers"), "{told}");
        assert!(!at.path().join(written).exists(), "{written}");
    }
    let steps = steps();
    succeed(at.path(), &borrowed(&steps)[..steps.len() - 2]);
    let checkpoint = || std::fs::read(at.path().join("run/checkpoint.safetensors")).unwrap();
    let before = checkpoint();
    fails(at.path(), &none, &["fit", "--resume", "run", "--device", "gpu"]);
    assert!(checkpoint() == before);
    succeed(at.path(), &["fit", "--resume", "run"]);
}

/// Limits are named with what there is and what is needed, before anything is written; what needs less works.
#[test]
fn exact_limits_that_are_too_small_are_named() {
    let (Some(faults), at) = (Faults::new(), tempfile::tempdir().unwrap()) else { return };
    let variables = faults.variables("shared:8192");
    let listed = kerrlight_in(at.path(), &variables, &["devices"]);
    let listed = String::from_utf8(listed.stdout).unwrap();
    assert!(listed.contains("with 8 KiB"), "the layer is not in the way: {listed}");
    for (fault, named) in [
        ("range:65536", "bytes of a buffer: 65536, needed are"),
        ("invocations:32", "invocations of a workgroup: 32, needed are"),
    ] {
        for (words, written) in all() {
            let told = faults.told(at.path(), fault, &words);
            assert!(told.contains("limits are too small") && told.contains(named), "{told}");
            assert!(!at.path().join(written).exists(), "{written}");
        }
    }
    let told = faults.told(at.path(), "shared:8192", &steps());
    assert!(told.contains("workgroup's memory: 8192, needed are 12288"), "{told}");
    assert!(!at.path().join("run").exists());
    let output = kerrlight_in(at.path(), &variables, &borrowed(&render()));
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
}

/// Each way in which a device fails in the middle of something.
const FAILURES: [(&str, &str); 3] =
    [("submit", "was lost"), ("wait", "was lost"), ("memory", "has no memory for")];

/// Bands that were finished are kept: the same command ends in the bytes of a picture that nothing has disturbed, and the
/// processor in its own.
#[test]
fn exact_a_picture_goes_on_after_its_device_has_failed() {
    let (Some(faults), at) = (Faults::new(), tempfile::tempdir().unwrap()) else { return };
    let (words, file) = (render(), at.path().join("a.exr"));
    let on_processor = &borrowed(&words)[..words.len() - 2];
    let whole = |words: &[&str]| {
        succeed(at.path(), words);
        std::fs::read(&file).unwrap()
    };
    let [of_device, of_processor] = [&borrowed(&words)[..], on_processor].map(whole);
    for (fault, named) in FAILURES {
        // After the test of the device, and the first of three bands.
        let after = if fault == "memory" { 3 + 12 } else { 1 + 1 };
        for (words, expected) in
            [(&borrowed(&words)[..], &of_device), (on_processor, &of_processor)]
        {
            std::fs::remove_file(&file).unwrap();
            let told = faults.told(at.path(), &format!("{fault}:{after}"), &render());
            assert!(told.contains(named) && told.contains("--device cpu"), "{told}");
            assert!(told.contains("finished bands are kept in a.exr.partial"), "{told}");
            assert!(at.path().join("a.exr.partial").exists() && !file.exists());
            assert!(whole(words) == *expected, "{fault}: other bytes");
        }
    }
}

/// Frames that were finished are kept, and the same command makes the others.
#[test]
fn exact_a_film_goes_on_after_its_device_has_failed() {
    let (Some(faults), at) = (Faults::new(), tempfile::tempdir().unwrap()) else { return };
    let (words, film) = (movie(), at.path().join("film"));
    let frames = || [0, 1, 2].map(|k| std::fs::read(film.join(format!("frame_000{k}.exr"))).ok());
    succeed(at.path(), &borrowed(&words));
    let whole = frames();
    assert!(whole.iter().all(Option::is_some));
    for (fault, named) in FAILURES {
        std::fs::remove_dir_all(&film).unwrap();
        let after = if fault == "memory" { 3 + 12 } else { 1 + 1 };
        let told = faults.told(at.path(), &format!("{fault}:{after}"), &words);
        assert!(told.contains(named) && told.contains("--device cpu into another"), "{told}");
        let kept = frames().iter().flatten().count();
        assert!(told.contains(&format!("{kept} of 3 frames are in film")), "{told}");
        // How many buffers a frame takes is the library's affair.
        assert!(kept == 1 || fault == "memory" && kept < 3, "{fault}: {kept}");
        succeed(at.path(), &borrowed(&words));
        assert!(frames() == whole, "{fault}: other bytes");
    }
}

/// The steps that have come back are in the checkpoint, from which the processor goes on; without room at the beginning the
/// processor begins.
#[test]
fn exact_a_fit_goes_on_after_its_device_has_failed() {
    let (Some(faults), at) = (Faults::new(), tempfile::tempdir().unwrap()) else { return };
    let (words, run) = (steps(), at.path().join("run"));
    for (fault, named, step) in [
        ("submit:70", "was lost", true),
        ("wait:3", "was lost", true),
        ("memory:70", "memory", true),
        ("memory:12", "has no memory for", false),
    ] {
        let told = faults.told(at.path(), fault, &words);
        assert!(told.contains(named) && told.contains("kerrlight fit --resume run"), "{told}");
        assert_eq!(told.contains(" is kept; on the processor"), step, "{fault}: {told}");
        assert_eq!(run.join("checkpoint.safetensors").exists(), step, "{fault}");
        assert!(!run.join("results.json").exists());
        let output = kerrlight(at.path(), &["fit", "--resume", "run"]);
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        let results = std::fs::read(run.join("results.json")).unwrap();
        let results: serde_json::Value = serde_json::from_slice(&results).unwrap();
        assert!(results["steps"] == 60 && results.get("device").is_none(), "{results}");
        std::fs::remove_dir_all(&run).unwrap();
    }
}
