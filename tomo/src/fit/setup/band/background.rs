//! Background of a flare in a band: settings, and its expected value.

use super::{BandGeometry, turn};
use crate::fit::FluxDatum;
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

/// Returns the expected background in a geometry and its standard deviation, Jy, as the data have it.
pub(super) fn expected(
    rows: &CurveRows,
    curve: &Curve,
    data: &[f64],
    geometry: &BandGeometry,
) -> Result<Vec<FluxDatum>> {
    let all = expected_background(rows, data, &geometry.band)?;
    let sigma = |datum: &Option<FluxDatum>| datum.map_or(0.0, |[_, sigma]| sigma);
    let scaled = |part: usize| all.iter().zip(&curve.data).map(move |(x, d)| x[part] * sigma(d));
    let mut values: Vec<f64> = scaled(0).collect();
    turn(&mut values, -geometry.position_angle_deg);
    Ok(values.into_iter().zip(scaled(1)).map(|(value, deviation)| [value, deviation]).collect())
}
