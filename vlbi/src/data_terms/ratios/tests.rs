use super::super::polarized::tests::scan;
use super::super::tests::{of_precision, off};
use super::*;
use crate::conformance;
use crate::noise::{add_thermal_noise, apply_leakage};

fn chi_squared(data: &Observation, model: &[Complex64]) -> f64 {
    let term = RatioTerm::new(data, 0.0).unwrap();
    conformance::reduced_chi2("ratios", &term, model, 1e-12)
}

/// Central differences in both precisions.
#[test]
fn exact_gradients_of_ratios() {
    let (data, truth, _) = scan(0.0, true);
    let (model, term) = (off(&truth), RatioTerm::new(&data, 0.0).unwrap());
    conformance::data_term::<f64>("ratios", &term, &model, 1e-3, 1e-7);
    let single = of_precision::<f32>(&model);
    conformance::data_term::<f32>("in single precision", &term, &single, 1e-2, 2e-3);
}

/// The definition: RL/I = (Q + iU)/I, whatever gains both hands share; the scale of a model does not count; leakage does.
#[test]
fn exact_gains_cancel_and_leakage_does_not() {
    for gains in [false, true] {
        let (mut data, truth, _) = scan(0.0, gains);
        assert!(chi_squared(&data, &truth) < 1e-20, "{}", chi_squared(&data, &truth));
        let brighter: Vec<Complex64> = truth.iter().map(|v| 7.0 * v).collect();
        assert!(chi_squared(&data, &brighter) < 1e-20);
        let rows = truth.len() / 3;
        let mut flipped = truth.clone();
        flipped[2 * rows..].iter_mut().for_each(|u| *u = -*u);
        assert!(chi_squared(&data, &flipped) > 10.0, "the sign of U");
        apply_leakage(&mut data, 0.05, 3).unwrap();
        assert!(chi_squared(&data, &truth) > 10.0, "{}", chi_squared(&data, &truth));
    }
}

/// With noise χ² of the truth has the mean that degrees of freedom say; in Stokes parameters too.
#[test]
fn exact_chi_squared_of_the_truth() {
    let (mut data, truth, _) = scan(0.0, false);
    // Also where the noise is half of Stokes I.
    data.rows.iter_mut().for_each(|row| row.noise_sigma = row.noise_sigma.map(|_| 0.7));
    let mean_of = |data: &Observation| -> f64 {
        let noisy = (0..200).map(|seed| {
            let mut noisy = data.clone();
            add_thermal_noise(&mut noisy, seed);
            chi_squared(&noisy, &truth)
        });
        noisy.sum::<f64>() / 200.0
    };
    let circular = mean_of(&data);
    assert!((0.95..1.05).contains(&circular), "{circular}");
    let rows = data.rows.len();
    data.basis = Basis::Stokes;
    for (k, row) in data.rows.iter_mut().enumerate() {
        row.products = [truth[k], truth[rows + k], truth[2 * rows + k], Complex64::default()];
    }
    let stokes = mean_of(&data);
    assert!((0.95..1.05).contains(&stokes), "{stokes}");
}

#[test]
fn exact_weak_baselines_and_missing_hands_are_left_out() {
    let (mut data, truth, _) = scan(0.0, false);
    let all = RatioTerm::new(&data, 0.0).unwrap();
    let count = |term: &RatioTerm| DataTerm::<f64>::degrees_of_freedom(term);
    assert_eq!(count(&all), 4 * data.rows.len());
    data.rows[0].noise_sigma[2] = f64::NAN;
    data.rows[1].noise_sigma[0] = 1e6;
    let left = RatioTerm::new(&data, 3.0).unwrap();
    assert_eq!(count(&left), 4 * data.rows.len() - 6);
    assert_eq!(RatioTerm::uv(&data, 3.0).len(), data.rows.len() - 1);
    data.rows.iter_mut().for_each(|row| row.noise_sigma[0] = 1e6);
    let none = RatioTerm::new(&data, 3.0).err();
    assert!(matches!(none, Some(Error::DataTerm(DataTermError::Empty))));
    let dark = vec![Complex64::default(); truth.len()];
    assert!(all.residuals(&dark).iter().all(|r| r.value == -r.datum));
}

/// min over I, found by a parabola through three values of the sum that is minimised.
#[test]
fn exact_the_least_over_stokes_i() {
    let (data, truth, _) = scan(0.0, false);
    let (model, term) = (off(&truth), RatioTerm::new(&data, 0.0).unwrap());
    let plain = |row: usize| {
        let baseline = &term.baselines[row];
        let stokes = stokes(&model, row);
        let ratios: Vec<_> = baseline.ratios(stokes).collect();
        let sum = |i: Complex64| {
            let own = (i - baseline.i.visibility).norm_sqr() / baseline.i.noise_sigma.powi(2);
            let of = |(m, (_, p)): (&Complex64, &(Complex64, Measured))| {
                (m * i - p.visibility).norm_sqr() / p.noise_sigma.powi(2)
            };
            own + ratios.iter().zip(&baseline.crossed).map(of).sum::<f64>()
        };
        // The sum is a parabola with the same curvature along both axes.
        let (at, h) = (baseline.i.visibility, 0.1);
        let steps = [Complex64::new(h, 0.0), Complex64::new(0.0, h)];
        let curved = (sum(at + steps[0]) + sum(at - steps[0]) - 2.0 * sum(at)) / (h * h);
        let slopes = steps.map(|step| (sum(at + step) - sum(at - step)) / (2.0 * h));
        sum(at) - 0.5 * slopes.iter().map(|s| s * s).sum::<f64>() / curved
    };
    let least: f64 = (0..term.baselines.len()).map(plain).sum();
    let found = term.value_and_gradient(&model, 0.0, &mut vec![Complex64::default(); model.len()]);
    assert!((found / least - 1.0).abs() < 1e-9, "{found} {least}");
}
