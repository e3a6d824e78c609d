//! The term of free gains beside those that gains cannot touch.

use super::super::tests::{observation, of_precision, off, truth};
use super::*;
use crate::array::Station;
use crate::conformance;
use crate::data_terms::ClosureTerm;
use crate::noise::{GainErrors, add_thermal_noise, apply_gains};
use crate::products::ClosureKind;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;

/// A scan of seven stations with gains of 15 % and random phases, and its true visibilities.
fn scan(seed: u64, snr: f64) -> (Observation, Vec<Complex64>) {
    let mut observation = observation(1, snr, seed);
    observation.stations = (0..7).map(|k| Station::named(&format!("S{k}"))).collect();
    let truth = truth(&observation);
    let errors = GainErrors { scan_amplitude: 0.15, random_phases: true, ..GainErrors::default() };
    apply_gains(&mut observation, &errors, seed);
    add_thermal_noise(&mut observation, seed);
    (observation, truth)
}

fn priors(free_phases: bool) -> GainPriors {
    GainPriors { free_phases, amplitude_sigma: vec![0.15; 7] }
}

#[test]
fn exact_gradients_of_the_least_chi2() {
    let (data, truth) = scan(1, 20.0);
    let model = off(&truth);
    let free = GainTerm::visibilities(&data, &priors(true)).unwrap();
    conformance::data_term::<f64>("free gains", &free, &model, 1e-3, 1e-7);
    let held = GainTerm::visibilities(&data, &priors(false)).unwrap();
    conformance::data_term::<f64>("amplitudes free", &held, &model, 1e-3, 1e-7);
    let amplitudes = GainTerm::amplitudes(&data, &priors(true)).unwrap();
    conformance::data_term::<f64>("of amplitudes", &amplitudes, &model, 1e-3, 1e-7);
    let single = of_precision::<f32>(&model);
    conformance::data_term::<f32>("in single precision", &free, &single, 1e-2, 2e-3);
}

/// χ² of the truth is the number of degrees of freedom; residuals and their freedoms add up to both.
#[test]
fn exact_degrees_of_freedom() {
    let (mut sums, count) = ([0.0; 2], 200);
    for seed in 0..count {
        let (data, truth) = scan(seed, 30.0);
        let terms = [
            GainTerm::visibilities(&data, &priors(true)).unwrap(),
            GainTerm::amplitudes(&data, &priors(true)).unwrap(),
        ];
        for (sum, term) in sums.iter_mut().zip(terms) {
            let chi2 = conformance::reduced_chi2("gains", &term, &truth, 1e-8);
            *sum += chi2 / f64::from(count as u32);
        }
    }
    assert!(sums.iter().all(|chi2| (0.95..1.05).contains(chi2)), "{sums:?}");
}

/// Closure quantities are the limit of free gains: without priors, χ² of a model that is nearly right is that of all
/// closure phases and log closure amplitudes together.
#[test]
fn exact_closures_are_the_limit_of_free_gains() {
    let (data, truth) = scan(4, 300.0);
    let wide = GainPriors { free_phases: true, amplitude_sigma: vec![1e3; 7] };
    let free = GainTerm::visibilities(&data, &wide).unwrap();
    let value = |term: &dyn DataTerm<f64>, model: &[Complex64]| {
        term.value_and_gradient(model, 0.0, &mut vec![Complex64::default(); 21])
    };
    let mut random = Pcg64Mcg::seed_from_u64(5);
    let mut part = || 0.01 * random.random_range(-1.0..1.0);
    let model: Vec<Complex64> =
        truth.iter().map(|v| v * Complex64::new(1.0 + part(), part())).collect();
    let closures: f64 = [ClosureKind::Phase, ClosureKind::LogAmplitude]
        .iter()
        .map(|kind| value(&ClosureTerm::<f64>::new(&data, *kind, 0.0).unwrap(), &model))
        .sum();
    let gains = value(&free, &model);
    assert!((gains / closures - 1.0).abs() < 0.02, "{gains} {closures}");
}

/// Every baseline keeps its two residuals, and the one that is wrong has the largest over what gains leave of it.
#[test]
fn exact_residuals_stay_with_their_baselines() {
    let (mut data, truth) = scan(2, 30.0);
    let wrong = 17;
    let sigma = data.rows[wrong].noise_sigma[0];
    data.rows[wrong].products[0] += 12.0 * sigma;
    let term = GainTerm::visibilities(&data, &priors(true)).unwrap();
    let residuals = DataTerm::<f64>::residuals(&term, &truth);
    for row in &data.rows {
        let own = residuals.iter().filter(|residual| residual.stations == row.stations);
        assert_eq!(own.count(), 2);
    }
    let size = |residual: &Residual| residual.value.powi(2) / residual.freedom;
    let largest = residuals.iter().max_by(|a, b| size(a).total_cmp(&size(b))).unwrap();
    assert_eq!(largest.stations, data.rows[wrong].stations);
}

