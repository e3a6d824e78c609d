//! Draws around a finished fit.

use crate::support::{
    are_the_same, fail_with, folder_with, json, kill, root, sets, start, succeed, told, until,
};
use crate::unknown_geometry::{NEAR, of_unknown_view};
use std::path::Path;

/// The built-in flare, few pixels, scans and voxels.
pub fn settings() -> String {
    let built_in = std::fs::read_to_string(root().join("cli/src/fit/built_in.toml")).unwrap();
    built_in
        .replace("pixels = 40", "pixels = 20\nring_rays = 4")
        .replace("jy_per_pixel = 0.08", "jy_per_pixel = 0.32")
        .replace("scans = 64", "scans = 12")
        .replace("iterations = 40", "iterations = 25")
        .replace("iterations = 200", "iterations = 25")
        .replace("rounds = 4", "rounds = 2")
        .replace("nodes = 64", "nodes = 20")
}

const VOXELS: [&str; 4] =
    ["--set", "representation=linear-grid", "--set", "representation.linear-grid.nodes=20"];

#[test]
fn exact_draws_of_voxels_resume_to_the_same_bytes() {
    let folder = folder_with("fit.toml", settings());
    succeed(folder.path(), &[&["fit", "fit.toml", "-o", "run"][..], &VOXELS].concat());
    succeed(folder.path(), &["posterior", "run", "--samples", "4"]);
    let of = |name: &str| std::fs::read(folder.path().join("run/posterior").join(name)).unwrap();
    let numbers = json(&folder.path().join("run/posterior/posterior.json"));
    assert_eq!((&numbers["samples"], &numbers["geometry"]), (&4.into(), &serde_json::json!({})));
    let feature = &numbers["features"][0];
    let [radius, azimuth] = ["radius", "azimuth_deg"].map(|key| feature[key][0].as_f64().unwrap());
    assert!((radius - 5.5).abs() < 0.5 && azimuth.abs() < 5.0, "{feature}");
    let spread = feature["radius"][1].as_f64().unwrap();
    assert!(spread > 0.0 && spread < 0.5, "{feature}");
    let coverage = &numbers["coverage_random_nodes"];
    assert!(coverage["nodes"].as_f64().unwrap() > 800.0, "{coverage}");
    let [one, two] =
        ["within_1_sigma", "within_1.96_sigma"].map(|key| coverage[key].as_f64().unwrap());
    assert!(0.0 < one && one <= two && two <= 1.0, "{coverage}");
    let page = String::from_utf8(of("report.html")).unwrap();
    assert!(page.contains("Signal over noise") && page.contains("How often the truth lies"));
    // So few voxels do not make such data.
    let check = &numbers["predicted"][0];
    assert_eq!(check["data"], "visibilities");
    for key in ["larger_chi2", "larger_on_a_baseline", "larger_in_a_frame"] {
        assert!(check[key].as_f64().unwrap() < 1e-3, "{check}");
    }
    assert!(page.contains("Posterior predictive checks"));
    assert!(page.contains("Data (visibilities) are not what the draws predict"));
    // Two draws again, and the rest found: the same bytes.
    let all = ["mean.npz", "deviation.npz", "posterior.json"].map(of);
    for name in ["sample_0002.json", "sample_0003.npz", "sample_0003.json", "mean.npz"] {
        std::fs::remove_file(folder.path().join("run/posterior").join(name)).unwrap();
    }
    succeed(folder.path(), &["posterior", "run", "--samples", "4", "--threads", "1"]);
    assert_eq!(all, ["mean.npz", "deviation.npz", "posterior.json"].map(of));
    survive_a_kill(folder.path());
    // More draws keep those that there are.
    let first = of("sample_0001.json");
    succeed(folder.path(), &["posterior", "run", "--samples", "5"]);
    assert_eq!(first, of("sample_0001.json"));
}

/// A killed call leaves whole draws, and the next one the bytes of a call that was not.
fn survive_a_kill(at: &Path) {
    std::fs::rename(at.join("run/posterior"), at.join("whole")).unwrap();
    for after in ["sample_0001.npz", "sample_0003.json"] {
        let child = start(at, &["posterior", "run", "--samples", "4"]);
        let path = at.join("run/posterior").join(after);
        until("a draw", || path.exists());
        kill(child);
    }
    succeed(at, &["posterior", "run", "--samples", "4"]);
    let same = ["sample_0001.npz", "sample_0004.json", "mean.npz", "posterior.json"];
    are_the_same(at, ["whole", "run/posterior"], &same);
}

