//! Every term: gradients by finite differences, mean of χ², agreement of both precisions.

use super::*;
use crate::Error;
use crate::conformance;
use crate::noise::add_thermal_noise;
use crate::observation::{Basis, Row};
use crate::products::{ClosureKind, ClosureSet};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;

/// Scans of seven stations, some baselines exchanged, signal to noise around `snr`.
pub(super) fn observation(scans: usize, snr: f64, seed: u64) -> Observation {
    let mut random = Pcg64Mcg::seed_from_u64(seed);
    let mut observation = Observation::empty(Basis::Stokes);
    for time in 0..scans {
        for (a, b) in (0..7u16).flat_map(|a| (a + 1..7).map(move |b| (a, b))) {
            let phase = random.random_range(-3.0..3.0);
            let visibility = Complex64::from_polar(random.random_range(0.5..1.5), phase);
            let i = Measured { visibility, noise_sigma: random.random_range(0.5..1.0) / snr };
            let stations = if (a + b) % 3 == 0 { [b, a] } else { [a, b] };
            observation.rows.push(Row::total_intensity(time as f64, stations, [0.0; 2], i));
        }
    }
    observation
}

/// The terms of an observation in either precision.
fn terms<T: Float>(data: &Observation) -> Vec<(&'static str, Box<dyn DataTerm<T>>)> {
    let closure = |kind| Box::new(ClosureTerm::<T>::new(data, kind, 0.0).unwrap());
    vec![
        ("visibilities", Box::new(VisibilityTerm::<T>::new(data).unwrap())),
        ("amplitudes", Box::new(AmplitudeTerm::<T>::new(data).unwrap())),
        ("closure phases", closure(ClosureKind::Phase)),
        ("log closure amplitudes", closure(ClosureKind::LogAmplitude)),
    ]
}

/// Returns the reason why there is no term of some data.
fn refusal<T>(term: Result<T, Error>) -> DataTermError {
    match term.err() {
        Some(Error::DataTerm(error)) => error,
        other => panic!("{other:?}"),
    }
}

pub(super) fn truth(data: &Observation) -> Vec<Complex64> {
    data.rows.iter().map(|row| row.products[0]).collect()
}

/// A model that is off by 10 %.
pub(super) fn off(truth: &[Complex64]) -> Vec<Complex64> {
    let mut random = Pcg64Mcg::seed_from_u64(12);
    let mut part = || 0.1 * random.random_range(-1.0..1.0);
    truth.iter().map(|v| v + Complex64::new(part(), part())).collect()
}

/// A model in either precision.
pub(super) fn of_precision<T: Float>(model: &[Complex64]) -> Vec<Complex<T>> {
    model.iter().map(|v| Complex::new(T::of(v.re), T::of(v.im))).collect()
}

/// Every term, closure quantities with the covariance of shared baselines.
#[test]
fn exact_gradients_in_both_precisions() {
    let data = observation(2, 20.0, 11);
    let set = &ClosureSet::of(&data, ClosureKind::Phase, 0.0)[0];
    let n = set.closures.len();
    assert!((0..n * n).any(|k| k / n != k % n && set.covariance[k] != 0.0), "nothing is shared");
    let model = off(&truth(&data));
    for (name, term) in terms::<f64>(&data) {
        conformance::data_term(name, term.as_ref(), &of_precision(&model), 1e-3, 1e-9);
    }
    for (name, term) in terms::<f32>(&data) {
        conformance::data_term(name, term.as_ref(), &of_precision(&model), 2e-2, 2e-3);
    }
}

#[test]
fn exact_single_precision_follows_double() {
    let data = observation(2, 20.0, 11);
    let model = off(&truth(&data));
    let single = of_precision::<f32>(&model);
    for ((name, double), (_, term)) in terms::<f64>(&data).into_iter().zip(terms::<f32>(&data)) {
        let mut expected = vec![Complex64::new(0.0, 0.0); model.len()];
        let value = double.value_and_gradient(&model, 1.0, &mut expected);
        let mut found = vec![Complex::new(0.0f32, 0.0); model.len()];
        let single_value = term.value_and_gradient(&single, 1.0, &mut found);
        assert!((single_value / value - 1.0).abs() < 1e-4, "{name}: {single_value} {value}");
        let scale = expected.iter().map(|g| g.norm()).fold(0.0, f64::max);
        for (a, b) in expected.iter().zip(&found) {
            let b = Complex64::new(b.re.into(), b.im.into());
            assert!((a - b).norm() < 1e-4 * scale, "{name}: {a} {b}");
        }
    }
}

