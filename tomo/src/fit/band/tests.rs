//! The marginal probability against the density of the joint Gaussian, and a band that is found again.

use super::field::part;
use super::*;
use crate::fit::linear::Roughness;
use core::f64::consts::TAU;
use nalgebra::{DMatrix, DVector};
use rand::{RngExt, SeedableRng};
use rand_distr::StandardNormal;
use rand_pcg::Pcg64Mcg;

const GRID: PolarGrid = PolarGrid { radius: 9.0, rings: 13, azimuths: 25, height: 2.0, layers: 3 };

/// Distance from the axis, azimuth and z of the nodes.
fn nodes() -> Vec<[f64; 3]> {
    let azimuth = |k: usize| TAU * k as f64 / GRID.azimuths as f64;
    let of_ring = |radius: f64, z: f64| (0..GRID.azimuths).map(move |k| [radius, azimuth(k), z]);
    let layers = GRID.layers();
    layers.iter().flat_map(|z| GRID.rings().into_iter().flat_map(|rho| of_ring(rho, *z))).collect()
}

/// Light curves of rings that turn: each datum is a part of all emission and that ahead of a direction.
fn rows(data: usize) -> Vec<Vec<f64>> {
    let entry = |datum: usize, [radius, azimuth, _]: [f64; 3]| {
        let phase = 40.0 * datum as f64 / data as f64 * radius.max(0.5).powf(-1.5) * 8.0;
        let (sin, cos) = (phase - azimuth).sin_cos();
        0.5 * radius * (0.3 + if datum.is_multiple_of(2) { cos } else { sin })
    };
    (0..data).map(|k| nodes().into_iter().map(|node| entry(k, node)).collect()).collect()
}

/// Two numbers every ten minutes, with standard deviations of 0.01 Jy.
fn sampling(data: usize) -> Sampling {
    let minutes = (0..data / 2).map(|k| 10.0 * k as f64).collect();
    Sampling { minutes, scales: vec![100.0; data] }
}

fn curve(data: usize) -> CurveRows {
    CurveRows::new(GRID, &rows(data), (0..data).map(|k| k < data - 10).collect(), sampling(data))
}

fn prior() -> BandPrior {
    BandPrior::usual(vec![3.0, 5.0, 7.0], vec![1.0], vec![2.0], 1.0)
}

fn band(radius: f64) -> Band {
    Band { radius, width: 1.0, height: 1.0, length: 2.0, power: 0.4, mean: 0.5, ..Band::DARK }
}

/// A field that is drawn from the prior, its emission positive in sum, as data with noise.
fn drawn(curve: &CurveRows, band: &Band, seed: u64) -> Vec<f64> {
    let mut random = Pcg64Mcg::seed_from_u64(seed);
    let mut normal = || -> f64 { random.sample(StandardNormal) };
    let seen = curve.seen(band).unwrap();
    let n = curve.data();
    let mut rest = curve.of_background(&band.background);
    (0..n).for_each(|k| rest[(k, k)] += 1.0);
    let mut white = |n: usize| DVector::from_fn(n, |_, _| normal());
    let noise = rest.cholesky().unwrap().unpack() * white(n);
    if band.power == 0.0 {
        return noise.as_slice().to_vec();
    }
    let [own, of_one] = seen.own_total;
    let mean = band.mean * band.mean;
    let mut joint = DMatrix::zeros(n + 1, n + 1);
    joint[(0, 0)] = band.power * (own + mean * of_one * of_one);
    let across = (&seen.total + &seen.uniform * (mean * of_one)) * band.power;
    joint.view_mut((1, 0), (n, 1)).copy_from(&across);
    joint.view_mut((1, 1), (n, n)).copy_from(&seen.full(band));
    (1..=n).for_each(|k| joint[(k, k)] += 1e-6);
    let field = joint.cholesky().unwrap().unpack() * white(n + 1);
    (field.rows(1, n) * field[0].signum() + noise).as_slice().to_vec()
}

/// ln of twice the probability that all emission is positive given the data, with the inverse of their covariance.
fn positive(
    seen: &field::BandCovariance,
    band: &Band,
    used: &[usize],
    inverse: &DMatrix<f64>,
    values: &DVector<f64>,
) -> f64 {
    let ([own, of_one], mean) = (seen.own_total, band.mean * band.mean);
    let across = (&seen.total + &seen.uniform * (mean * of_one)) * band.power;
    let across = DVector::from_iterator(used.len(), used.iter().map(|k| across[*k]));
    let expected = across.dot(&(inverse * values));
    let own = band.power * (own + mean * of_one * of_one);
    let variance = own - across.dot(&(inverse * &across));
    libm::erfc(-expected / (2.0 * variance).sqrt()).ln()
}

