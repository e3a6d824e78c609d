use super::super::{ClosureKind, ClosureSet};
use super::*;
use crate::array::Station;
use crate::noise::add_thermal_noise;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;

/// A scan of `n` stations with random I of about 1 Jy and `part` times random Q, U and V, some baselines exchanged, errors of
/// `sigma`.
fn random(n: u16, part: f64, sigma: f64) -> Observation {
    let mut random = Pcg64Mcg::seed_from_u64(4);
    let mut draw = |least: f64| {
        Complex64::from_polar(random.random_range(least..1.0), random.random_range(-3.0..3.0))
    };
    let mut observation = Observation::empty(Basis::Circular);
    observation.stations = (0..n).map(|k| Station::named(&k.to_string())).collect();
    for (a, b) in (0..n).flat_map(|a| (a + 1..n).map(move |b| (a, b))) {
        let [i, q, u, v] = [draw(0.5), part * draw(0.1), part * draw(0.1), part * draw(0.1)];
        let turned = Complex64::new(0.0, 1.0) * u;
        let none = crate::observation::Measured { visibility: i, noise_sigma: sigma };
        let row = Row {
            products: [i + v, i - v, q + turned, q - turned],
            noise_sigma: [sigma; 4],
            ..Row::total_intensity(1.0, [a, b], [0.0; 2], none)
        };
        observation.rows.push(if (a + b) % 3 == 0 { row.swapped(Basis::Circular) } else { row });
    }
    observation
}

fn matrices(observation: &Observation) -> Vec<Coherency> {
    observation.rows.iter().map(|row| Coherency::of(row.products)).collect()
}

fn traces(observation: &Observation) -> Vec<ClosureTrace> {
    let index = observation.rows.iter().enumerate().map(|(k, row)| (row.stations, k)).collect();
    quadrangles(&index)
}

/// Any Jones matrices of the stations drop out.
#[test]
fn exact_jones_matrices_cancel() {
    let clean = random(6, 0.4, 1e-3);
    let mut draws = Pcg64Mcg::seed_from_u64(11);
    let mut number =
        || Complex64::new(draws.random_range(-1.0..1.0), draws.random_range(-1.0..1.0));
    let one = Complex64::new(1.0, 0.0);
    let jones: Vec<Coherency> = (0..6)
        .map(|_| {
            Coherency([
                [one + 0.5 * number(), 0.5 * number()],
                [0.5 * number(), one + 0.5 * number()],
            ])
        })
        .collect();
    let mut spoilt = clean.clone();
    for row in &mut spoilt.rows {
        let [a, b] = row.stations.map(|k| jones[usize::from(k)]);
        let [[rr, rl], [lr, ll]] = a.times(&Coherency::of(row.products)).times(&b.reversed()).0;
        row.products = [rr, ll, rl, lr];
    }
    let all = traces(&clean);
    assert_eq!(all.len(), 6 * 15);
    for trace in all {
        let [a, b] = [&clean, &spoilt].map(|o| trace.log(&matrices(o)).unwrap().value.exp());
        assert!((a / b - 1.0).norm() < 1e-11, "{trace:?}: {a} {b}");
    }
}

/// Without polarisation T is V₁₂ V₃₄/(V₃₂ V₁₄): sums of closure phases, differences of log closure amplitudes. The other
/// direction is the inverse, and turned about the first baseline the conjugate.
#[test]
fn exact_closure_quantities_without_polarisation() {
    let observation = random(4, 0.0, 1e-3);
    let v = |a: u16, b: u16| {
        let row = observation.rows.iter().find(|r| r.stations == [a, b] || r.stations == [b, a]);
        let row = row.unwrap();
        if row.stations == [a, b] { row.products[0] } else { row.products[0].conj() }
    };
    for trace in traces(&observation) {
        let [a, b, c, d] = trace.stations;
        let expected = v(a, b) * v(c, d) / (v(c, b) * v(a, d));
        let found = trace.log(&matrices(&observation)).unwrap().value.exp();
        assert!((found / expected - 1.0).norm() < 1e-13, "{found} {expected}");
    }
    let polarised = random(4, 0.4, 1e-3);
    let value = |stations: [u16; 4]| {
        let leg = |a: u16, b: u16| {
            let row =
                polarised.rows.iter().position(|r| r.stations == [a, b] || r.stations == [b, a]);
            let row = row.unwrap();
            TraceLeg { row, is_reversed: polarised.rows[row].stations != [a, b] }
        };
        let [a, b, c, d] = stations;
        let trace = ClosureTrace { stations, legs: [leg(a, b), leg(c, b), leg(c, d), leg(a, d)] };
        trace.log(&matrices(&polarised)).unwrap().value.exp()
    };
    assert!((value([0, 1, 2, 3]) - value([2, 3, 0, 1])).norm() < 1e-12);
    assert!((value([0, 1, 2, 3]) - value([1, 0, 3, 2]).conj()).norm() < 1e-12);
    assert!((value([0, 1, 2, 3]) * value([0, 3, 2, 1]) - 1.0).norm() > 1e-3);
}

/// Numbers that errors to first order tell apart: those of closure phases and amplitudes without polarisation; with it, 11 of
/// four stations, and all that gains and leakage leave of five or more: 4n² − 12n + 1.
#[test]
fn exact_numbers_of_independent_traces() {
    let count = |observation: &Observation| TraceSet::of(observation, 0.0)[0].quantities.len();
    for n in 4..8u16 {
        let plain = random(n, 0.0, 1e-4);
        let closures = |kind| ClosureSet::of(&plain, kind, 0.0)[0].closures.len();
        let both = closures(ClosureKind::Phase) + closures(ClosureKind::LogAmplitude);
        assert_eq!(count(&plain), both, "{n} stations without polarisation");
        let n2 = usize::from(n);
        let most = 4 * n2 * n2 - 12 * n2 + 1;
        let expected = if n == 4 { 11 } else { most };
        assert_eq!(count(&random(n, 0.5, 1e-7)), expected, "{n} stations");
        assert!(count(&random(n, 0.1, 1e-3)) <= most);
    }
}

/// Errors and covariances are those of draws of the noise.
#[test]
fn exact_errors_are_those_of_draws() {
    let clean = random(5, 0.4, 2e-3);
    let set = &TraceSet::of(&clean, 0.0)[0];
    let n = set.quantities.len();
    let draws = 4000;
    let mut sums = vec![0.0; n * n];
    for seed in 0..draws {
        let mut noisy = clean.clone();
        add_thermal_noise(&mut noisy, seed);
        let all = matrices(&noisy);
        let residuals: Vec<f64> = set
            .quantities
            .iter()
            .map(|q| q.part.of(q.trace.log(&all).unwrap().value) - q.value)
            .map(|x| x - (x / core::f64::consts::TAU).round() * core::f64::consts::TAU)
            .collect();
        for (k, sum) in sums.iter_mut().enumerate() {
            *sum += residuals[k / n] * residuals[k % n] / draws as f64;
        }
    }
    let sigma = |k: usize| set.covariance[k * n + k].sqrt();
    for (k, (found, expected)) in sums.iter().zip(&set.covariance).enumerate() {
        let miss = (found - expected) / (sigma(k / n) * sigma(k % n));
        assert!(miss.abs() < 0.12, "{} {}: {found} {expected}", k / n, k % n);
    }
    for (k, quantity) in set.quantities.iter().enumerate() {
        assert!((quantity.noise_sigma / sigma(k) - 1.0).abs() < 1e-12);
    }
}
