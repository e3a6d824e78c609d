//! Background of a flare in a band: settings, and its expected value.

use super::BandGeometry;
use crate::fit::BackgroundDatum;
use crate::fit::band::{Background, CurveRows, expected_background};
use crate::fit::settings::{BackgroundSettings, BandSettings, refuse};
use crate::fit::setup::{Curve, Result};
use kerrlight_render::polarization::StokesParameter;

/// Refuses empty lists, and light curves of I.
pub(super) fn check(settings: &BackgroundSettings, curve: &Curve) -> Result<()> {
    let BackgroundSettings { variation_jy, correlation_min, matern, .. } = settings;
    if variation_jy.is_empty() || correlation_min.is_empty() || matern.is_empty() {
        refuse!("band.background: variation_jy, correlation_min and matern need one value or more");
    }
    if curve.parameters.contains(&StokesParameter::I) {
        refuse!("band.background is that of Q and U: leave I out of loss.0.stokes");
    }
    Ok(())
}

/// All combinations; what does not vary has no correlation time.
pub(super) fn backgrounds(settings: &BandSettings) -> Vec<Background> {
    let Some(BackgroundSettings { constant_jy, variation_jy, correlation_min, matern }) =
        &settings.background
    else {
        return vec![Background::NONE];
    };
    let constant = Background { constant: *constant_jy, ..Background::NONE };
    let mut all = Vec::new();
    for variation in variation_jy.iter().copied() {
        if variation == 0.0 {
            all.push(constant);
            continue;
        }
        for minutes in correlation_min.iter().copied() {
            all.extend(matern.iter().map(|roughness| Background {
                variation,
                minutes,
                roughness: *roughness,
                ..constant
            }));
        }
    }
    all
}

/// Returns the expected background in a geometry, Jy, as the data have it.
pub(super) fn expected(
    rows: &CurveRows,
    curve: &Curve,
    data: &[f64],
    geometry: &BandGeometry,
) -> Result<Vec<BackgroundDatum>> {
    let mut all = expected_background(rows, data, &geometry.band)?;
    let sigma = |k: usize| curve.data.get(k).copied().flatten().map_or(0.0, |[_, sigma]| sigma);
    for (k, [value, deviation, covariance]) in all.iter_mut().enumerate() {
        *value *= sigma(k);
        *deviation *= sigma(k);
        *covariance *= sigma(k) * sigma(k ^ 1);
    }
    if geometry.position_angle_deg != 0.0 {
        all.chunks_exact_mut(2).for_each(|pair| turn_back(pair, geometry.position_angle_deg));
    }
    Ok(all)
}

/// Q and U with the ellipse of their errors, seen again by who is not turned by a position angle.
fn turn_back(pair: &mut [BackgroundDatum], angle_deg: f64) {
    let (sin, cos) = (2.0 * angle_deg.to_radians()).sin_cos();
    let [[q, of_q, covariance], [u, of_u, _]] = [pair[0], pair[1]];
    let (qq, uu) = (of_q * of_q, of_u * of_u);
    let along =
        |a: f64, b: f64| (a * a * qq + 2.0 * a * b * covariance + b * b * uu).max(0.0).sqrt();
    let beside = sin * cos * (qq - uu) + (cos * cos - sin * sin) * covariance;
    pair[0] = [q * cos - u * sin, along(cos, -sin), beside];
    pair[1] = [u * cos + q * sin, along(sin, cos), beside];
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Position angles of 45° exchange Q and U: their errors go with them, and so does the ellipse at any angle.
    #[test]
    fn exact_errors_turn_with_their_values() {
        let pair = [[1.0, 0.3, 0.05], [2.0, 0.4, 0.05]];
        let mut quarter = pair;
        turn_back(&mut quarter, 45.0);
        let expected = [[-2.0, 0.4, -0.05], [1.0, 0.3, -0.05]];
        for (found, expected) in quarter.iter().flatten().zip(expected.iter().flatten()) {
            assert!((found - expected).abs() < 1e-12, "{quarter:?}");
        }
        let mut turned = pair;
        turn_back(&mut turned, 17.0);
        let trace = |p: &[BackgroundDatum; 2]| p[0][1].powi(2) + p[1][1].powi(2);
        let area = |p: &[BackgroundDatum; 2]| (p[0][1] * p[1][1]).powi(2) - p[0][2].powi(2);
        assert!((trace(&turned) - trace(&pair)).abs() < 1e-12);
        assert!((area(&turned) - area(&pair)).abs() < 1e-12);
    }
}
