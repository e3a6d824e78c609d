//! Verdicts: page, terminal and results.json agree on whether data are explained.

use crate::eht_data;
use crate::fit::results;
use crate::support::{scene_path, sets, skipped, succeed};
use serde_json::Value;
use std::path::Path;

/// The built-in experiment with fewer pixels, scans and nodes, as the convex problem: some seconds.
const SMALL: [&str; 7] = [
    "representation=linear-grid",
    "representation.linear-grid.nodes=24",
    // So few cubic splines are wider than the flare.
    "linear.degree=linear",
    "screen.pixels=20",
    "simulation.observation.scans=20",
    "output.nodes=16",
    "linear.rounds=2",
];

/// The verdict of results.json, which page and terminal have to begin with.
fn verdict(folder: &Path, words: &[&str]) -> Value {
    let printed = succeed(folder, &[words, &["-o", "run"]].concat());
    let verdict = results(&folder.join("run"))["verdict"].clone();
    let text = verdict["text"].as_str().unwrap();
    let lines: Vec<&str> = printed.lines().collect();
    assert_eq!(lines.len(), 2, "{printed}");
    assert!(lines[0].starts_with(text) && lines[1].ends_with("report.html"), "{printed}");
    let page = std::fs::read_to_string(folder.join("run/report.html")).unwrap();
    let (_, after) = page.split_once("<h1>").unwrap();
    let (heading, _) = after.split_once("</strong>").unwrap();
    assert!(heading.contains("<section id=\"notice\"") && !heading.contains("<h2>"), "{heading}");
    let shown = heading.rsplit("<strong>").next().unwrap();
    assert_eq!(shown.replace("&#39;", "'"), text);
    std::fs::remove_dir_all(folder.join("run")).unwrap();
    verdict
}

fn chi2(verdict: &Value, term: usize) -> f64 {
    verdict["data"][term]["chi2_per_datum"].as_f64().unwrap()
}

#[test]
fn regress_a_fit_with_right_settings_explains_its_data() {
    let folder = tempfile::tempdir().unwrap();
    let found = verdict(folder.path(), &[&["fit"], &sets(&SMALL)[..]].concat());
    assert_eq!(found["outcome"], "explained", "{found}");
    assert!((0.8..1.1).contains(&chi2(&found, 0)), "{found}");
    assert!((found["data"][0]["expected"]["mean"].as_f64().unwrap() - 1.0).abs() < 1e-12);
}

/// A geometry that is seen from another side than the fit assumes, one with more spin, and one that turns the other way.
#[test]
fn regress_a_fit_with_wrong_settings_says_so() {
    let folder = tempfile::tempdir().unwrap();
    for wrong in ["observer.inclination_deg=30.0", "hole.spin=0.9", "motion.axis=[0.0,0.0,-1.0]"] {
        let wrong = format!("simulation.{wrong}");
        let words = [&["fit"], &sets(&SMALL)[..], &["--set", &wrong]].concat();
        let found = verdict(folder.path(), &words);
        assert_eq!(found["outcome"], "unexplained", "{wrong}: {found}");
        assert!(chi2(&found, 0) > 2.0, "{wrong}: {found}");
        assert!(!found["reasons"].as_array().unwrap().is_empty());
    }
}

/// Measured Sgr A*, after a few steps: χ² and the flux that short baselines have measured say that this is nothing.
#[test]
fn regress_measured_data_that_are_not_explained() {
    let Some((data, _)) = eht_data::pairs()
        .into_iter()
        .find(|(path, _)| path.to_string_lossy().contains("097_hi_hops_netcal-LMTcal-besttime"))
    else {
        return skipped("there is no public table of Sgr A* with its text");
    };
    let folder = tempfile::tempdir().unwrap();
    let fit = scene_path("fits/sgra_visibilities.toml");
    let path = format!("data.visibilities.path={}", std::path::absolute(data).unwrap().display());
    let settings = sets(&[
        "training.steps=10",
        "representation=bhnerf",
        "screen.pixels=20",
        "output.nodes=12",
        &path,
    ]);
    let found = verdict(folder.path(), &[&["fit", &fit], &settings[..]].concat());
    assert_eq!(found["outcome"], "unexplained", "{found}");
    assert!(chi2(&found, 0) > 10.0 && chi2(&found, 1) > 3.0, "{found}");
    let flux = &found["zero_spacing"];
    assert!((2.0..2.7).contains(&flux["measured_jy"].as_f64().unwrap()), "{flux}");
    assert_eq!(found["data"][0]["sigma_is"], "stated");
    assert!(found["data"][0]["worst_station"]["station"].as_str().unwrap().len() >= 2);
    let told = found["text"].as_str().unwrap();
    assert!(told.contains("amplitudes") && told.contains("closure phases"), "{told}");
}
