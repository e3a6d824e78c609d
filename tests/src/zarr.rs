//! Stores of Zarr through the program: what a fit writes, scenes show and fits read.

use crate::support::{fail, root, succeed};
use std::path::Path;

/// An array of frames as a store, written by hand: the specification of Zarr v3, little-endian bytes, a chunk a frame.
fn store(at: &Path, frames: &[Vec<f64>], side: usize) {
    let array = at.join("movie");
    std::fs::create_dir_all(&array).unwrap();
    std::fs::write(at.join("zarr.json"), r#"{"zarr_format": 3, "node_type": "group"}"#).unwrap();
    let shape = format!("[{}, {side}, {side}]", frames.len());
    let metadata = format!(
        r#"{{"zarr_format": 3, "node_type": "array", "shape": {shape}, "data_type": "float64", "fill_value": 0.0,
        "chunk_grid": {{"name": "regular", "configuration": {{"chunk_shape": [1, {side}, {side}]}}}},
        "chunk_key_encoding": {{"name": "default", "configuration": {{"separator": "/"}}}},
        "codecs": [{{"name": "bytes", "configuration": {{"endian": "little"}}}}]}}"#
    );
    std::fs::write(array.join("zarr.json"), metadata).unwrap();
    for (k, frame) in frames.iter().enumerate() {
        let chunk = array.join(format!("c/{k}/0"));
        std::fs::create_dir_all(&chunk).unwrap();
        let bytes: Vec<u8> = frame.iter().flat_map(|x| x.to_le_bytes()).collect();
        std::fs::write(chunk.join("0"), bytes).unwrap();
    }
}

const SMALL: [&str; 14] = [
    "--set",
    "screen.pixels=16",
    "--set",
    "simulation.movie.frames=6",
    "--set",
    "training.steps=4",
    "--set",
    "output.nodes=70",
    "--set",
    "representation=grid",
    "--set",
    "representation.nodes=12",
    "--set",
    "training.start={linear={nodes=12,stride=2,steps=4}}",
];

/// A volume is the same in a store and in an archive, in a scene and to `inspect`; a movie is the same data in a store.
#[test]
fn exact_stores_through_the_program() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let fit = root().join("scenes/fits/flare_images.toml");
    succeed(at, &[&["fit", fit.to_str().unwrap(), "-o", "run"][..], &SMALL].concat());
    let seen = succeed(at, &["inspect", "run/volume.zarr"]);
    assert!(seen.contains("70 x 70 x 70"), "{seen}");
    let scene = std::fs::read_to_string(root().join("scenes/volume.toml")).unwrap();
    let picture = |name: &str| {
        let scene = scene.replace("volume.npz", &format!("run/{name}"));
        std::fs::write(at.join("scene.toml"), scene).unwrap();
        let size = ["--set", "screen.width=32", "--set", "screen.height=32"];
        let words = ["render", "scene.toml", "-o", "out.exr", "--preview", "out.png"];
        succeed(at, &[&words[..], &size].concat());
        std::fs::read(at.join("out.png")).unwrap()
    };
    assert!(picture("volume.zarr") == picture("volume.npz"));
    // The movie of the run, once as an array and once as a store.
    let text = std::fs::read_to_string(&fit).unwrap();
    let (head, rest) = text.split_once("[[simulation.truth.spot]]").unwrap();
    let (_, tail) = rest.split_once("[movie]").unwrap();
    std::fs::write(at.join("data.toml"), format!("{head}[movie]{tail}")).unwrap();
    let bytes = std::fs::read(at.join("run/movie.npz")).unwrap();
    let mut archive = kerrlight_common::numpy::Archive::open(&bytes).unwrap();
    let movie = archive.member("data").unwrap().unwrap();
    let (_, values) = kerrlight_common::numpy::read_array(&movie).unwrap();
    std::fs::write(at.join("movie.npy"), &movie).unwrap();
    let frames: Vec<Vec<f64>> = values.chunks_exact(16 * 16).map(<[f64]>::to_vec).collect();
    store(&at.join("movie.zarr"), &frames, 16);
    let words = |path: &'static str, run| ["fit", "data.toml", "-o", run, "--set", path];
    for (path, run) in
        [("data.movie.path=movie.npy", "array"), ("data.movie.path=movie.zarr", "store")]
    {
        succeed(at, &[&words(path, run)[..], &SMALL].concat());
    }
    let [a, b] = ["array", "store"].map(|run| std::fs::read(at.join(run).join("volume.npz")));
    assert!(a.unwrap() == b.unwrap());
    // A chunk that is cut short is named before anything is written.
    let chunk = at.join("movie.zarr/movie/c/3/0/0");
    let whole = std::fs::read(&chunk).unwrap();
    std::fs::write(&chunk, &whole[..100]).unwrap();
    let bad = words("data.movie.path=movie.zarr", "bad");
    let message = fail(at, &[&bad[..], &SMALL].concat());
    assert!(message.contains("movie.zarr") && message.contains("damaged"), "{message}");
    assert!(!at.join("bad").exists());
}
