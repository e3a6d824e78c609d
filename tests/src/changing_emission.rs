//! Fits of emission that changes while matter carries it.

use crate::fit::results;
use crate::support::{fail_with, folder_with, json, replaced, root, sets, succeed};
use serde_json::Value;
use std::path::Path;

/// The scene of a flare that appears and fades, with fewer pixels and frames.
fn settings() -> String {
    let scene = std::fs::read_to_string(root().join("scenes/fits/appearing_flare.toml")).unwrap();
    scene
        .replace("pixels = 32", "pixels = 20")
        .replace("jy_per_pixel = 0.08", "jy_per_pixel = 0.2")
        .replace("frames = 48", "frames = 30")
        .replace("nodes = 28", "nodes = 20")
        .replace("iterations = 60", "iterations = 40")
        .replace("nodes = 48", "nodes = 24")
}

fn fit(folder: &Path, changes: &[&str]) -> Value {
    std::fs::write(folder.join("fit.toml"), settings()).unwrap();
    succeed(folder, &[&["fit", "fit.toml", "-o", "run"], &sets(changes)[..]].concat());
    results(&folder.join("run"))
}

/// Columns of `emission.csv`: time, recovered, truth.
fn curves(folder: &Path) -> Vec<[f64; 3]> {
    let text = std::fs::read_to_string(folder.join("run/emission.csv")).unwrap();
    let rows = text.lines().filter(|line| !line.starts_with(['#', 't']));
    let numbers = |row: &str| -> Vec<f64> { row.split(',').map(|x| x.parse().unwrap()).collect() };
    rows.map(|row| numbers(row).try_into().unwrap()).collect()
}

/// Times at which a curve first and last is at half of its maximum, linear between the frames.
fn halves(curve: &[[f64; 2]]) -> [f64; 2] {
    let half = 0.5 * curve.iter().fold(0.0f64, |most, [_, x]| most.max(*x));
    let crossing = |pair: &[[f64; 2]]| {
        let [[t, x], [u, y]] = [pair[0], pair[1]];
        ((x < half) != (y < half)).then(|| t + (half - x) / (y - x) * (u - t))
    };
    let all: Vec<f64> = curve.windows(2).filter_map(crossing).collect();
    [all[0], all[all.len() - 1]]
}

/// Onset and end are found within one frame. Without a change the same data are not explained, and the first line says so.
#[test]
fn exact_a_flare_that_changes_is_found_and_hard_motion_is_recognised_as_wrong() {
    let folder = tempfile::tempdir().unwrap();
    let soft = fit(folder.path(), &[]);
    let curves = curves(folder.path());
    let of = |k: usize| curves.iter().map(|row| [row[0], row[k]]).collect::<Vec<_>>();
    let (found, truth) = (halves(&of(1)), halves(&of(2)));
    let frame = curves[1][0] - curves[0][0];
    // The truth is half as bright at the times of the settings.
    assert!((truth[0] - 29.3).abs() < frame && (truth[1] - 88.0).abs() < frame, "{truth:?}");
    for (found, truth) in found.iter().zip(truth) {
        assert!((found - truth).abs() < frame, "{found} {truth}");
    }
    assert_eq!(soft["linear"]["relative_gap"].as_f64().map(|gap| gap < 0.1), Some(true));
    without_a_change(folder.path(), &soft);
}

/// Fits the same data without a change, beside the results of a fit with one.
fn without_a_change(folder: &Path, soft: &Value) {
    let chi2 = |results: &Value| results["chi2_per_datum"]["image"].as_f64().unwrap();
    let error = |results: &Value| results["nrmse_over_time"].as_f64().unwrap();
    let hard = replaced(&settings(), "\n[change]", "[[simulation.truth.spot]]", "\n");
    std::fs::write(folder.join("hard.toml"), hard).unwrap();
    let told = succeed(folder, &["fit", "hard.toml", "-o", "hard"]);
    assert!(told.starts_with("The model does not explain its data"), "{told}");
    let hard = results(&folder.join("hard"));
    assert!(chi2(&hard) > 10.0 * chi2(soft), "{} {}", chi2(&hard), chi2(soft));
    assert!(error(soft) < 0.8 * error(&hard), "{} {}", error(soft), error(&hard));
    assert!(folder.join("hard/emission.csv").exists());
}

/// Of a representation that is learnt, from voxels that change.
const LEARNT: [&str; 8] = [
    "training.steps=60",
    "representation.network.rate=5e-4",
    "representation.network.last_rate=5e-6",
    "training.ramp=10",
    "training.batch={frames=6}",
    "training.start={linear={nodes=20,stride=1,steps=200}}",
    "training.log_every=20",
    "change.spacing=8.0",
];

