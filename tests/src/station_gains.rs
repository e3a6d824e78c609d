//! `kerrlight fit` with station gains that are not known.

use crate::fit::results;
use crate::support::{fail, fail_with, folder_with, sets, succeed};
use kerrlight_render::volume::VolumeArrays;

/// Gains of 15 %, of 60 % at the LMT, and random phases, all of them new in every scan.
const ERRORS: &str = "simulation.observation.gains={constant_amplitude=0.0,scan_amplitude=0.15,random_phases=true,stations={LMT=0.6}}";
const FREE: &str = "instrument.gains={phases=\"free\",amplitude=0.15,stations={LMT=0.6}}";

/// A fit of the built-in experiment with fewer pixels, frames and nodes, more settings, and where it goes.
fn small<'a>(more: &[&'a str], run: &'a str) -> Vec<&'a str> {
    let usual = [
        "screen.pixels=20",
        "screen.jy_per_pixel=0.32",
        "simulation.observation.scans=16",
        "representation=linear-grid",
        "representation.linear-grid.nodes=24",
        "linear.smoothness=0.03",
        "output.nodes=24",
    ];
    [&["fit", "-o", run], &sets(&usual)[..], &sets(more)].concat()
}

fn number(found: &serde_json::Value, path: &[&str]) -> f64 {
    path.iter().fold(found, |value, key| &value[*key]).as_f64().unwrap()
}

/// The built-in experiment: within 2 dB of a fit to data without errors of gains; the gains themselves to 2 %; χ² as noise
/// alone would have it.
#[test]
#[ignore = "long"]
fn exact_gains_are_found_with_the_flare() {
    let folder = tempfile::tempdir().unwrap();
    succeed(folder.path(), &["fit", "-o", "known"]);
    succeed(folder.path(), &["fit", "--set", ERRORS, "--set", FREE, "-o", "free"]);
    let [known, free] = ["known", "free"].map(|name| results(&folder.path().join(name)));
    let lost = number(&known, &["psnr_db"]) - number(&free, &["psnr_db"]);
    assert!(lost < 2.0, "{lost} dB lost: {free}");
    let rms = number(&free, &["gains", "beside_the_truth", "rms"]);
    assert!(rms < 0.02, "{free}");
    let chi2 = number(&free, &["chi2_per_datum", "visibilities"]);
    assert!((0.8..1.3).contains(&chi2), "{free}");
    let report = std::fs::read_to_string(folder.path().join("free/report.html")).unwrap();
    assert!(report.contains("Station gains") && report.contains("--gains gains.csv"));
    let table = std::fs::read_to_string(folder.path().join("free/gains.csv")).unwrap();
    assert!(table.starts_with("time_utc_h,span_s,station,amplitude,"), "{table}");
    assert!(table.lines().count() > 64 * 5);
}

/// Closure quantities, which gains cannot touch, give the same volume as gains that are free.
#[test]
#[ignore = "long"]
fn exact_closures_and_free_gains_agree() {
    let folder = tempfile::tempdir().unwrap();
    let closures = r#"loss=[{data="closure-phases",weight=1.0},{data="log-closure-amplitudes",weight=1.0},{data="light-curve",weight=1.0,sigma=0.01}]"#;
    let wide = "instrument.gains={phases=\"free\",amplitude=1.0}";
    succeed(folder.path(), &small(&[ERRORS, closures], "closures"));
    succeed(folder.path(), &small(&[ERRORS, wide], "free"));
    let found = |name: &str| {
        let (name, folder) = (format!("{name}/volume.npz"), folder.path());
        let bytes = std::fs::read(folder.join(name)).unwrap();
        VolumeArrays::from_npz(&bytes).unwrap().located().unwrap().volume
    };
    let (a, b) = (found("closures"), found("free"));
    let alike = kerrlight_render::volume::metrics::compare(&a, &b, None).unwrap().correlation;
    assert!(alike.unwrap() > 0.95, "{alike:?}");
}

/// Gains that are taken out leave data that a fit without gains explains.
#[test]
fn exact_gains_of_a_table_calibrate_data() {
    let seen = "time_utc_h,t1,t2,u,v,re,im,sigma\n1.0,AA,LM,1e9,2e9,0.4,0.2,0.01\n1.0,AA,PV,3e9,2e9,0.4,0.2,0.01\n";
    let folder = folder_with("in.csv", seen);
    let gains =
        "time_utc_h,span_s,station,amplitude,phase_deg\n1.0,10,AA,2.0,90.0\n1.0,10,LM,1.0,0.0\n";
    std::fs::write(folder.path().join("gains.csv"), gains).unwrap();
    succeed(folder.path(), &["convert", "in.csv", "out.csv", "--gains", "gains.csv"]);
    let rows = std::fs::read_to_string(folder.path().join("out.csv")).unwrap();
    let row: Vec<f64> =
        rows.lines().nth(1).unwrap().split(',').skip(3).map(|x| x.parse().unwrap()).collect();
    // (0.4 + 0.2i)/2i, with half the error.
    assert!((row[2] - 0.1).abs() < 1e-9 && (row[3] + 0.2).abs() < 1e-9, "{rows}");
    assert!((row[4] - 0.005).abs() < 1e-9 && rows.lines().count() == 2, "{rows}");
    let none = "time_utc_h,span_s,station,amplitude,phase_deg\n9.0,10,AA,2.0,90.0\n";
    std::fs::write(folder.path().join("none.csv"), none).unwrap();
    let error = fail(folder.path(), &["convert", "in.csv", "no.csv", "--gains", "none.csv"]);
    assert!(error.contains("has no gains for the stations and times"), "{error}");
    let error = fail(folder.path(), &["convert", "in.csv", "no.csv", "--gains", "in.csv"]);
    assert!(error.contains("there is no column span_s"), "{error}");
}

#[test]
fn bad_input_of_gains_is_named_and_nothing_is_begun() {
    let folder = tempfile::tempdir().unwrap();
    let images = r#"loss=[{data="image",weight=1.0,sigma=0.01}]"#;
    let both = r#"loss=[{data="visibilities",weight=1.0},{data="amplitudes",weight=1.0}]"#;
    for (more, says) in [
        (
            vec!["instrument.gains={phases=\"free\",stations={LMT=0.6}}"],
            "instrument.gains.stations.",
        ),
        (vec!["instrument.gains={phases=\"free\",table=\"VLA\"}"], "EHT2017 or ngEHT"),
        (
            vec!["instrument.gains={phases=\"free\",amplitude=-1.0}"],
            "instrument.gains.amplitude = -1",
        ),
        (
            vec!["instrument.gains={phases=\"free\",amplitude=0.1,stations={NOWHERE=0.1}}"],
            "NOWHERE: no such station",
        ),
        (vec![FREE, images], "needs a loss of visibilities or of amplitudes"),
        (vec![FREE, both], "would each have gains of their own"),
        (
            vec![
                "simulation.observation.gains={constant_amplitude=0.0,scan_amplitude=0.1,random_phases=true,stations={XX=0.6}}",
            ],
            "simulation.observation.gains.stations.XX",
        ),
    ] {
        fail_with(folder.path(), &small(&more, "none"), &[says]);
    }
}