/// The truth under noisy data has χ² = degrees of freedom, within five standard deviations
/// √(2·dof) and the first-order treatment of noise (1/snr²): covariances are right.
#[test]
fn exact_mean_of_chi_squared() {
    let mut noisy = observation(400, 60.0, 11);
    let model = truth(&noisy);
    add_thermal_noise(&mut noisy, 1);
    for (name, term) in terms::<f64>(&noisy) {
        let mut gradient = vec![Complex64::new(0.0, 0.0); model.len()];
        let value = term.value_and_gradient(&model, 1.0, &mut gradient);
        let degrees = term.degrees_of_freedom() as f64;
        let allowed = 5.0 * (2.0 * degrees).sqrt() + 10.0 * degrees / 60f64.powi(2);
        assert!((value - degrees).abs() < allowed, "{name}: {value} of {degrees}");
    }
}

/// Residuals are χ² datum by datum, closure quantities with their covariance.
#[test]
fn exact_squares_of_residuals_add_up_to_chi_squared() {
    let data = observation(3, 20.0, 11);
    let model = off(&truth(&data));
    for (name, term) in terms::<f64>(&data) {
        conformance::reduced_chi2(name, term.as_ref(), &model, 1e-10);
        let residuals = term.residuals(&model);
        let stations = if name.starts_with("closure") { 3 } else { 2 };
        let stations = if name.starts_with("log") { 4 } else { stations };
        assert!(residuals.iter().all(|r| r.stations.len() == stations), "{name}");
    }
}

#[test]
fn exact_data_without_errors_are_refused() {
    let mut data = observation(1, 20.0, 11);
    data.rows[3].noise_sigma[0] = 0.0;
    let message = VisibilityTerm::<f64>::new(&data).unwrap_err().to_string();
    assert!(message.contains("data point 3: sigma = 0"), "{message}");
    data.rows.clear();
    assert_eq!(refusal(AmplitudeTerm::<f32>::new(&data)), DataTermError::Empty);
    assert!(ClosureTerm::<f32>::new(&data, ClosureKind::Phase, 0.0).is_err());
}

/// Models without visibility, of a hardly visible one, and data below their noise: finite values and slopes in both precisions, and no
/// closure quantity is explained by what is dark.
fn hard<T: Float>(data: &Observation) {
    for (name, term) in terms::<T>(data) {
        let count = term.visibilities();
        let mut values = Vec::new();
        for size in [1.0, 1e-6, 1e-15, 2e-19, 1e-30, 1e-40, 0.0] {
            let model: Vec<Complex<T>> = of_precision(
                &(0..count).map(|k| Complex64::from_polar(size, k as f64)).collect::<Vec<_>>(),
            );
            let mut gradient = vec![Complex::new(T::zero(), T::zero()); count];
            let value = term.value_and_gradient(&model, T::of(1.0), &mut gradient);
            assert!(value.is_finite() && value >= 0.0, "{name} of {size:e}: {value}");
            let finite = gradient.iter().all(|g| g.re.is_finite() && g.im.is_finite());
            assert!(finite, "{name} of {size:e}: {gradient:?}");
            values.push(value);
        }
        assert!(!term.is_scale_free() || values[6] > values[0], "{name}: {values:?}");
    }
}

#[test]
fn exact_dark_models_and_faint_data_have_finite_chi_squared() {
    let mut data = observation(2, 20.0, 11);
    // Below the noise, where debiased amplitudes are 0, and nothing at all.
    data.rows[2].noise_sigma[0] = 2.0 * data.rows[2].products[0].norm();
    data.rows[5].products[0] = Complex64::new(0.0, 0.0);
    hard::<f64>(&data);
    hard::<f32>(&data);
}

#[test]
fn exact_data_that_overflow_or_are_no_numbers_are_refused() {
    let mut data = observation(1, 20.0, 11);
    data.rows[3].noise_sigma[0] = 1e-25;
    assert!(VisibilityTerm::<f64>::new(&data).is_ok());
    let message = VisibilityTerm::<f32>::new(&data).unwrap_err().to_string();
    assert!(message.contains("data point 3: sigma = 0.0000000000000000000000001 Jy"), "{message}");
    assert!(AmplitudeTerm::<f32>::new(&data).is_err());
    data.rows[3].products[0].re = f64::NAN;
    let not_finite = DataTermError::NotFinite(3);
    assert_eq!(refusal(VisibilityTerm::<f64>::new(&data)), not_finite);
    for kind in [ClosureKind::Phase, ClosureKind::LogAmplitude] {
        assert_eq!(refusal(ClosureTerm::<f64>::new(&data, kind, 0.0)), not_finite);
    }
}
