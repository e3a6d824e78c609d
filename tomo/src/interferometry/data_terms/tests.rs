//! Every term: gradients by finite differences, mean of χ², agreement of both precisions.

use super::*;
use crate::interferometry::Complex64;
use crate::interferometry::noise::add_thermal_noise;
use crate::interferometry::observation::{Basis, Row};
use crate::interferometry::products::ClosureKind;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;

/// Scans of seven stations, some baselines exchanged, signal to noise around `snr`.
fn observation(scans: usize, snr: f64) -> Observation {
    let mut random = Pcg64Mcg::seed_from_u64(11);
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
fn terms<T: Real>(data: &Observation) -> Vec<(&'static str, Box<dyn DataTerm<T>>)> {
    let closure = |kind| Box::new(ClosureTerm::<T>::new(data, kind, 0.0).unwrap());
    vec![
        ("visibilities", Box::new(VisibilityTerm::<T>::new(data).unwrap())),
        ("amplitudes", Box::new(AmplitudeTerm::<T>::new(data).unwrap())),
        ("closure phases", closure(ClosureKind::Phase)),
        ("log closure amplitudes", closure(ClosureKind::LogAmplitude)),
    ]
}

/// A model that is off by 10 %.
fn model(data: &Observation) -> Vec<Complex64> {
    let mut random = Pcg64Mcg::seed_from_u64(12);
    let mut part = || 0.1 * random.random_range(-1.0..1.0);
    data.rows.iter().map(|row| row.products[0] + Complex64::new(part(), part())).collect()
}

#[test]
fn exact_gradients_by_finite_differences() {
    let data = observation(2, 20.0);
    let model = model(&data);
    for (name, term) in terms::<f64>(&data) {
        let mut gradient = vec![Complex64::new(0.0, 0.0); model.len()];
        let value = term.value_and_gradient(&model, 1.0, &mut gradient);
        assert!(value > 1.0 && term.visibilities() == model.len());
        let scale = gradient.iter().map(|g| g.norm()).fold(0.0, f64::max);
        for k in 0..model.len() {
            for direction in [Complex64::new(1.0, 0.0), Complex64::new(0.0, 1.0)] {
                // Fourth order: errors of h⁴ and of rounding/h meet near 1e-10.
                let at = |h: f64| {
                    let mut moved = model.clone();
                    moved[k] += direction * h;
                    term.value_and_gradient(
                        &moved,
                        0.0,
                        &mut vec![Complex64::new(0.0, 0.0); moved.len()],
                    )
                };
                let h = 1e-3;
                let slope = (8.0 * (at(h) - at(-h)) - (at(2.0 * h) - at(-2.0 * h))) / (12.0 * h);
                let exact = (gradient[k].conj() * direction).re;
                assert!((slope - exact).abs() < 1e-7 * scale, "{name} {k}: {slope} {exact}");
            }
        }
        // The gradient adds, with the weight it is asked for.
        let mut twice = gradient.clone();
        term.value_and_gradient(&model, 1.0, &mut twice);
        let doubled = twice.iter().zip(&gradient).all(|(a, b)| (a - b - b).norm() < 1e-12 * scale);
        assert!(doubled, "{name}");
    }
}

#[test]
fn exact_single_precision_follows_double() {
    let data = observation(2, 20.0);
    let model = model(&data);
    let single: Vec<Complex<f32>> =
        model.iter().map(|v| Complex::new(v.re as f32, v.im as f32)).collect();
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
    let truth = observation(400, 60.0);
    let mut noisy = truth.clone();
    add_thermal_noise(&mut noisy, 1);
    let model: Vec<Complex64> = truth.rows.iter().map(|row| row.products[0]).collect();
    for (name, term) in terms::<f64>(&noisy) {
        let mut gradient = vec![Complex64::new(0.0, 0.0); model.len()];
        let value = term.value_and_gradient(&model, 1.0, &mut gradient);
        let degrees = term.degrees_of_freedom() as f64;
        let allowed = 5.0 * (2.0 * degrees).sqrt() + 10.0 * degrees / 60f64.powi(2);
        assert!((value - degrees).abs() < allowed, "{name}: {value} of {degrees}");
    }
}

#[test]
fn exact_data_without_errors_are_refused() {
    let mut data = observation(1, 20.0);
    data.rows[3].noise_sigma[0] = 0.0;
    let message = VisibilityTerm::<f64>::new(&data).unwrap_err().to_string();
    assert!(message.contains("datum 3: sigma = 0"), "{message}");
    data.rows.clear();
    assert_eq!(AmplitudeTerm::<f32>::new(&data).unwrap_err(), DataTermError::Empty);
    assert!(ClosureTerm::<f32>::new(&data, ClosureKind::Phase, 0.0).is_err());
}
