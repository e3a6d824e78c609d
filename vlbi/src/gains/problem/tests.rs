//! Gains that were put on are found again; slopes and second derivatives by differences.

use super::*;
use rand::{RngExt, SeedableRng};
use rand_distr::StandardNormal;
use rand_pcg::Pcg64Mcg;

const STATIONS: usize = 6;

/// A model of all baselines, gains, and data with noise of this σ.
fn scan(seed: u64, sigma: f64) -> (GainProblem, Vec<Complex64>, ScanGains) {
    let mut random = Pcg64Mcg::seed_from_u64(seed);
    let pairs: Vec<[usize; 2]> =
        (0..STATIONS).flat_map(|a| (a + 1..STATIONS).map(move |b| [a, b])).collect();
    let mut part = || random.random_range(-1.0..1.0f64);
    let model: Vec<Complex64> = pairs.iter().map(|_| Complex64::new(part(), part())).collect();
    let gains = ScanGains {
        log_amplitude: (0..STATIONS).map(|_| 0.2 * part()).collect(),
        phase: (0..STATIONS).map(|_| 3.1 * part()).collect(),
    };
    let mut noise = || sigma * random.sample::<f64, _>(StandardNormal);
    let seen = pairs.iter().zip(&model).map(|(p, v)| gains.on(*p) * v);
    let data = seen.map(|v| v + Complex64::new(noise(), noise())).collect();
    let priors = GainPriors { free_phases: true, amplitude_sigma: vec![0.2; STATIONS] };
    let variance = vec![sigma * sigma; pairs.len()];
    (GainProblem::new(pairs, data, &variance, &priors), model, gains)
}

/// Largest |g/g_true − 1|, phases counted from the same station.
fn distance(found: &ScanGains, truth: &ScanGains) -> f64 {
    let turn = (found.gain(0) / truth.gain(0)).arg();
    let back = Complex64::from_polar(1.0, -turn);
    let miss = |k: usize| (found.gain(k) / truth.gain(k) * back - 1.0).norm();
    (0..STATIONS).map(miss).fold(0.0, f64::max)
}

#[test]
fn exact_gains_are_found_again() {
    for seed in 0..200 {
        let (problem, model, truth) = scan(seed, 1e-4);
        let found = problem.solve(&model);
        assert!(distance(&found, &truth) < 2e-3, "seed {seed}: {}", distance(&found, &truth));
        assert_eq!((0..STATIONS).filter(|k| !problem.has_phase(*k)).count(), 1);
    }
}

/// Found gains are off by as much as their errors say; χ² by as much as data and priors leave.
#[test]
fn exact_errors_and_chi2_are_those_of_noise() {
    let (mut pulls, mut chi2, count) = (0.0, 0.0, 300);
    for seed in 0..count {
        let (problem, model, truth) = scan(seed, 0.02);
        let found = problem.solve(&model);
        let errors = problem.errors(&model, &found);
        let pull =
            |k: usize| (found.log_amplitude[k] - truth.log_amplitude[k]) / errors.log_amplitude[k];
        pulls += (0..STATIONS).map(|k| pull(k).powi(2)).sum::<f64>() / STATIONS as f64;
        chi2 += problem.value(&model, &found);
    }
    let (pulls, chi2) = (pulls / f64::from(count as u32), chi2 / f64::from(count as u32));
    assert!((0.8..1.25).contains(&pulls), "{pulls}");
    // 15 complex data, 5 phases; amplitudes are uniform within one standard deviation of their prior, which is less.
    assert!((18.0..25.5).contains(&chi2), "{chi2}");
}

#[test]
fn exact_slopes_and_second_derivatives_by_differences() {
    let (problem, model, truth) = scan(3, 0.05);
    let off = DVector::from_fn(2 * STATIONS, |k, _| 0.1 * ((k * k) as f64).sin());
    let at = truth.moved(&off);
    let local = problem.local(&model, &at, true);
    let h = 1e-5;
    for k in (0..2 * STATIONS).filter(|k| !problem.is_fixed[*k]) {
        let moved = |s: f64| {
            let step = DVector::from_fn(2 * STATIONS, |j, _| if j == k { s * h } else { 0.0 });
            problem.local(&model, &at.moved(&step), true)
        };
        let (ahead, behind) = (moved(1.0), moved(-1.0));
        let slope = (ahead.value - behind.value) / (2.0 * h);
        let scale = local.gradient.amax();
        assert!((slope - local.gradient[k]).abs() < 1e-7 * scale, "{k}");
        let bends = (ahead.gradient - behind.gradient) / (2.0 * h);
        let miss = (bends - local.bends.column(k)).amax();
        assert!(miss < 1e-6 * local.bends.amax(), "{k}: {miss}");
    }
}

/// The slope of the least χ² with respect to the model is that with the gains held.
#[test]
fn exact_envelope() {
    let (problem, model, _) = scan(5, 0.05);
    let least = |model: &[Complex64]| problem.value(model, &problem.solve(model));
    let gains = problem.solve(&model);
    for k in 0..model.len() {
        for unit in [Complex64::new(1.0, 0.0), Complex64::new(0.0, 1.0)] {
            let held = gains.on(problem.pairs[k]);
            let residual = (held * model[k] - problem.data[k]) * problem.weight[k];
            let slope = 2.0 * (residual.conj() * held * unit).re;
            let moved = |s: f64| {
                let mut model = model.clone();
                model[k] += unit * (1e-5 * s);
                least(&model)
            };
            let differences = (moved(1.0) - moved(-1.0)) / 2e-5;
            assert!((slope - differences).abs() < 1e-4 * (1.0 + slope.abs()), "{k}: {slope}");
        }
    }
}

/// A dark model says nothing of gains; known amplitudes and phases stay.
#[test]
fn exact_what_is_not_known_or_not_free_stays() {
    let (problem, model, truth) = scan(7, 0.01);
    let dark = vec![Complex64::new(0.0, 0.0); model.len()];
    assert_eq!(problem.solve(&dark), ScanGains::unit(STATIONS));
    let priors = GainPriors { free_phases: false, amplitude_sigma: vec![0.0; STATIONS] };
    let variance = vec![1e-4; model.len()];
    let fixed = GainProblem::new(problem.pairs.clone(), problem.data.clone(), &variance, &priors);
    assert_eq!(fixed.solve(&model), ScanGains::unit(STATIONS));
    let known = GainPriors { free_phases: true, ..priors };
    let phases = GainProblem::new(problem.pairs, problem.data, &variance, &known).solve(&model);
    assert!(phases.log_amplitude.iter().all(|x| *x == 0.0));
    let difference = |of: &ScanGains| (of.phase[1] - of.phase[4]).sin();
    assert!((difference(&phases) - difference(&truth)).abs() < 0.1);
}