#[test]
fn exact_data_that_make_no_term_are_refused() {
    let (mut data, _) = scan(1, 20.0);
    data.rows[3].noise_sigma[0] = 0.0;
    let refused = GainTerm::visibilities(&data, &priors(true)).unwrap_err().to_string();
    assert!(refused.contains("data point 3: sigma = 0"), "{refused}");
    data.rows.clear();
    assert!(GainTerm::amplitudes(&data, &priors(true)).is_err());
}

/// About a model χ² and its gradient are those of gains that are solved for.
#[test]
fn exact_tangents_touch_the_least_chi2() {
    for priors in [priors(true), GainPriors { free_phases: true, amplitude_sigma: vec![0.0; 7] }] {
        let (data, truth) = scan(1, 20.0);
        let term = GainTerm::visibilities(&data, &priors).unwrap();
        let model = off(&truth);
        let tangent = term.clone().tangent(&model).unwrap();
        let value = |term: &dyn DataTerm<f64>, model: &[Complex64]| {
            let mut gradient = vec![Complex64::default(); model.len()];
            (term.value_and_gradient(model, 1.0, &mut gradient), gradient)
        };
        let ((exact, slopes), (near, near_slopes)) =
            (value(&term, &model), value(&tangent, &model));
        assert!((near / exact - 1.0).abs() < 1e-9, "{exact} {near}");
        let largest = slopes.iter().map(|g| g.norm()).fold(0.0, f64::max);
        let apart =
            slopes.iter().zip(&near_slopes).map(|(a, b)| (a - b).norm()).fold(0.0, f64::max);
        assert!(apart < 1e-6 * largest, "{apart:e} {largest:e}");
        conformance::data_term::<f64>("tangent", &tangent, &off(&model), 1e-3, 1e-7);
        conformance::reduced_chi2("tangent", &tangent, &model, 1e-9);
    }
}

/// About a model that explains the data χ² is right up to third order: for half of a small distance an eighth is left.
#[test]
fn exact_tangents_are_right_about_what_explains_the_data() {
    let (data, truth) = scan(1, 1e7);
    let term = GainTerm::visibilities(&data, &priors(true)).unwrap();
    let gains = term.gains(&truth).0;
    // Data without noise, whose gains cost nothing.
    let mut exact = data.clone();
    for (k, row) in exact.rows.iter_mut().enumerate() {
        let phases = ScanGains { log_amplitude: vec![0.0; 7], ..gains.clone() };
        row.products[0] = phases.on(term.problem.pairs()[k]) * truth[k];
        row.noise_sigma[0] = 0.05;
    }
    let term = GainTerm::visibilities(&exact, &priors(true)).unwrap();
    let tangent = term.clone().tangent(&truth).unwrap();
    let there = off(&truth);
    let left = [0.04, 0.02, 0.01].map(|part: f64| {
        let moved: Vec<Complex64> =
            truth.iter().zip(&there).map(|(v, t)| v + part * (t - v)).collect();
        let mut none = vec![Complex64::default(); moved.len()];
        let exact = term.value_and_gradient(&moved, 1.0, &mut none);
        (exact - tangent.value_and_gradient(&moved, 1.0, &mut none)).abs()
    });
    println!("left at 0.04, 0.02, 0.01 of the way: {left:?}");
    assert!(left[0] > 0.0 && left[1] < left[0] / 6.0 && left[2] < left[1] / 6.0, "{left:?}");
}

/// Phases of stations change nothing: visibilities turned by any have the same χ² about the model turned alike.
#[test]
fn exact_tangents_do_not_know_phases() {
    let (data, truth) = scan(3, 50.0);
    let priors = GainPriors { free_phases: true, amplitude_sigma: vec![0.0; 7] };
    let value = |turns: f64| {
        let mut turned = data.clone();
        for row in &mut turned.rows {
            let [a, b] = row.stations.map(f64::from);
            row.products[0] *= Complex64::cis(turns * (a * a - b * b));
        }
        let term = GainTerm::visibilities(&turned, &priors).unwrap();
        let tangent = term.tangent(&truth).unwrap();
        tangent.value_and_gradient(&off(&truth), 1.0, &mut vec![Complex64::default(); truth.len()])
    };
    let (plain, turned) = (value(0.0), value(0.7));
    assert!((plain / turned - 1.0).abs() < 1e-6, "{plain} {turned}");
}
