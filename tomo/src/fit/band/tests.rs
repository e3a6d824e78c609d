//! The marginal probability against the density of the joint Gaussian, and a band that is found again.

use super::field::part;
use super::*;
use crate::fit::linear::Voxels;
use crate::representation::Degree;
use nalgebra::DVector;

/// Light curves of voxels that turn: each datum is the part of the emission ahead of a direction.
fn curve(data: usize) -> CurveRows {
    let voxels = Voxels {
        nodes: [9, 9, 3],
        low: [-8.0, -8.0, -1.0],
        high: [8.0, 8.0, 1.0],
        degree: Degree::Linear,
    };
    let entry = |datum: usize, voxel: usize| {
        let [x, y, _] = voxels.position(voxel);
        let radius = x.hypot(y).max(0.5);
        let phase = 40.0 * datum as f64 / data as f64 * radius.powf(-1.5) * 8.0;
        let (sin, cos) = phase.sin_cos();
        4.0 * if datum.is_multiple_of(2) { x * cos + y * sin } else { y * cos - x * sin } / radius
    };
    let rows = (0..data).map(|k| (0..voxels.count()).map(|v| entry(k, v)).collect()).collect();
    CurveRows { voxels, rows, used: (0..data).map(|k| k < data - 10).collect() }
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
    let n = curve.rows.len();
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
        sum += recovered(&curve, &data, &truth).unwrap().validation.unwrap();
    }
    // 400 data: 1 ± 0.07.
    assert!(right > 34, "{right} of 40");
    assert!((sum / 40.0 - 1.0).abs() < 0.3, "{}", sum / 40.0);
}

#[test]
fn exact_the_field_that_is_expected_explains_the_data() {
    let mut curve = curve(60);
    curve.used.fill(true);
    let voxel = |k: usize| {
        let [x, y, z] = curve.voxels.position(k);
        (-0.5 * ((x - 3.0).powi(2) + (y - 4.0).powi(2) + z * z) / 2.0).exp()
    };
    let light: Vec<f64> = (0..curve.voxels.count()).map(|k| 20.0 * voxel(k)).collect();
    let data: Vec<f64> =
        curve.rows.iter().map(|row| row.iter().zip(&light).map(|(a, b)| a * b).sum()).collect();
    let found = &evidence(&curve, core::slice::from_ref(&data), &prior()).unwrap()[0];
    let field = recovered(&curve, &data, &found.best).unwrap();
    assert_eq!((found.best.radius, field.validation), (5.0, None));
    assert!((field.radius - 5.0).abs() < 0.7, "{}", field.radius);
    assert!((field.azimuth - 4f64.atan2(3.0)).abs() < 0.15, "{}", field.azimuth);
}

#[test]
fn impossible_priors_are_refused() {
    let curve = curve(30);
    let none = BandPrior { widths: vec![0.0], ..prior() };
    assert!(evidence(&curve, &[vec![0.0; 30]], &none).is_err());
    let far = BandPrior { radii: vec![1e6], ..prior() };
    assert!(evidence(&curve, &[vec![0.0; 30]], &far).is_err());
}