#[test]
#[ignore = "long"]
fn exact_what_is_learnt_may_change_as_voxels_may() {
    let voxels = tempfile::tempdir().unwrap();
    let bound = 1.05 * fit(voxels.path(), &[])["nrmse_over_time"].as_f64().unwrap();
    let mask = "training.occupancy={cells=16,threshold=0.003,memory=0.8,warm_up=0,every=20}";
    let network =
        ["representation.network.width=48", "representation.network.length_scale=2.0", mask];
    let network = [&network[..], &["representation.kind=bhnerf", "training.optimiser=muon"]];
    let grid = ["representation.kind=grid", "representation.activation=softplus"];
    let rate = [
        "representation.grid.rate=5e-2",
        "representation.grid.last_rate=5e-4",
        "change.spacing=4.0",
    ];
    let features =
        ["representation.kind=feature-grid", "representation.feature-grid.levels=2", mask];
    let slower =
        ["representation.feature-grid.rate=2.5e-3", "representation.feature-grid.last_rate=1e-4"];
    for kind in
        [network.concat(), [grid.as_slice(), &rate].concat(), [&features[..], &slower].concat()]
    {
        let folder = tempfile::tempdir().unwrap();
        let results = fit(folder.path(), &[&LEARNT[..], &kind].concat());
        let error = results["nrmse_over_time"].as_f64().unwrap();
        assert!(error < bound, "{kind:?}: {error} {bound}");
        let curves = curves(folder.path());
        let of = |k: usize| curves.iter().map(|row| [row[0], row[k]]).collect::<Vec<_>>();
        let frame = curves[1][0] - curves[0][0];
        for (found, truth) in halves(&of(1)).iter().zip(halves(&of(2))) {
            assert!((found - truth).abs() < frame, "{kind:?}: {found} {truth}");
        }
        let log = std::fs::read_to_string(folder.path().join("run/log.jsonl")).unwrap();
        let last: Value = serde_json::from_str(log.lines().last().unwrap()).unwrap();
        assert!(last["penalties"]["change"].as_f64().unwrap() > 0.0, "{last}");
    }
}

/// Frames that voxels have not seen choose the price that a network then pays.
#[test]
fn exact_held_out_frames_choose_the_price_of_a_network() {
    let folder = tempfile::tempdir().unwrap();
    let network = ["representation.kind=bhnerf", "representation.network.width=16"];
    let held = "held_out={setting=\"change.weight\",values=[0.003,3.0],folds=2}";
    let start = "training.start.linear={nodes=14,stride=1,steps=2}";
    let few = ["training.steps=2", "linear.iterations=10", start, held];
    let results = fit(folder.path(), &[&LEARNT[..], &network, &few].concat());
    assert_eq!(results["held_out"]["chosen"].as_f64(), Some(0.003));
}

/// Draws around an unknown geometry in which emission changes: each has a geometry of its own.
#[test]
#[ignore = "long"]
fn exact_geometries_are_drawn_where_emission_changes() {
    let folder = tempfile::tempdir().unwrap();
    let prior = "observer.inclination_deg={uniform=[40.0,80.0]}";
    let search = "search={starts=1,coarse={trials=20,nodes=12,iterations=30,pixels=20,frames=15},\
        fine={trials=20,nodes=14,iterations=40,pixels=20,frames=15}}";
    let truth = "simulation.observer.inclination_deg=60.0";
    fit(folder.path(), &[prior, truth, search, "linear.iterations=15", "linear.rounds=1"]);
    succeed(folder.path(), &["posterior", "run", "--samples", "3"]);
    let read = |name: &str| json(&folder.path().join("run").join(name));
    let known = read("geometry.json");
    let sigma = known["sigma"]["inclination_deg"].as_f64().unwrap();
    let best = known["geometry"]["inclination_deg"].as_f64().unwrap();
    let drawn: Vec<f64> = (1..=3)
        .map(|k| read(&format!("posterior/sample_000{k}.json")))
        .map(|draw| draw["geometry"]["inclination_deg"].as_f64().unwrap())
        .collect();
    assert!(drawn.iter().all(|x| (x - best).abs() < 5.0 * sigma), "{drawn:?} {best} {sigma}");
    assert!(drawn.windows(2).all(|pair| pair[0] != pair[1]), "{drawn:?}");
}

#[test]
fn exact_what_cannot_change_is_refused_before_anything_is_written() {
    let folder = folder_with("fit.toml", settings());
    for (change, expected) in [
        ("change.weight=-1.0", "change.weight = -1"),
        ("change.spacing=0.0", "change.spacing = 0"),
        ("change.spacing=0.001", "with at most 10,000 in the time of the data"),
        ("change.allowed=deaths", "unknown variant `deaths`"),
        ("representation=mlp4d", "change does not apply to mlp4d"),
        ("change.allowed=births", "representation.kind = \"linear-grid\""),
        ("simulation.truth.spot.0.shines.rise=0.0", "simulation.truth.spot.0.shines.rise = 0"),
        ("axis={from={start=[0.0,0.0,1.0],rate=0.1,last_rate=0.1}}", "[axis.known]"),
        ("held_out={setting=\"change.weight\",values=[0.1,1.0],folds=2}", "have a linear start"),
    ] {
        let mut words = vec!["fit", "fit.toml", "-o", "run", "--set", change];
        if change.contains("births") || change.contains("held_out") {
            words.extend(["--set", "representation.kind=grid"]);
        }
        fail_with(folder.path(), &words, &[expected]);
    }
}
