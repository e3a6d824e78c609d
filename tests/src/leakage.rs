//! `kerrlight fit` of all four products of circular feeds that leak.

use crate::fit::results;
use crate::support::{scene_path, sets, succeed};

/// The scene of docs/method/polarized-visibilities.md, an ngEHT night of one flare: leakage of 5 % is recovered to 0.5 %, χ² is that of
/// the noise, and the files say so.
#[test]
#[ignore = "long"]
fn exact_leakage_is_found_with_the_flare() {
    let folder = tempfile::tempdir().unwrap();
    let scene = scene_path("fits/polarized_flare.toml");
    succeed(folder.path(), &["fit", &scene, "-o", "flare"]);
    let found = results(&folder.path().join("flare"));
    let beside = &found["leakage"]["beside_the_truth"];
    let number = |key: &str| beside[key].as_f64().unwrap();
    assert!((0.03..0.08).contains(&number("size")), "{beside}");
    assert!(number("rms") < 0.005 && number("count") == 36.0, "{beside}");
    let chi2 = found["chi2_per_datum"]["polarized visibilities"].as_f64().unwrap();
    assert!((0.95..1.05).contains(&chi2), "{chi2}");
    assert!(found["psnr_db"].as_f64().unwrap() > 55.0, "{found}");
    let table = std::fs::read_to_string(folder.path().join("flare/leakage.csv")).unwrap();
    assert_eq!(table.lines().count(), 1 + 18, "{table}");
    let report = std::fs::read_to_string(folder.path().join("flare/report.html")).unwrap();
    assert!(report.contains("Leakage of stations"));
}

/// Leakage beside emission that changes and is not voxels: its linear start has a field for each knot.
#[test]
fn exact_leakage_is_found_beside_emission_that_changes() {
    let folder = tempfile::tempdir().unwrap();
    let scene = scene_path("fits/polarized_flare.toml");
    let changes = sets(&[
        "screen.pixels=20",
        "simulation.observation.scans=8",
        "instrument.leakage.rounds=3",
        "change={allowed='any',weight=0.01,spacing=40.0}",
        "representation.kind=grid",
        "representation.grid={nodes=20}",
        "training.start={linear={nodes=20,stride=1,steps=400,iterations=20}}",
        "training.steps=60",
        "linear.rounds=1",
    ]);
    succeed(folder.path(), &[&["fit", &scene, "-o", "run"], &changes[..]].concat());
    let found = results(&folder.path().join("run"));
    let beside = &found["leakage"]["beside_the_truth"];
    let [rms, size] = ["rms", "size"].map(|key| beside[key].as_f64().unwrap());
    // No leakage at all is as far off as it is large.
    assert!(rms < 0.75 * size, "{rms} {size}");
}
