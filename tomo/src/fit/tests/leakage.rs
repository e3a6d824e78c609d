//! A polarised flare seen through leaking feeds.

use super::{Pulse, beside, changed, simulated, slope};
use crate::fit::settings::FitFile;
use crate::fit::setup::{self, Instrument};

const FLARE: &str = include_str!("../../../../scenes/fits/polarized_flare.toml");

fn file(set: &[&str]) -> FitFile {
    let small = [
        "screen.pixels=16",
        "representation.linear-grid.nodes=16",
        "linear.iterations=25",
        "simulation.observation.scans=24",
        "simulation.observation.bandwidth_ghz=8.0",
        "simulation.truth.spot.0.sigma=1.0",
        "instrument.leakage.rounds=5",
    ];
    FitFile::parse(&changed(FLARE, &[&small, set].concat())).unwrap()
}

/// Gradients of the loss with respect to parameters, against central differences.
#[test]
fn exact_gradients_with_respect_to_emission() {
    let file = file(&["simulation.observation.scans=3", "screen.pixels=12"]);
    let (instrument, measured) = simulated(&file);
    assert_eq!(measured.pulse, Pulse::Triangle, "unlike that of measured data");
    let motion = setup::motion(&file, measured.times.clone()).unwrap();
    let model = instrument.forward::<f64>(&motion).unwrap();
    measured.restore_leakage(measured.true_leakage.as_ref().unwrap());
    let terms = measured.visibility_terms::<f64>(&file.loss, 144).unwrap();
    let images = 3 * 144;
    let image: Vec<f64> = (0..images).map(|k| 0.01 * (0.7 * k as f64).sin()).collect();
    assert_eq!((model.pixels(), terms[0].term.pixels()), (images, images));
    let value = |image: &[f64], gradient: &mut [f64]| {
        terms[0].term.value_and_gradient(1, image, 1.0, gradient)
    };
    let mut gradient = vec![0.0; images];
    value(&image, &mut gradient);
    let largest = gradient.iter().fold(0.0f64, |most, g| most.max(g.abs()));
    for k in (0..images).step_by(7) {
        let difference = slope(1e-3, |h| value(&beside(&image, k, h), &mut vec![0.0; images]));
        assert!((difference - gradient[k]).abs() < 1e-6 * largest, "{k}");
    }
}

/// Settings that contradict polarised visibilities and leakage are refused by name.
#[test]
fn exact_refusals() {
    let refused = |set: &[&str], without_field: bool| {
        let mut file = file(set);
        if without_field {
            file.polarization = None;
        }
        let registry = crate::representation::Registry::default();
        let checked =
            setup::check(&file, &registry).and_then(|()| Instrument::new(&file).map(drop));
        checked.unwrap_err().to_string()
    };
    assert!(refused(&[], true).starts_with("polarization is missing"));
    let intensity = "loss=[{data=\"visibilities\",weight=1.0}]";
    assert!(refused(&[intensity], false).contains("instrument.leakage needs a loss"));
    let both =
        "loss=[{data=\"polarized-visibilities\",weight=1.0},{data=\"image\",weight=1.0,sigma=1.0}]";
    assert!(refused(&[both], false).contains("images are not allowed"));
    let drawn = ["representation={kind=\"grid\",grid.nodes=8,activation=\"linear\"}"];
    let message = refused(&drawn, false);
    assert!(message.contains("representation.kind = \"linear-grid\""), "{message}");
}
