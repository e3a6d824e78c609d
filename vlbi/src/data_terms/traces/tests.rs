use super::super::polarized::tests::{off, scan};
use super::*;
use crate::conformance;
use crate::noise::{add_thermal_noise, apply_leakage};

fn chi_squared(term: &TraceTerm, model: &[Complex64]) -> f64 {
    let value = term.value_and_gradient(model, 0.0, &mut vec![Complex64::default(); model.len()]);
    let squares: f64 = term.residuals(model).iter().map(|r| r.value * r.value).sum();
    assert!((value - squares).abs() <= 1e-9 * squares.max(1e-9), "{value} {squares}");
    assert_eq!(term.residuals(model).len(), DataTerm::<f64>::degrees_of_freedom(term));
    value / DataTerm::<f64>::degrees_of_freedom(term) as f64
}

/// Central differences in both precisions: to 1e-6, and along random directions, which is the dot product of the gradient
/// with them, too.
#[test]
fn exact_gradients_of_traces() {
    let (data, truth, _) = scan(0.0, true);
    let (model, term) = (off(&truth), TraceTerm::new(&data, 0.0).unwrap());
    conformance::data_term::<f64>("closure traces", &term, &model, 1e-4, 1e-7);
    let single: Vec<Complex<f32>> =
        model.iter().map(|v| Complex::new(v.re as f32, v.im as f32)).collect();
    conformance::data_term::<f32>("in single precision", &term, &single, 1e-3, 2e-2);
}

/// ⟨J x, y⟩ = ⟨x, Jᵀ y⟩ of the map from changes of I, Q and U to those of ln|T| and arg T: the gradient of a linear form in
/// the logarithms, whose changes along x are those of complex steps.
#[test]
fn exact_adjoint_of_slopes() {
    let (data, truth, _) = scan(0.0, false);
    let term = TraceTerm::new(&data, 0.0).unwrap();
    let (model, x) = (off(&truth), off(&off(&truth)));
    let scan = &term.scans[0];
    let logs = scan.logs(&term.coherencies(&model));
    let y: Vec<f64> = (0..logs.len()).map(|k| (1.7 * k as f64).sin()).collect();
    let mut slopes = vec![[Complex64::default(); 4]; term.rows];
    for ((quantity, log), y) in scan.quantities.iter().zip(&logs).zip(&y) {
        pull_back(quantity, &log.unwrap(), *y, &mut slopes);
    }
    let back: Vec<[Complex64; 3]> = slopes.into_iter().map(of_stokes).collect();
    let right: f64 =
        (0..x.len()).map(|k| (back[k % term.rows][k / term.rows].conj() * x[k]).re).sum();
    let changes = term.coherencies(&x);
    let left: f64 = scan
        .quantities
        .iter()
        .zip(&logs)
        .zip(&y)
        .map(|((quantity, log), y)| y * quantity.part.of(change(quantity, &log.unwrap(), &changes)))
        .sum();
    assert!((left - right).abs() < 1e-10 * left.abs(), "{left} {right}");
}

/// d ln T along changes of the coherencies.
fn change(quantity: &TraceQuantity, log: &LogTrace, changes: &[Coherency]) -> Complex64 {
    let mut sum = Complex64::default();
    for (leg, slopes) in quantity.trace.legs.iter().zip(&log.slopes) {
        let [[rr, rl], [lr, ll]] = changes[leg.row].0;
        for (v, c) in [rr, ll, rl, lr].into_iter().zip(slopes) {
            sum += c * if leg.is_reversed { v.conj() } else { v };
        }
    }
    sum
}

/// Whatever the gains of both hands and the leakage are: the truth explains the data to rounding. The scale of a model and
/// the position angle of all of it do not count, the rest of the polarisation does.
#[test]
fn exact_gains_and_leakage_cancel() {
    let (mut data, truth, _) = scan(0.0, true);
    apply_leakage(&mut data, 0.2, 3).unwrap();
    for row in &mut data.rows {
        let gain = |k: u16, hand: usize| {
            let phase = f64::from(3 * k) + 1.3 * hand as f64;
            Complex64::from_polar(1.0 + 0.3 * phase.sin(), phase)
        };
        let [a, b] = row.stations;
        for (k, [p, q]) in [[0, 0], [1, 1], [0, 1], [1, 0]].into_iter().enumerate() {
            row.products[k] *= gain(a, p) * gain(b, q).conj();
        }
    }
    let term = TraceTerm::new(&data, 0.0).unwrap();
    let close = |model: &[Complex64]| chi_squared(&term, model);
    assert!(close(&truth) < 1e-16, "{}", close(&truth));
    let brighter: Vec<Complex64> = truth.iter().map(|v| 7.0 * v).collect();
    assert!(close(&brighter) < 1e-16);
    let rows = truth.len() / 3;
    let turned: Vec<Complex64> = (0..3 * rows)
        .map(|k| {
            let (sin, cos) = 0.8f64.sin_cos();
            let [q, u] = [rows + k % rows, 2 * rows + k % rows].map(|k| truth[k]);
            [truth[k], q * cos - u * sin, q * sin + u * cos][k / rows]
        })
        .collect();
    assert!(close(&turned) < 1e-16, "{}", close(&turned));
    let mut less = truth.clone();
    less[rows..].iter_mut().for_each(|v| *v *= 0.5);
    assert!(close(&less) > 3.0, "{}", close(&less));
}

/// With noise χ² of the truth has the mean that the number of data says, for errors of one and of three per cent.
#[test]
fn exact_chi_squared_of_the_truth() {
    for sigma in [0.01, 0.03] {
        let (mut data, truth, _) = scan(0.05, true);
        data.rows.iter_mut().for_each(|row| row.noise_sigma = [sigma; 4]);
        let of = |seed| {
            let mut noisy = data.clone();
            add_thermal_noise(&mut noisy, seed);
            chi_squared(&TraceTerm::new(&noisy, 0.0).unwrap(), &truth)
        };
        let mean = (0..100).map(of).sum::<f64>() / 100.0;
        assert!((0.93..1.1).contains(&mean), "{sigma}: {mean}");
    }
}

#[test]
fn exact_dark_models_and_what_has_no_traces() {
    let (mut data, truth, _) = scan(0.0, false);
    let term = TraceTerm::new(&data, 0.0).unwrap();
    let dark = vec![Complex64::default(); truth.len()];
    let mut gradient = dark.clone();
    assert!(term.value_and_gradient(&dark, 1.0, &mut gradient) > 1e4);
    assert!(gradient.iter().all(|g| *g == Complex64::default()));
    assert_eq!(TraceTerm::uv(&data, 0.0).len(), data.rows.len());
    // A station of which one hand was measured takes no part.
    let before = DataTerm::<f64>::degrees_of_freedom(&term);
    for row in data.rows.iter_mut().filter(|row| row.stations.contains(&1)) {
        row.noise_sigma[1] = f64::NAN;
    }
    let left = TraceTerm::new(&data, 0.0).unwrap();
    assert!(DataTerm::<f64>::degrees_of_freedom(&left) < before);
    let three: Vec<u16> = data.rows[0].stations.to_vec();
    data.rows.retain(|row| {
        row.stations.iter().any(|s| three.contains(s)) && row.stations[1] == three[1]
    });
    let none = TraceTerm::new(&data, 0.0).err();
    assert!(matches!(none, Some(Error::DataTerm(DataTermError::Empty))));
    data.basis = Basis::Stokes;
    let refused = TraceTerm::new(&data, 0.0).err().unwrap().to_string();
    assert!(refused.contains("RR, LL, RL, LR"), "{refused}");
}
