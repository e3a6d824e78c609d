//! Searches for what a fit does not know: killed, they resume where they were, to the same bytes.

use crate::posterior::settings;
use crate::support::{are_the_same, folder_with, killed, scene_path, sets, succeed, told};
use crate::unknown_geometry::{NEAR, of_unknown_view};
use std::path::Path;

/// A fit of few voxels.
const VOXELS: [&str; 6] = [
    "fit",
    "fit.toml",
    "--set",
    "representation=linear-grid",
    "--set",
    "representation.linear-grid.nodes=16",
];

/// Kills a fit once its search has so many results, and resumes it: what it says then.
fn killed_and_resumed(at: &Path, words: &[&str], results: usize) -> String {
    let log = at.join("killed/search.log");
    let is_there =
        || std::fs::read_to_string(&log).is_ok_and(|text| text.lines().count() > results);
    killed(at, &[words, &["-o", "killed"]].concat(), "results of a search", is_there);
    let said = told(at, &["fit", "--resume", "killed"]);
    assert!(!log.exists(), "nothing is left of the search but its result");
    said
}

/// A fit whose search is killed after so many results ends with the bytes of one that is not.
fn resumes_to_the_same_bytes(at: &Path, words: &[&str], results: usize, names: &[&str]) {
    succeed(at, &[words, &["-o", "whole"]].concat());
    let said = killed_and_resumed(at, words, results);
    assert!(said.contains("an interrupted search is resumed"), "{said}");
    are_the_same(at, ["whole", "killed"], names);
}

#[test]
fn exact_a_killed_search_for_a_geometry_resumes_to_the_same_bytes() {
    let view = "{ trials = 30, nodes = 12, iterations = 20, pixels = 12, frames = 8 }";
    let folder = folder_with("fit.toml", of_unknown_view(&settings(), NEAR, 2, view));
    let at = folder.path();
    let names = ["geometry.json", "volume.npz"];
    resumes_to_the_same_bytes(at, &VOXELS, 45, &names);
    // Without its result a run searches once more.
    for name in ["geometry.json", "checkpoint.safetensors"] {
        std::fs::remove_file(at.join("killed").join(name)).unwrap();
    }
    succeed(at, &["fit", "--resume", "killed"]);
    are_the_same(at, ["whole", "killed"], &names);
}

#[test]
fn exact_a_killed_weighing_of_bands_resumes_to_the_same_bytes() {
    let folder = tempfile::tempdir().unwrap();
    let scene = scene_path("fits/orbital_polarimetry.toml");
    let settings = sets(&[
        "band.radii={from=8.0,to=12.0,step=2.0}",
        "band.inclinations_deg={from=8.0,to=32.0,step=2.0}",
        "band.nodes=20",
        "band.widths=[2.0]",
        "band.lengths=[4.0]",
        "screen.pixels=24",
        "representation.linear-grid.nodes=12",
        "linear.rounds=1",
        "linear.iterations=10",
        "output.nodes=16",
    ]);
    let words = [&["fit", &scene], &settings[..]].concat();
    resumes_to_the_same_bytes(folder.path(), &words, 2, &["band.json"]);
}

#[test]
fn exact_killed_comparisons_of_weights_resume_to_the_same_bytes() {
    let folder = folder_with("fit.toml", settings());
    let held_out = "held_out={setting=\"linear.smoothness\",values=[1e-4,1e-2,1.0],folds=3}";
    let words = [&VOXELS[..], &["--set", held_out]].concat();
    resumes_to_the_same_bytes(folder.path(), &words, 4, &["held_out.json", "volume.npz"]);
}
