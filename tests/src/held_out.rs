//! Weights that are chosen by frames that are held out.

use crate::fit::results;
use crate::support::{are_the_same, fail_with, new_folder, sets, succeed};

const HELD_OUT: &str = "held_out={setting=\"linear.smoothness\",values=[0.0,0.1,30.0],folds=2}";

/// A small fit of the built-in experiment with one more setting, and where it goes.
fn small<'a>(setting: &'a str, run: &'a str) -> Vec<&'a str> {
    let settings = sets(&[
        "representation=linear-grid",
        "representation.linear-grid.nodes=40",
        "linear.degree=linear",
        "linear.rounds=2",
        "simulation.observation.scans=24",
        "output.nodes=24",
        "screen.pixels=32",
        "screen.jy_per_pixel=0.125",
        setting,
    ]);
    [&["fit", "-o", run], &settings[..]].concat()
}

/// Without smoothness voxels follow the noise, with too much of it they cannot be a flare: frames that were left out
/// tell, and the volume is that of a fit with the chosen weight to the bit.
#[test]
fn exact_held_out_frames_choose_the_weight() {
    let at = &new_folder();
    succeed(at, &small(HELD_OUT, "chosen"));
    let found = results(&at.join("chosen"));
    let held_out = &found["held_out"];
    assert_eq!(
        (&held_out["setting"], &held_out["chosen"]),
        (&"linear.smoothness".into(), &0.1.into())
    );
    let losses: Vec<f64> = held_out["values"]
        .as_array()
        .unwrap()
        .iter()
        .map(|v| v["loss"].as_f64().unwrap())
        .collect();
    assert!(losses[0] > losses[1] && losses[2] > losses[1], "{losses:?}");
    succeed(at, &small("linear.smoothness=0.1", "given"));
    are_the_same(at, ["chosen", "given"], &["volume.npz"]);
    let page = std::fs::read_to_string(at.join("chosen/report.html")).unwrap();
    assert!(page.contains("linear.smoothness = 0.1 was chosen from 3 values"));
}

#[test]
fn bad_ways_to_hold_out_are_refused_before_anything_is_written() {
    let folder = tempfile::tempdir().unwrap();
    for (change, expected) in [
        ("held_out={setting=\"change.weight\",values=[0.1,1.0],folds=2}", "there is no [change]"),
        ("held_out={setting=\"linear.smoothness\",values=[0.1],folds=2}", "2 values or more"),
        ("held_out={setting=\"linear.smoothness\",values=[0.1,-1.0],folds=2}", "held_out.values"),
        ("held_out={setting=\"linear.smoothness\",values=[0.1,1.0],folds=1}", "held_out.folds = 1"),
        (
            "held_out={setting=\"linear.smoothness\",values=[0.1,1.0],folds=900}",
            "half of the frames",
        ),
        ("held_out={setting=\"linear.upper\",values=[0.1,1.0],folds=2}", "expected one of"),
    ] {
        fail_with(folder.path(), &small(change, "run"), &[expected]);
    }
}
