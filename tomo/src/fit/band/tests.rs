//! The marginal probability against the density of the joint Gaussian, and a band that is found again.

use super::field::part;
use super::*;
use core::f64::consts::TAU;
use nalgebra::{DMatrix, DVector};

const GRID: PolarGrid = PolarGrid { radius: 9.0, rings: 13, azimuths: 25, height: 2.0, layers: 3 };

/// Distance from the axis, azimuth and z of the nodes.
fn nodes() -> Vec<[f64; 3]> {
    let azimuth = |k: usize| TAU * k as f64 / GRID.azimuths as f64;
    let of_ring = |radius: f64, z: f64| (0..GRID.azimuths).map(move |k| [radius, azimuth(k), z]);
    let layers = GRID.layers();
    layers.iter().flat_map(|z| GRID.rings().into_iter().flat_map(|rho| of_ring(rho, *z))).collect()
}

/// Light curves of rings that turn: each datum is the part of the emission ahead of a direction.
fn rows(data: usize) -> Vec<Vec<f64>> {
    let entry = |datum: usize, [radius, azimuth, _]: [f64; 3]| {
        let phase = 40.0 * datum as f64 / data as f64 * radius.max(0.5).powf(-1.5) * 8.0;
        let (sin, cos) = (phase - azimuth).sin_cos();
        0.5 * radius * if datum.is_multiple_of(2) { cos } else { sin }
    };
    (0..data).map(|k| nodes().into_iter().map(|node| entry(k, node)).collect()).collect()
}

fn curve(data: usize) -> CurveRows {
    CurveRows::new(GRID, &rows(data), (0..data).map(|k| k < data - 10).collect())
}

fn prior() -> BandPrior {
    BandPrior::usual(vec![3.0, 5.0, 7.0], vec![1.0], vec![2.0], 1.0)
}

fn band(radius: f64) -> Band {
    Band { radius, width: 1.0, height: 1.0, length: 2.0, power: 0.4, mean: 0.5 }
}

/// A field that is drawn from the prior, as data with noise.
fn drawn(curve: &CurveRows, band: &Band, seed: u64) -> Vec<f64> {
    use rand::{RngExt, SeedableRng};
    let mut random = rand_pcg::Pcg64Mcg::seed_from_u64(seed);
    let mut normal = || -> f64 { random.sample(rand_distr::StandardNormal) };
    let seen = curve.seen(band).unwrap();
    let n = curve.data();
    let mut covariance = &seen.covariance * band.power
        + &seen.uniform * seen.uniform.transpose() * (band.power * band.mean * band.mean);
    (0..n).for_each(|k| covariance[(k, k)] += 1.0);
    let white = DVector::from_fn(n, |_, _| normal());
    (covariance.cholesky().unwrap().unpack() * white).as_slice().to_vec()
}

/// −½ (yᵀC⁻¹y + ln det C) with C written out.
#[test]
fn exact_evidence_is_the_density_of_the_data() {
    let (curve, truth) = (curve(30), band(5.0));
    let data = drawn(&curve, &truth, 3);
    let one = BandPrior {
        radii: vec![5.0],
        widths: vec![1.0],
        height: 1.0,
        lengths: vec![2.0],
        powers: vec![0.7],
        means: vec![0.5],
    };
    let found = &evidence(&curve, core::slice::from_ref(&data), &one).unwrap()[0];
    let seen = curve.seen(&truth).unwrap();
    let used = curve.numbers(true);
    let full = &seen.covariance + &seen.uniform * seen.uniform.transpose() * 0.25;
    let mut covariance = part(&full, &used, &used) * found.best.power;
    (0..used.len()).for_each(|k| covariance[(k, k)] += 1.0);
    let values = DVector::from_iterator(used.len(), used.iter().map(|k| data[*k]));
    let factor = covariance.clone().cholesky().unwrap();
    let expected = -0.5 * (values.dot(&factor.solve(&values)) + covariance.determinant().ln());
    assert!((found.ln_evidence - expected).abs() < 1e-8 * expected.abs(), "{found:?} {expected}");
}

