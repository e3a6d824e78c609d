//! Helpers that several tests need.

use kerrlight_render::image::Picture;
use kerrlight_render::picture::Rendered;
use kerrlight_render::scene::{Scene, apply_override};
use kerrlight_render::volume::VolumeArrays;
use serde_json::Value;
use std::fmt::Display;
use std::io::Write;
use std::ops::Deref;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use std::sync::OnceLock;
use std::time::{Duration, Instant};
use tempfile::TempDir;

/// The root of the workspace.
pub fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).parent().expect("a workspace member").to_owned()
}

/// The built binary, in the profile of the tests.
pub fn binary() -> &'static Path {
    static BINARY: OnceLock<PathBuf> = OnceLock::new();
    BINARY.get_or_init(|| {
        let mut cargo = Command::new(env!("CARGO"));
        cargo.current_dir(root()).args(["build", "--quiet", "--package", "kerrlight"]);
        if cfg!(feature = "beside-python") {
            cargo.args([
                "--package",
                "kerrlight-python",
                "--features",
                "kerrlight-python/extension",
            ]);
        }
        if cfg!(feature = "beside-graphics") {
            for package in ["kerrlight-geodesic", "kerrlight-tomo"] {
                cargo.args(["--package", package, "--features", &format!("{package}/wgpu")]);
            }
        }
        if !cfg!(debug_assertions) {
            cargo.arg("--release");
        }
        assert!(cargo.status().expect("cargo runs").success(), "the binary builds");
        // This test is <target>/<profile>/deps/all-….
        let test = std::env::current_exe().expect("the test's own path");
        let profile = test.ancestors().nth(2).expect("a profile directory");
        profile.join(format!("kerrlight{}", std::env::consts::EXE_SUFFIX))
    })
}

/// Runs the binary in `folder`.
pub fn kerrlight(folder: &Path, arguments: &[&str]) -> Output {
    Command::new(binary()).current_dir(folder).args(arguments).output().expect("the binary runs")
}

/// Runs the binary in a shell that has done something before: `"$@"` is the command line.
pub fn after(folder: &Path, script: &str, words: &[&str]) -> Output {
    let mut command = Command::new("bash");
    command.current_dir(folder).args(["-c", script, "bash"]).arg(binary()).args(words);
    command.output().expect("bash runs")
}

/// A run whose files may not grow beyond a number of KiB, as on a disk that is full.
#[cfg(unix)]
pub fn cramped(folder: &Path, kib: u32, words: &[&str]) -> Output {
    after(folder, &format!("ulimit -f {kib}; exec \"$@\""), words)
}

/// Standard error of a run.
pub fn message(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

/// A run that must succeed.
pub fn done(folder: &Path, arguments: &[&str]) -> Output {
    let output = kerrlight(folder, arguments);
    assert!(output.status.success(), "{arguments:?}: {}", message(&output));
    output
}

/// Standard output of a run that must succeed.
pub fn succeed(folder: &Path, arguments: &[&str]) -> String {
    String::from_utf8(done(folder, arguments).stdout).expect("text")
}

/// Standard error of a run that must succeed.
pub fn told(folder: &Path, arguments: &[&str]) -> String {
    message(&done(folder, arguments))
}

/// The one object that a run prints.
pub fn object(folder: &Path, arguments: &[&str]) -> Value {
    let printed = succeed(folder, &[arguments, &["--json"]].concat());
    serde_json::from_str(&printed).unwrap_or_else(|error| panic!("{error}: {printed}"))
}

/// The object of a file.
pub fn json(path: &Path) -> Value {
    let text = std::fs::read(path).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
    serde_json::from_slice(&text).expect("JSON")
}

/// The path of a file in the folder of scenes.
pub fn scene_path(name: &str) -> String {
    root().join("scenes").join(name).display().to_string()
}

/// The words of a command line.
pub fn words_of(line: &str) -> Vec<&str> {
    line.split_whitespace().collect()
}

/// Settings, each behind `--set`.
pub fn sets<'a>(settings: &[&'a str]) -> Vec<&'a str> {
    settings.iter().flat_map(|setting| ["--set", *setting]).collect()
}

/// The text with another part in place of that from the first `from` to the next `to`, which stays.
pub fn replaced(text: &str, from: &str, to: &str, with: &str) -> String {
    let (before, rest) = text.split_once(from).expect(from);
    let at = rest.find(to).expect(to);
    format!("{before}{with}{}", &rest[at..])
}

/// All scene files of the repository with their texts.
pub fn scenes() -> Vec<(PathBuf, String)> {
    let mut files: Vec<PathBuf> = std::fs::read_dir(root().join("scenes"))
        .expect("the folder of scenes")
        .map(|entry| entry.expect("an entry").path())
        .filter(|path| path.extension().is_some_and(|e| e == "toml"))
        .collect();
    files.sort();
    assert!(files.len() >= 6, "scenes are found");
    files
        .into_iter()
        .map(|path| {
            let text = std::fs::read_to_string(&path).expect("a readable scene");
            (path, text)
        })
        .collect()
}

/// A scene with overrides.
pub fn scene(text: &str, overrides: &[&str]) -> Scene {
    let text = overrides.iter().fold(text.to_owned(), |text, assignment| {
        apply_override(&text, assignment).expect("an override that fits")
    });
    Scene::parse(&text).unwrap_or_else(|e| panic!("{overrides:?}: {e}"))
}

/// The picture of a scene whose files, if any, lie in the folder of scenes.
pub fn render(scene: &Scene) -> Picture {
    rendered(scene).picture
}

