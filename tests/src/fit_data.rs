//! `kerrlight fit --data FILE`: settings that are guessed from a file, with every guess told.

use crate::eht_data;
use crate::support::{fail, fail_with, new_folder, sets, succeed, told, words_of};
use std::path::Path;

const SEEN: &str = "observe image.csv --fov-uas 100 --array EHT2017 --mjd 57850 --utc 5-7 --frames 6 --tint 60 --noise thermal --seed 1";
/// Settings of a fit that takes a moment.
pub const FEW: [&str; 6] =
    ["--set", "training.steps=2", "--set", "screen.pixels=8", "--set", "output.nodes=8"];

/// Writes what an array sees of an image of nine pixels that lies there in the sky.
pub fn observed(at: &Path, source: &str, data: &str) {
    std::fs::write(at.join("image.csv"), "0.1,0.2,0.1\n".repeat(3)).unwrap();
    succeed(at, &[&words_of(SEEN)[..], &["--source", source, "-o", data]].concat());
}

/// Returns the messages of a fit of data, with the settings in the run's folder.
fn said(folder: &Path, words: &[&str], run: &str) -> (String, String) {
    let said = told(folder, &[&["fit"], words, &FEW, &["-o", run]].concat());
    (said, std::fs::read_to_string(folder.join(run).join("fit.toml")).unwrap())
}

/// Of a known source everything is guessed and told; of another one what cannot be guessed is asked for, all at once.
#[test]
fn exact_visibilities_are_fitted_at_once() {
    let path = &new_folder();
    observed(path, "m87", "a.uvfits");
    observed(path, "12.5,12.4", "b.uvfits");
    let (told, kept) = said(path, &["--data", "a.uvfits", "--model", "volume"], "a");
    for sentence in [
        "read: a.uvfits: M87*, recognised by position or name, MJD 57850",
        "assumed: hole.mass_msun = 6500000000.0: M87* (EHT Collaboration 2019",
        "assumed: hole.spin = 0.5: the data do not tell the spin",
        "assumed: instrument.gains.table = \"EHT2017\"",
        "data.visibilities.uv_min = 1e8",
    ] {
        assert!(told.contains(sentence), "{sentence}: {told}");
    }
    // Told on the way, and kept: the same settings with the same reasons.
    assert!(kept.contains("# ASSUMED: the data do not tell the spin"), "{kept}");
    assert!(told.contains("# ASSUMED: the data do not tell the spin"));
    let spin = ["--data", "a.uvfits", "--model", "volume", "--set", "hole.spin=0.9"];
    let (told, _) = said(path, &spin, "spin");
    assert!(!told.contains("assumed: hole.spin"), "{told}");
    let missing = fail(path, &["fit", "--data", "b.uvfits", "-o", "b"]);
    for key in ["hole.mass_msun", "hole.distance_kpc", "observer.inclination_deg"] {
        assert!(missing.contains(&format!("--set '{key}=")), "{missing}");
    }
    assert!(missing.contains("--model image"), "{missing}");
    let given = ["hole.mass_msun=1e9", "hole.distance_kpc=1e4", "observer.inclination_deg=40"];
    said(path, &[&["--data", "b.uvfits"], &sets(&given)[..]].concat(), "b");
}

/// Light curves: Q and U with errors, and a total flux without any.
#[test]
fn exact_light_curves_are_fitted_at_once() {
    let path = &new_folder();
    let mut text = "time_utc_h,I,Q,U\n".to_owned();
    for k in 0..40 {
        let (time, turn) = (9.0 + 0.03 * f64::from(k), 0.35 * f64::from(k));
        text += &format!(
            "{time},{},{},{}\n",
            2.5 + 0.1 * turn.sin(),
            0.1 + 0.05 * turn.cos(),
            0.05 * turn.sin()
        );
    }
    std::fs::write(path.join("qu.csv"), &text).unwrap();
    let missing = fail(path, &["fit", "--data", "qu.csv", "-o", "none"]);
    assert!(missing.contains("--set 'hole.mass_msun=4.154e6'"), "{missing}");
    assert!(!missing.contains("--model image"), "a light curve has no image: {missing}");
    let quick = sets(&[
        "hole.mass_msun=4.154e6",
        "band.radii={from=9.0,to=11.0,step=1.0}",
        "band.inclinations_deg={from=20.0,to=40.0,step=20.0}",
        "band.nodes=21",
        "representation.linear-grid.nodes=12",
        "linear.rounds=1",
        "linear.iterations=5",
    ]);
    let (told, kept) = said(path, &[&["--data", "qu.csv"], &quick[..]].concat(), "qu");
    assert!(
        told.contains("read: qu.csv: 40 samples from 9.000 h to 10.170 h UTC; Q and U are fitted"),
        "{told}"
    );
    assert!(told.contains("the file has no errors"), "{told}");
    assert!(kept.contains("stokes = [\"Q\", \"U\"]"), "{kept}");
    let report = std::fs::read_to_string(path.join("qu/report.html")).unwrap();
    for sentence in
        ["40 samples of Q and U", "Inclination: that of axes in any direction, 20 to 40°"]
    {
        assert!(report.contains(sentence), "{sentence}");
    }
    std::fs::write(path.join("i.csv"), text.replace("I,Q,U", "I,x,y")).unwrap();
    let (told, _) = said(path, &[&["--data", "i.csv"], &quick[..]].concat(), "i");
    assert!(told.contains("I are fitted"), "{told}");
}