/// χ² of the measured data beside a draw is that of as many data, where the model is right: fitted parameters make it smaller, the
/// spread of the draws larger again.
#[test]
fn exact_draws_of_a_right_model_predict_the_data() {
    let folder = tempfile::tempdir().unwrap();
    let field = "kind=\"gaussian\",mean=0.5,amplitude=0.5,correlation_length=4.0,matern=\"1/2\"";
    let truth = format!(
        "simulation.truth={{spot=[],field={{{field},negative=\"lifted\",nodes=12,degree=\"linear\"}}}}"
    );
    let linear = format!(
        "linear={{upper=10.0,degree=\"linear\",rounds=3,iterations=300,prior={{{field}}}}}"
    );
    let settings = sets(&[
        "screen.pixels=12",
        "screen.jy_per_pixel=0.007",
        &truth,
        "simulation.observation.scans=5",
        "representation=linear-grid",
        "representation.linear-grid.nodes=12",
        &linear,
        "output.nodes=16",
    ]);
    let words = [&["fit", "-o", "run", "--samples", "12"], &settings[..]].concat();
    succeed(folder.path(), &words);
    let numbers = json(&folder.path().join("run/posterior/posterior.json"));
    let check = &numbers["predicted"][0];
    let chi2 = check["chi2_per_datum"].as_f64().unwrap();
    assert!((chi2 - 1.0).abs() < 0.15, "{check}");
    for key in ["larger_chi2", "larger_on_a_baseline", "larger_in_a_frame"] {
        let p = check[key].as_f64().unwrap();
        assert!((0.02..0.98).contains(&p), "{key} {check}");
    }
    let open = numbers["open_nodes"].as_f64().unwrap();
    assert!((0.0..0.5).contains(&open), "{open}");
    let page = std::fs::read_to_string(folder.path().join("run/posterior/report.html")).unwrap();
    assert!(page.contains("Data (visibilities) are such as the draws predict"));
    assert!(page.contains("What the data leave open"));
}

const PRIOR: &str =
    "linear.prior={kind=\"gaussian\",mean=0.1,amplitude=0.2,correlation_length=2.0,matern=\"5/2\"}";

const LOG_NORMAL: &str = "linear.prior={kind=\"log-normal\",mean=-4.0,amplitude=1.5,correlation_length=2.0,matern=\"5/2\"}";

/// Draws have the fit's voxels and fields of the prior: another one for each, the same when it is drawn again.
#[test]
fn exact_draws_with_a_prior_resume_to_the_same_bytes() {
    for prior in [PRIOR, LOG_NORMAL] {
        same_again(prior);
    }
}

fn same_again(prior: &str) {
    let folder = folder_with("fit.toml", settings());
    let kind = sets(&["representation=linear-grid", "representation.linear-grid.nodes=14", prior]);
    let words = [&["fit", "fit.toml", "-o", "run", "--samples", "3"], &kind[..]].concat();
    succeed(folder.path(), &words);
    let of = |name: &str| std::fs::read(folder.path().join("run/posterior").join(name)).unwrap();
    assert_ne!(of("sample_0001.npz"), of("sample_0002.npz"));
    let numbers = json(&folder.path().join("run/posterior/posterior.json"));
    for name in ["random_nodes", "bright_nodes", "feature_radius"] {
        let [one, two] = ["68", "95"].map(|part| numbers[format!("{name}_within_{part}")].as_f64());
        assert!(one.unwrap() <= two.unwrap() && two.unwrap() <= 1.0, "{name} {one:?} {two:?}");
        let tenths = numbers[format!("{name}_ranks")].as_array().unwrap().len();
        assert_eq!(tenths, 10);
    }
    let page = String::from_utf8(of("report.html")).unwrap();
    assert!(page.contains("Where the truth lies among the draws"));
    let all = ["sample_0002.npz", "mean.npz", "posterior.json"].map(of);
    for name in ["sample_0002.json", "sample_0002.npz", "mean.npz"] {
        std::fs::remove_file(folder.path().join("run/posterior").join(name)).unwrap();
    }
    succeed(folder.path(), &["posterior", "run", "--samples", "3", "--threads", "1"]);
    assert_eq!(all, ["sample_0002.npz", "mean.npz", "posterior.json"].map(of));
}