/// The radius of draws from the prior is found, and the data that were left out have a χ² of 1.
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
    let seen = CurveRows::new(GRID, &rows, vec![true; 6], sampling(6)).seen(&band).unwrap();
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
    let light = DVector::from_iterator(nodes.len(), nodes.iter().map(|[rho, ..]| *rho));
    let round = GRID.azimuths as f64;
    let [own, of_one] = seen.own_total;
    let (total, square_of_all) = (&rows * &all * &light, light.dot(&(&all * &light)));
    assert!((&seen.total * round - &total).amax() < 1e-5 * total.amax(), "{total}");
    assert!((own * round * round / square_of_all - 1.0).abs() < 1e-5, "{own} {square_of_all}");
    assert!((of_one * round / light.dot(&DVector::from_vec(lit.clone())) - 1.0).abs() < 1e-9);
    let expected = &rows * all * rows.transpose();
    let error = (&seen.covariance - &expected).amax() / expected.amax();
    assert!(error < 1e-5, "{error}");
    let uniform = &rows * DVector::from_vec(lit);
    assert!((&seen.uniform - &uniform).amax() < 1e-9 * (1.0 + uniform.amax()));
}

/// Moments of draws from the prior lie about those that are expected as far as their deviations say.
#[test]
fn exact_places_of_draws_from_the_prior() {
    let (curve, truth) = (curve(60), band(5.0));
    let (seen, n) = (curve.seen(&truth).unwrap(), curve.data());
    let uniform = &seen.uniform * seen.uniform.transpose() * truth.mean * truth.mean;
    let mut joint = DMatrix::zeros(n + 4, n + 4);
    joint.view_mut((0, 0), (4, 4)).copy_from(&(&seen.own * truth.power));
    joint.view_mut((4, 0), (n, 4)).copy_from(&(&seen.moments * truth.power));
    joint.view_mut((4, 4), (n, n)).copy_from(&((&seen.covariance + uniform) * truth.power));
    (4..n + 4).for_each(|k| joint[(k, k)] += 1.0);
    let lower = joint.cholesky().unwrap().unpack();
    let mut random = Pcg64Mcg::seed_from_u64(5);
    let (mut squares, draws) = ([0.0; 2], 300);
    for _ in 0..draws {
        let white = DVector::from_fn(n + 4, |_, _| random.sample(StandardNormal));
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

/// The place of a spot without noise is found.
#[test]
fn exact_a_spot_is_found_where_it_is() {
    let curve = CurveRows::new(GRID, &rows(60), vec![true; 60], sampling(60));
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

/// A constant of 0.2 Jy and a random walk of 0.05 Jy that forgets in 40 minutes.
const BACKGROUND: Background =
    Background { constant: 0.2, variation: 0.05, minutes: 40.0, roughness: Roughness::Half };

/// −½ (yᵀC⁻¹y + ln det C) with the covariance of flare, background and noise written out.
#[test]
fn exact_evidence_is_the_density_of_the_data() {
    for (background, tolerance) in [(Background::NONE, 1e-8), (BACKGROUND, 1e-7)] {
        let Background { constant, variation, minutes, .. } = background;
        let (curve, truth) = (curve(30), Band { background, ..band(5.0) });
        let data = drawn(&curve, &truth, 3);
        let one = BandPrior {
            radii: vec![5.0],
            powers: vec![0.7],
            means: vec![0.5],
            backgrounds: vec![background],
            ..prior()
        };
        let found = &evidence(&curve, core::slice::from_ref(&data), &one).unwrap()[0];
        let used = curve.numbers(true);
        let density = |flare: DMatrix<f64>| {
            let entry = |a: usize, b: usize| {
                let apart = 10.0 * (a / 2).abs_diff(b / 2) as f64;
                let square = constant.powi(2) + variation.powi(2) * (-apart / minutes).exp();
                let background = if a % 2 == b % 2 { 1e4 * square } else { 0.0 };
                background + f64::from(u8::from(a == b))
            };
            let whole = flare + DMatrix::from_fn(30, 30, entry);
            let covariance = part(&whole, &used, &used);
            let values = DVector::from_iterator(used.len(), used.iter().map(|k| data[*k]));
            let factor = covariance.cholesky().unwrap();
            let form = values.dot(&factor.solve(&values));
            (-0.5 * (form + factor.determinant().ln()), factor.inverse(), values)
        };
        let seen = curve.seen(&truth).unwrap();
        let (with, inverse, values) = density(seen.full(&found.best));
        let with = with + positive(&seen, &found.best, &used, &inverse, &values);
        let without = density(DMatrix::zeros(30, 30)).0;
        assert!((found.ln_evidence - with).abs() < tolerance * with.abs(), "{found:?} {with}");
        let alone = without_flare(&curve, core::slice::from_ref(&data), &[background]).unwrap()[0];
        assert!((alone - without).abs() < tolerance * without.abs(), "{alone} {without}");
    }
}

/// Flares before a background: the radius is found, data that were left out have a χ² of 1, the background is known to the
/// errors that its distribution has, and no flare is seen where there is none.
#[test]
fn exact_flares_before_a_background_are_found_and_none_where_there_is_none() {
    let curve = curve(80);
    let backgrounds = [0.0, 0.05].map(|variation| Background { variation, ..BACKGROUND });
    let prior = BandPrior { backgrounds: backgrounds.to_vec(), ..prior() };
    let (mut right, mut sum, mut seen, mut false_alarms) = (0, 0.0, 0, 0);
    for seed in 0..40 {
        let truth = Band { background: BACKGROUND, ..band([3.0, 5.0, 7.0][seed as usize % 3]) };
        let dark = Band { power: 0.0, ..truth };
        let data = [drawn(&curve, &truth, seed), drawn(&curve, &dark, seed)];
        let found = evidence(&curve, &data, &prior).unwrap();
        let without = without_flare(&curve, &data, &prior.backgrounds).unwrap();
        right += usize::from(found[0].best.radius == truth.radius);
        sum += validation(&curve, &data[0], &truth).unwrap().unwrap();
        seen += usize::from(found[0].ln_evidence > without[0] + 3.0);
        false_alarms += usize::from(found[1].ln_evidence > without[1] + 3.0);
    }
    assert!(right > 30, "{right} of 40");
    assert!((sum / 40.0 - 1.0).abs() < 0.3, "{}", sum / 40.0);
    // e³ = 20: as often as once in 20 at most, were the prior not scaled by the data.
    assert!(seen > 36 && false_alarms < 5, "{seen} {false_alarms}");
}

/// The expected background is off by as much as its distribution given the data says.
#[test]
fn exact_expected_background() {
    let (curve, truth) = (curve(40), Band { background: BACKGROUND, ..band(5.0) });
    let (own, n) = (curve.of_background(&BACKGROUND), 40);
    let rest = curve.seen(&truth).unwrap().full(&truth) + DMatrix::identity(n, n);
    let roots = [own.clone(), rest.clone()].map(|mut matrix| {
        (0..n).for_each(|k| matrix[(k, k)] += 1e-9);
        matrix.cholesky().unwrap().unpack()
    });
    let used = curve.numbers(true);
    let all: Vec<usize> = (0..n).collect();
    let across = part(&own, &all, &used);
    let inverse = part(&(&own + &rest), &used, &used).try_inverse().unwrap();
    let left = &own - &across * inverse * across.transpose();
    let mut random = Pcg64Mcg::seed_from_u64(7);
    let (mut sum, draws) = (0.0, 200);
    for _ in 0..draws {
        let mut white = || DVector::from_fn(n, |_, _| random.sample(StandardNormal));
        let [background, other] = [&roots[0] * white(), &roots[1] * white()];
        let data: Vec<f64> = (&background + other).as_slice().to_vec();
        let expected = expected_background(&curve, &data, &truth).unwrap();
        let off = |k: usize| (background[k] - expected[k][0]).powi(2) / left[(k, k)];
        for (k, [_, deviation, _]) in expected.iter().enumerate() {
            assert!((deviation.powi(2) / left[(k, k)] - 1.0).abs() < 1e-6);
        }
        sum += (0..n).map(off).sum::<f64>() / n as f64;
    }
    assert!((sum / f64::from(draws) - 1.0).abs() < 0.1, "{}", sum / f64::from(draws));
}

#[test]
fn impossible_backgrounds_are_refused() {
    let curve = curve(30);
    for bad in [
        Background { constant: -0.1, ..BACKGROUND },
        Background { variation: f64::NAN, ..BACKGROUND },
        Background { minutes: 0.0, ..BACKGROUND },
    ] {
        assert!(without_flare(&curve, &[vec![0.0; 30]], &[bad]).is_err(), "{bad:?}");
    }
    let none = BandPrior { backgrounds: Vec::new(), ..prior() };
    assert!(evidence(&curve, &[vec![0.0; 30]], &none).is_err());
}

/// A background as faint as the ranges of settings allow is nothing, without an error.
#[test]
fn exact_no_background_is_dark() {
    assert_eq!(Background::NONE.drawn(&[0.0, 1.0], &[0.1, 0.2]).unwrap(), [0.0, 0.0]);
    let drawn = |constant: f64| {
        let background = Background { constant, ..Background::NONE };
        background.drawn(&[0.0, 1.0], &[0.1, 0.2]).unwrap()[0] / constant
    };
    assert!((drawn(1e-170) / drawn(1.0) - 1.0).abs() < 1e-12);
}