#[test]
fn bad_input_of_data_is_named() {
    let path = &new_folder();
    assert!(fail(path, &["fit", "--data", "nowhere.uvfits"]).contains("nowhere.uvfits"));
    std::fs::write(path.join("words.csv"), "some,words\n1,2\n").unwrap();
    assert!(fail(path, &["fit", "--data", "words.csv"]).contains("words.csv"));
    std::fs::write(path.join("flat.csv"), "time_utc_h,I\n1.0,2.0\n1.1,2.0\n1.2,2.0\n").unwrap();
    assert!(fail(path, &["fit", "--data", "flat.csv"]).contains("does not vary"));
    fail_with(path, &["fit", "some.toml", "--data", "flat.csv"], &["cannot be used with"]);
}

/// The public files of the EHT: settings for each are complete.
#[test]
fn code_eht_data_need_nothing_more() {
    let here = tempfile::tempdir().unwrap();
    for file in eht_data::all(&["uvfits"]) {
        let text = succeed(here.path(), &["fit", "--data", file.to_str().unwrap(), "--print"]);
        assert!(!text.contains("FILL IN") && text.contains("table = \"EHT2017\""), "{text}");
        // What Sgr A* varied in these nights is what it usually varies: no motion is needed.
        assert!(text.contains("[image]"), "{}: {text}", file.display());
    }
}

/// Two blobs of Sgr A* that stand still are fitted as an image; the same pair turning by a full circle asks for motion.
#[test]
fn exact_a_quick_look_tells_what_moves() {
    let path = &new_folder();
    let (side, frames) = (24, 12);
    let image = |turn: f64| {
        let (sin, cos) = turn.sin_cos();
        let light = |k: usize| {
            let place = |k: usize| 120.0 * ((k as f64 + 0.5) / side as f64 - 0.5);
            let (x, y) = (place(k % side), place(k / side));
            let blob = |x: f64, y: f64| (-(x * x + y * y) / 150.0).exp();
            0.05 * (blob(x - 25.0 * cos, y - 25.0 * sin) + 0.4 * blob(x + 20.0, y))
        };
        let row = |row: usize| {
            let cells = (0..side).map(|column| format!("{:e}", light(row * side + column)));
            cells.collect::<Vec<_>>().join(",") + "\n"
        };
        (0..side).map(row).collect::<String>()
    };
    for (name, turn) in [("still", 0.0), ("turning", std::f64::consts::TAU)] {
        let files: Vec<String> = (0..frames)
            .map(|k| {
                let file = format!("{name}{k:02}.csv");
                let angle = turn * k as f64 / f64::from(frames - 1);
                std::fs::write(path.join(&file), image(angle)).unwrap();
                file
            })
            .collect();
        let seen = "--fov-uas 120 --array EHT2017 --source sgra --mjd 57850 --utc 12.5-13.6 --frames 12 --tint 60 --scatter-sgra --noise thermal --seed 1 --frame-times 12.5-13.6";
        let data = format!("{name}.uvfits");
        let files: Vec<&str> = files.iter().map(String::as_str).collect();
        succeed(path, &[&["observe"], &files[..], &words_of(seen), &["-o", &data]].concat());
        let text = succeed(path, &["fit", "--data", &data, "--print"]);
        assert_eq!(text.contains("[image]"), name == "still", "{text}");
        let said = if name == "still" { "no motion is needed" } else { "too much for an image" };
        assert!(text.contains(said), "{text}");
    }
}