#[test]
fn exact_priors_that_mean_nothing_are_refused() {
    let folder = folder_with("fit.toml", settings());
    for (change, expected) in [
        ("linear.prior={kind=\"gaussian\",mean=0.1}", "missing field `amplitude`"),
        ("linear.prior={mean=0.1,amplitude=0.2,correlation_length=2.0}", "missing field `kind`"),
        (
            "linear.prior.kind=\"normal\"",
            "unknown variant `normal`, expected `gaussian` or `log-normal`",
        ),
        (
            "linear.prior={kind=\"gaussian\",mean=0.1,amplitude=0.0,correlation_length=2.0,matern=\"5/2\"}",
            "linear.prior.amplitude = 0 is not allowed",
        ),
        (
            "linear.prior={kind=\"gaussian\",mean=0.1,amplitude=0.2,correlation_length=2.0,matern=\"3/2\"}",
            "unknown variant `3/2`, expected `1/2` or `5/2`",
        ),
        ("loss.0.weight=0.5", "loss.0.weight = 0.5 is not allowed: 1 with [linear.prior]"),
        (
            "change={allowed=\"any\",weight=0.01,spacing=10.0}",
            "linear.prior does not work together with [change]",
        ),
        (
            "simulation.truth.field={kind=\"gaussian\",mean=0.1,amplitude=0.2,correlation_length=2.0,matern=\"1/2\",negative=\"dark\",nodes=3}",
            "simulation.truth.field.nodes = 3 is not allowed",
        ),
        (
            "simulation.truth.field={kind=\"gaussian\",mean=0.1,amplitude=0.2,correlation_length=2.0,matern=\"1/2\",nodes=8}",
            "simulation.truth.field.negative is missing",
        ),
        (
            "simulation.truth.field={kind=\"log-normal\",mean=0.1,amplitude=0.2,correlation_length=2.0,matern=\"1/2\",negative=\"dark\",nodes=8}",
            "simulation.truth.field.negative is not allowed with kind = \"log-normal\"",
        ),
        (
            "linear.prior={kind=\"log-normal\",mean=60.0,amplitude=0.2,correlation_length=2.0,matern=\"5/2\"}",
            "linear.prior.mean = 60 is not allowed: -50 to 50 with kind = \"log-normal\"",
        ),
        (
            "linear.prior={kind=\"log-normal\",mean=0.0,amplitude=21.0,correlation_length=2.0,matern=\"5/2\"}",
            "linear.prior.amplitude = 21 is not allowed: at most 20 with kind = \"log-normal\"",
        ),
    ] {
        let kind = ["fit", "fit.toml", "-o", "run", "--set", "representation=linear-grid"];
        let all = [&kind[..], &["--set", PRIOR, "--set", change]].concat();
        fail_with(folder.path(), &all, &[expected]);
    }
}

#[test]
#[ignore = "long"]
fn exact_draws_of_an_unknown_geometry_have_geometries() {
    let view = "{ trials = 60, nodes = 16, iterations = 40, pixels = 20, frames = 12 }";
    let folder = folder_with("fit.toml", of_unknown_view(&settings(), NEAR, 1, view));
    let words = [&["fit", "fit.toml", "-o", "run", "--samples", "3"][..], &VOXELS].concat();
    let said = told(folder.path(), &words);
    assert!(said.contains("inclination_deg = "), "{said}");
    let geometry = json(&folder.path().join("run/geometry.json"));
    assert!(geometry["sigma"]["inclination_deg"].as_f64().unwrap() > 0.0, "{geometry}");
    let numbers = json(&folder.path().join("run/posterior/posterior.json"));
    let inclination = &numbers["geometry"]["inclination_deg"];
    assert!((inclination["mean"].as_f64().unwrap() - 60.0).abs() < 3.0, "{inclination}");
    assert_eq!(inclination["quantiles"].as_array().map(Vec::len), Some(5));
    let rank = inclination["rank"].as_f64().unwrap();
    assert!((0.0..=1.0).contains(&rank), "{rank}");
    let inside = |part: &str| numbers[format!("inclination_drawn_within_{part}")].as_f64();
    assert_eq!(inside("68"), Some(f64::from(u8::from((rank - 0.5).abs() <= 0.34))));
    assert_eq!(inside("95"), Some(f64::from(u8::from((rank - 0.5).abs() <= 0.475))));
    let table =
        std::fs::read_to_string(folder.path().join("run/posterior/geometries.csv")).unwrap();
    assert!(table.starts_with("inclination_deg,position_angle_deg\n"), "{table}");
    assert_eq!(table.lines().count(), 4);
    let triangle =
        std::fs::read_to_string(folder.path().join("run/posterior/triangle.svg")).unwrap();
    assert!(triangle.contains("inclination (°)"));
}

#[test]
fn exact_draws_without_a_finished_fit_are_refused() {
    let folder = folder_with("fit.toml", settings());
    let refused = |words: &[&str], expected: &str| fail_with(folder.path(), words, &[expected]);
    refused(&["posterior", "nowhere", "--samples", "4"], "nowhere");
    refused(&["posterior", "nowhere", "--samples", "1"], "2..=100000");
    for (change, expected) in [
        ("screen.ring_rays=0", "screen.ring_rays = 0 is not allowed: 1 to 1024"),
        ("linear.degree=quartic", "unknown variant `quartic`, expected"),
        (
            "training.start.linear.iterations=0",
            "training.start.linear.iterations = 0 is not allowed: 1 or more",
        ),
        (
            "training.start.linear.nodes=3",
            "training.start.linear.nodes = 3 is not allowed: 4 or more with this linear.degree",
        ),
        ("effects.absorption={coefficient=0.1,radius=5.0,height=2.0}", "exclude each other"),
    ] {
        refused(&["fit", "fit.toml", "-o", "run", "--set", change], expected);
    }
    let unknown = "axis={from={start=[0.0,0.0,1.0],rate=0.1,last_rate=0.1}}";
    let arguments = ["fit", "fit.toml", "-o", "run", "--samples", "3", "--set", unknown];
    refused(&arguments, "a posterior needs [axis.known]");
}