/// The same with what is known of it.
pub fn rendered(scene: &Scene) -> Rendered {
    use kerrlight_render::emission::mesh::MeshFile;
    use kerrlight_render::emission::sky::{Catalogue, Panorama};
    use kerrlight_render::scene::Sky;
    use kerrlight_render::transport::Assets;
    let read = |path: &str| std::fs::read(root().join("scenes").join(path)).expect(path);
    let sky = match &scene.sky {
        Some(Sky::Image(image)) => Some(Panorama::decode(&read(&image.path)).expect("a picture")),
        _ => None,
    };
    let stars = match &scene.sky {
        Some(Sky::Catalogue(stars)) => Some(Catalogue::decode(&read(&stars.path)).expect("stars")),
        _ => None,
    };
    let resource = |name: &str| Ok(Some(read(name)));
    let mesh = |path: &str| MeshFile::decode(&read(path), &resource).expect("a mesh");
    let meshes = scene.mesh.iter().map(|one| mesh(&one.path)).collect();
    let volume = |bytes: &[u8]| VolumeArrays::from_npz(bytes).and_then(VolumeArrays::located);
    let volumes =
        scene.volume.iter().map(|one| volume(&read(&one.path)).expect("a volume")).collect();
    kerrlight_render::picture::render(scene, Assets { sky, stars, meshes, volumes }, &|_| true)
        .expect("a picture")
}

/// Starts the binary in `folder`.
pub fn start(folder: &Path, arguments: &[&str]) -> Child {
    let mut command = Command::new(binary());
    command.current_dir(folder).args(arguments).stdout(Stdio::null()).stderr(Stdio::piped());
    command.spawn().expect("the binary runs")
}

/// Says that something is not tested, past the harness, which keeps what passing tests print; with KERRLIGHT_TEST_ALL it
/// fails.
pub fn skipped(why: impl Display) {
    // What cannot be said is no failure of what was to be tested.
    let _ = writeln!(std::io::stderr(), "SKIPPED: {why}");
    let all = std::env::var_os("KERRLIGHT_TEST_ALL").is_some_and(|value| !value.is_empty());
    assert!(!all, "KERRLIGHT_TEST_ALL: {why}");
}

/// Waits until something is so.
pub fn until(what: &str, mut is_so: impl FnMut() -> bool) {
    let clock = Instant::now();
    while !is_so() {
        assert!(clock.elapsed() < Duration::from_secs(240), "{what}");
        std::thread::sleep(Duration::from_millis(3));
    }
}

/// A new folder, which goes with all that is in it.
pub struct Folder(TempDir);

impl Deref for Folder {
    type Target = Path;

    fn deref(&self) -> &Path {
        self.0.path()
    }
}

/// A new folder; bound as a reference it lasts as long as that.
pub fn new_folder() -> Folder {
    Folder(tempfile::tempdir().expect("a folder"))
}

/// A new folder with one file.
pub fn folder_with(name: &str, contents: impl AsRef<[u8]>) -> TempDir {
    let folder = tempfile::tempdir().expect("a folder");
    std::fs::write(folder.path().join(name), contents).expect("a file");
    folder
}

/// Names in a folder, sorted; temporary files would show.
pub fn files(folder: &Path) -> Vec<String> {
    let entries =
        std::fs::read_dir(folder).expect("a folder").map(|entry| entry.expect("an entry"));
    let names = entries.map(|entry| entry.file_name().into_string().expect("text"));
    let mut names: Vec<String> = names.collect();
    names.sort();
    names
}

/// Asserts that two folders have the same bytes in files of these names.
pub fn are_the_same(at: &Path, [one, other]: [&str; 2], names: &[&str]) {
    for name in names {
        let [a, b] = [one, other].map(|of| std::fs::read(at.join(of).join(name)).expect(name));
        assert!(a == b, "{name} of {one} and {other}");
    }
}

/// Returns whether a file is there and has a text.
pub fn holds(path: &Path, text: &str) -> bool {
    std::fs::read_to_string(path).is_ok_and(|all| all.contains(text))
}

/// Kills a process that may have ended.
pub fn kill(mut child: Child) {
    child.kill().expect("killed");
    child.wait().expect("ended");
}

/// Starts the binary and kills it once something is so.
pub fn killed(folder: &Path, arguments: &[&str], what: &str, is_so: impl FnMut() -> bool) {
    let mut child = start(folder, arguments);
    until(what, is_so);
    assert!(child.try_wait().expect("a child").is_none(), "{what}: it has ended before");
    kill(child);
}

/// The message of a run that must fail, leaving `folder` as it was.
pub fn fail(folder: &Path, arguments: &[&str]) -> String {
    let before = files(folder);
    let output = kerrlight(folder, arguments);
    let message = message(&output);
    assert_eq!(output.status.code(), Some(2), "{arguments:?}: {message}");
    assert_eq!(files(folder), before, "{arguments:?} left files");
    assert!(output.stdout.is_empty(), "{arguments:?}");
    assert!(!message.contains("panicked"), "{message}");
    message
}

/// Asserts that a run fails, leaving `folder` as it was, and that its message has these words.
pub fn fail_with(folder: &Path, arguments: &[&str], words: &[&str]) {
    let message = fail(folder, arguments);
    let says = words.iter().all(|word| message.contains(word));
    assert!(says, "{arguments:?} without {words:?}: {message}");
}

/// A number of [0, 1) for each index, and another one for each of six axes: multiples of powers of the inverse of x⁷ = x + 1 fall evenly
/// in the cube of six sides.
pub fn even(k: usize, axis: i32) -> f64 {
    ((k + 1) as f64 * 1.112_775_684_278_705_5f64.powi(-axis)).fract()
}

/// The number that lies this part of the way between two limits.
pub fn within(part: f64, [least, most]: [f64; 2]) -> f64 {
    least + (most - least) * part
}
