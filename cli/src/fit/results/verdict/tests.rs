//! The verdict of the truth itself, through all that a fit's data pass through.

use super::*;
use crate::fit::{built_in_with, data};
use kerrlight_tomo::fit::Objective;
use kerrlight_tomo::fit::setup::{self, Instrument};
use std::path::Path;

/// The verdict of the simulated movie times `scale`, of the built-in experiment with changes.
fn of_truth(changes: &[&str], scale: f32) -> DataVerdict {
    let small = ["screen.pixels=20", "simulation.observation.scans=24"];
    let file = built_in_with(&[&small[..], changes].concat());
    let instrument = Instrument::new(&file).unwrap();
    let measured = data::measure(&file, &instrument, Path::new(".")).unwrap();
    let motion = setup::motion(&file, measured.times.clone()).unwrap();
    let data = measured.terms(&file.loss, 400).unwrap();
    let objective = Objective { model: instrument.forward(&motion).unwrap(), data };
    let scaled = |image: &[f64]| image.iter().map(|x| scale * *x as f32).collect();
    let movie = measured.movie.as_ref().unwrap().mapped(400, scaled).unwrap();
    let evidence =
        Evidence { file: Some(&file), losses: &file.loss, seed: file.seed, measured: &measured };
    let compared = (objective.names(), objective.statistics(&movie).unwrap());
    evidence.judged(compared, &movie, None).unwrap()
}

fn assert_explained(kind: &str, array: &str, flux: f64) {
    let loss = format!("loss=[{{data={kind:?},weight=1.0,least_snr=3.0}}]");
    let array_of = format!("simulation.observation.array={array}");
    let flux_of = format!("screen.jy_per_pixel={flux}");
    let judged = of_truth(&[&loss, &array_of, &flux_of], 1.0);
    let name = format!("{kind}, {array}, {flux}: {}", judged.headline());
    assert_eq!(judged.verdict.outcome, Outcome::Explained, "{name}");
    assert!(judged.headline().starts_with("The model explains its data: χ²"), "{name}");
}

/// Many stations and few, every kind of data.
#[test]
fn exact_the_truth_explains_its_data() {
    for kind in ["visibilities", "amplitudes", "closure-phases", "log-closure-amplitudes"] {
        for array in ["ngEHT", "EHT2017"] {
            assert_explained(kind, array, 0.08);
        }
    }
}

/// A source that hardly exceeds the noise.
#[test]
fn exact_a_faint_truth_explains_visibilities_and_amplitudes() {
    for kind in ["visibilities", "amplitudes"] {
        assert_explained(kind, "ngEHT", 0.002);
    }
}

/// A twentieth more or less light than there is.
#[test]
fn exact_another_flux_does_not_explain_visibilities() {
    for scale in [0.95, 1.05] {
        let judged = of_truth(&[], scale);
        let json = serde_json::to_value(VerdictResults::from(&judged)).unwrap();
        assert_eq!(json["outcome"], "unexplained", "{json}");
        assert!(json["data"][0]["chi2_per_datum"].as_f64().unwrap() > 1.1, "{json}");
        assert_eq!(json["data"][0]["sigma_is"], "noise");
        assert!(judged.headline().starts_with("The model does not explain its data: χ²"));
    }
}

#[test]
fn exact_noise_free_data_are_said_to_be_so() {
    let judged = of_truth(&["simulation.observation.noise=none"], 1.001);
    assert_eq!(judged.verdict.outcome, Outcome::Reproduced);
    assert!(judged.headline().contains("to 0.1 %: σ is only a weight"), "{}", judged.headline());
    let dark = of_truth(&["simulation.observation.noise=none"], 0.0);
    assert_eq!(dark.verdict.outcome, Outcome::Unexplained);
    assert!(dark.headline().contains("are 100 % of the data"), "{}", dark.headline());
}
