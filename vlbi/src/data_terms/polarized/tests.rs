//! Products of feeds with leakage and gains.

use super::super::tests::{of_precision, off};
use super::*;
use crate::array::built_in;
use crate::conformance;
use crate::earth::SourcePosition;
use crate::noise::{GainErrors, add_thermal_noise, apply_gains, apply_leakage};
use crate::schedule::tests::{SCHEDULE, SETUP};
use crate::schedule::{Schedule, Setup, observe};
use core::f64::consts::PI;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;

/// A scan of the EHT with random visibilities of about 1 Jy and any phase, their I, Q and U, and the leakage that was put on them.
pub fn scan(leakage: f64, gains: bool) -> (Observation, Vec<Complex64>, SharedLeakage) {
    let schedule = Schedule { start_h: 12.0, stop_h: 13.0, scans: 1, ..SCHEDULE };
    let setup = Setup { frequency_hz: 230e9, bandwidth_hz: 2e9, ..SETUP };
    let array = built_in("EHT2017").unwrap();
    let mut data = observe(&array, SourcePosition::SGR_A, &schedule, &setup).unwrap();
    let mut random = Pcg64Mcg::seed_from_u64(8);
    let mut draw = |size: f64| {
        let part: f64 = random.random_range(0.5..1.5);
        Complex64::from_polar(size * part, random.random_range(-PI..PI))
    };
    let rows = data.rows.len();
    assert!(rows >= 10);
    let truth: Vec<Complex64> =
        (0..3 * rows).map(|k| draw(if k < rows { 1.0 } else { 0.3 })).collect();
    let i = Complex64::new(0.0, 1.0);
    for (k, row) in data.rows.iter_mut().enumerate() {
        let [flux, q, u] = [truth[k], truth[rows + k], truth[2 * rows + k]];
        row.products = [flux, flux, q + i * u, q - i * u];
    }
    let shared = SharedLeakage::none(data.stations.len());
    if leakage > 0.0 {
        shared.set(apply_leakage(&mut data, leakage, 3).unwrap());
    }
    if gains {
        let errors = GainErrors { scan_amplitude: 0.1, random_phases: true, ..Default::default() };
        apply_gains(&mut data, &errors, 3);
    }
    (data, truth, shared)
}

fn priors(data: &Observation) -> GainPriors {
    GainPriors { free_phases: true, amplitude_sigma: vec![0.1; data.stations.len()] }
}

/// Central differences in both precisions, with gains and without.
#[test]
fn exact_gradients_of_products() {
    let (data, truth, leakage) = scan(0.05, true);
    let model = off(&truth);
    let held = PolarizedTerm::new(&data, None, Some(&leakage)).unwrap();
    conformance::data_term::<f64>("leakage", &held, &model, 1e-3, 1e-7);
    let priors = priors(&data);
    let free = PolarizedTerm::new(&data, Some(&priors), Some(&leakage)).unwrap();
    conformance::data_term::<f64>("leakage and gains", &free, &model, 1e-3, 1e-7);
    let single = of_precision::<f32>(&model);
    conformance::data_term::<f32>("in single precision", &held, &single, 1e-2, 2e-3);
}

/// The truth explains data without noise to rounding with its leakage and its gains, and not without; with noise χ² has
/// the mean that degrees of freedom say.
#[test]
fn exact_chi_squared_of_the_truth() {
    let (mut data, truth, leakage) = scan(0.05, true);
    let priors = priors(&data);
    let value = |data: &Observation, leakage: Option<&SharedLeakage>| {
        let term = PolarizedTerm::new(data, Some(&priors), leakage).unwrap();
        conformance::reduced_chi2("products", &term, &truth, 1e-9)
    };
    // What is left is the prior of gains that are off by as much as it allows.
    assert!(value(&data, Some(&leakage)) < 1.0);
    assert!(value(&data, None) > 20.0, "{}", value(&data, None));
    let mean = (0..20).map(|seed| {
        let mut noisy = data.clone();
        add_thermal_noise(&mut noisy, seed);
        value(&noisy, Some(&leakage))
    });
    let mean = mean.sum::<f64>() / 20.0;
    assert!((0.85..1.15).contains(&mean), "{mean}");
    data.basis = Basis::Stokes;
    let refused = PolarizedTerm::new(&data, None, Some(&leakage));
    assert!(refused.err().unwrap().to_string().contains("RR, LL, RL, LR"));
}