/// Of draws from the prior the radius is found, and the data that were left out have a χ² of 1.
#[test]
fn exact_draws_from_the_prior_are_found_again() {
    let curve = curve(60);
    let (mut right, mut sum) = (0, 0.0);
    for seed in 0..40 {
        let truth = band([3.0, 5.0, 7.0][seed as usize % 3]);
        let data = drawn(&curve, &truth, seed);
        let found = &evidence(&curve, core::slice::from_ref(&data), &prior()).unwrap()[0];
        right += usize::from(found.best.radius == truth.radius);
        sum += validation(&curve, &data, &truth).unwrap().unwrap();
    }
    // 400 data: 1 ± 0.07.
    assert!(right > 34, "{right} of 40");
    assert!((sum / 40.0 - 1.0).abs() < 0.3, "{}", sum / 40.0);
}

/// The covariance is the double sum over all nodes.
#[test]
fn exact_covariances_are_sums_over_pairs_of_nodes() {
    let (rows, nodes, band) = (rows(6), nodes(), band(5.0));
    let seen = CurveRows::new(GRID, &rows, vec![true; 6]).seen(&band).unwrap();
    let square = |x: f64| x * x;
    let envelope = |[rho, _, z]: &[f64; 3]| {
        let far = square((rho - band.radius) / band.width) + square(z / band.height);
        (-0.5 * far).exp()
    };
    let lit: Vec<f64> = nodes.iter().map(envelope).collect();
    let near = |a: usize, b: usize| {
        let ([r, p, z], [s, q, w]) = (nodes[a], nodes[b]);
        let round = square(2.0 * band.radius * (0.5 * (p - q)).sin());
        let far = square(r - s) + square(z - w) + round;
        lit[a] * lit[b] * (-0.5 * far / square(band.length)).exp()
    };
    let all = DMatrix::from_fn(nodes.len(), nodes.len(), near);
    let rows = DMatrix::from_fn(6, nodes.len(), |datum, node| rows[datum][node]);
    let expected = &rows * all * rows.transpose();
    let error = (&seen.covariance - &expected).amax() / expected.amax();
    assert!(error < 1e-5, "{error}");
    let uniform = &rows * DVector::from_vec(lit);
    assert!((&seen.uniform - &uniform).amax() < 1e-9 * (1.0 + uniform.amax()));
}

/// Moments of draws from the prior lie about those that are expected as far as their deviations say.
#[test]
fn exact_places_of_draws_from_the_prior() {
    use rand::{RngExt, SeedableRng};
    let (curve, truth) = (curve(60), band(5.0));
    let (seen, n) = (curve.seen(&truth).unwrap(), curve.data());
    let uniform = &seen.uniform * seen.uniform.transpose() * truth.mean * truth.mean;
    let mut joint = DMatrix::zeros(n + 4, n + 4);
    joint.view_mut((0, 0), (4, 4)).copy_from(&(&seen.own * truth.power));
    joint.view_mut((4, 0), (n, 4)).copy_from(&(&seen.moments * truth.power));
    joint.view_mut((4, 4), (n, n)).copy_from(&((&seen.covariance + uniform) * truth.power));
    (4..n + 4).for_each(|k| joint[(k, k)] += 1.0);
    let lower = joint.cholesky().unwrap().unpack();
    let mut random = rand_pcg::Pcg64Mcg::seed_from_u64(5);
    let (mut squares, draws) = ([0.0; 2], 300);
    for _ in 0..draws {
        let white = DVector::from_fn(n + 4, |_, _| random.sample(rand_distr::StandardNormal));
        let drawn: DVector<f64> = &lower * white;
        let (q, p) = ([drawn[0], drawn[1]], [drawn[2], drawn[3]]);
        let data: Vec<f64> = drawn.as_slice()[4..].to_vec();
        let place = places(&curve, &data, &[(truth, 0.0)]).unwrap()[0];
        let radius = (q[0] * p[0] + q[1] * p[1]) / (q[0] * q[0] + q[1] * q[1]);
        let turn = q[1].atan2(q[0]) - place.azimuth[0];
        let off = [radius - place.radius[0], turn.sin().atan2(turn.cos())];
        for (sum, (off, of)) in
            squares.iter_mut().zip(off.iter().zip([place.radius, place.azimuth]))
        {
            *sum += (off / of[1]).powi(2).min(16.0);
        }
    }
    let pulls = squares.map(|sum| (sum / f64::from(draws)).sqrt());
    assert!(pulls.iter().all(|pull| (0.85..1.15).contains(pull)), "{pulls:?}");
}

