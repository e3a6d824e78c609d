//! `kerrlight fit` of a flare beside what does not move, and of a rotation of position angles that is not known.

use crate::fit::results;
use crate::support::{fail_with, root, sets, succeed};
use std::path::Path;

/// The scene of docs/method/quiescent-emission.md with a few exact images in place of visibilities.
fn scene(folder: &Path) -> String {
    let text = std::fs::read_to_string(root().join("scenes/fits/flare_and_ring.toml")).unwrap();
    let (before, rest) = text.split_once("[simulation.observation]").unwrap();
    let (_, after) = rest.split_once("[[loss]]\ndata = \"visibilities\"").unwrap();
    let movie = "[simulation.movie]\nframes = 12\nfrom = 0.0\nto = 100.0\n\n[[loss]]\ndata = \"image\"\nsigma = 0.001";
    let path = folder.join("scene.toml");
    std::fs::write(&path, format!("{before}{movie}{after}")).unwrap();
    path.display().to_string()
}

const SMALL: [&str; 5] = [
    "quiescent.smoothness=0.03",
    "screen.pixels=20",
    "simulation.truth.spot.0.sigma=1.2",
    "representation.linear-grid.nodes=16",
    "output.nodes=24",
];

/// Flare and ring are each found where they are, the files say so, and without the table the data are not explained.
#[test]
fn exact_a_ring_is_told_from_the_flare() {
    let folder = tempfile::tempdir().unwrap();
    let scene = scene(folder.path());
    let run = |more: &[&str]| {
        succeed(folder.path(), &[&["fit", &scene], &sets(&SMALL)[..], more].concat());
        results(&folder.path().join(more[more.len() - 1]))
    };
    let found = run(&["-o", "both"]);
    let beside = &found["quiescent"]["I"]["beside_the_truth"];
    let number = |of: &serde_json::Value| of.as_f64().unwrap();
    assert!((number(&beside["flux_jy"]) - 2.0).abs() < 1e-6, "{beside}");
    assert!(number(&beside["correlation"]) > 0.99, "{beside}");
    assert!(number(&found["correlation"]) > 0.99, "{found}");
    for name in ["quiescent.npz", "quiescent.exr", "quiescent.png"] {
        assert!(folder.path().join("both").join(name).is_file(), "{name}");
    }
    let report = std::fs::read_to_string(folder.path().join("both/report.html")).unwrap();
    assert!(report.contains("An image that does not move recovered beside the emission"));
    let without = run(&["--set", "quiescent=", "-o", "one"]);
    assert!(without["quiescent"].is_null());
    let chi2 = |of: &serde_json::Value| number(&of["chi2_per_datum"]["image"]);
    assert!(chi2(&without) > 100.0 * chi2(&found), "{without}");
}

/// Settings that exclude a quiescent image are refused with their key, and nothing is written.
#[test]
fn exact_what_excludes_a_quiescent_image_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let scene = scene(folder.path());
    let trained = "representation=feature-grid";
    for (set, says) in [
        (&["quiescent.upper=0.0"][..], "quiescent.upper = 0"),
        (&["quiescent.smoothness=-1.0"], "quiescent.smoothness = -1"),
        (&["quiescent={upper=1.0,sparsity=0.0}"], "quiescent.smoothness"),
        (&[trained, "training.batch={pixels=9}"], "training.batch: pixels are drawn"),
        (
            &["simulation.truth.ring.0.radius=900.0"],
            "simulation.truth.ring.0: no pixel of the screen sees it",
        ),
        (
            &[
                "loss=[{data=\"closure-phases\",weight=1.0}]",
                "simulation.observation={array=\"ngEHT\",source=\"sgra\",mjd=57851,utc=[10.0,11.0],scans=4,integration_s=30.0,frequency_ghz=230.0,bandwidth_ghz=2.0,elevation_deg=[10.0,85.0],noise=\"none\",first_time=0.0}",
                "linear.flux_jy=3.0",
                "linear.sparsity=0.0",
            ],
            "quiescent.smoothness and quiescent.sparsity are not allowed",
        ),
    ] {
        let words = [&["fit", &scene], &sets(set)[..], &["-o", "refused"]].concat();
        fail_with(folder.path(), &words, &[says]);
    }
}