#[test]
fn exact_quantiles_of_mixtures() {
    let place = |ln: f64, azimuth: f64| Place { ln, radius: [10.0, 0.5], azimuth: [azimuth, 0.1] };
    let [azimuth, radius] = together(&[place(0.0, 3.1), place(0.0, 3.1 - TAU)]).unwrap();
    assert!((azimuth.median - 3.1).abs() < 1e-9 || (azimuth.median + TAU - 3.1).abs() < 1e-9);
    assert!((azimuth.high - azimuth.low - 2.0 * 1.959964 * 0.1).abs() < 1e-6, "{azimuth:?}");
    assert!((radius.high - 10.0 - 1.959964 * 0.5).abs() < 1e-6, "{radius:?}");
    // Two narrow ones of unequal weight: the median is in the heavier.
    let narrow = |ln: f64, at: f64| Place { ln, radius: [at, 1e-3], azimuth: [0.0, 9.0] };
    let [azimuth, radius] = together(&[narrow(1.0, 8.0), narrow(0.0, 9.0)]).unwrap();
    assert!((radius.median - 8.0).abs() < 0.01 && (radius.high - 9.0).abs() < 0.01, "{radius:?}");
    assert!((azimuth.high - azimuth.low - TAU).abs() < 1e-9, "{azimuth:?}");
    assert!(together(&[]).is_none());
}

/// Of a spot without noise: where it is.
#[test]
fn exact_a_spot_is_found_where_it_is() {
    let curve = CurveRows::new(GRID, &rows(60), vec![true; 60]);
    let spot = |[rho, azimuth, z]: &[f64; 3]| {
        let (sin, cos) = azimuth.sin_cos();
        let far = (rho * cos - 3.0).powi(2) + (rho * sin - 4.0).powi(2) + z * z;
        2.0 * (-0.5 * far / 2.0).exp()
    };
    let light: Vec<f64> = nodes().iter().map(spot).collect();
    let of = |row: &Vec<f64>| row.iter().zip(&light).map(|(a, b)| a * b).sum();
    let data: Vec<f64> = rows(60).iter().map(of).collect();
    let found = &evidence(&curve, core::slice::from_ref(&data), &prior()).unwrap()[0];
    assert_eq!(found.best.radius, 5.0);
    assert_eq!(validation(&curve, &data, &found.best).unwrap(), None);
    let places = places(&curve, &data, &found.likely).unwrap();
    let [azimuth, radius] = together(&places).unwrap();
    let truth = 4f64.atan2(3.0);
    assert!((radius.median - 5.0).abs() < 0.5, "{radius:?}");
    assert!((azimuth.median - truth).abs() < 0.05, "{azimuth:?} {truth}");
}

#[test]
fn impossible_priors_are_refused() {
    let curve = curve(30);
    let none = BandPrior { widths: vec![0.0], ..prior() };
    assert!(evidence(&curve, &[vec![0.0; 30]], &none).is_err());
    let far = BandPrior { radii: vec![1e6], ..prior() };
    assert!(evidence(&curve, &[vec![0.0; 30]], &far).is_err());
}
