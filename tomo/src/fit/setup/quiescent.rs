//! Emission that does not move, from settings.

use super::observable::seen;
use super::{Result, spacing};
use crate::fit::linear::Prior;
use crate::fit::settings::{FitError, FitFile, Kind, QuiescentSettings, refuse};
use crate::fit::{BatchSize, Observable, Quiescent, Regulariser};
use kerrlight_render::polarization::StokesParameter;

/// The image beside the emission of so many pixels, where settings have one.
///
/// # Errors
/// If a penalty is missing, or has no meaning for the data.
pub(super) fn quiescent(file: &FitFile, pixels: usize) -> Result<Option<Quiescent>> {
    let Some(settings) = &file.quiescent else { return Ok(None) };
    let (seen, jy) = (seen(file)?, file.screen.jy_per_pixel);
    let is_signed = |parameter: &StokesParameter| *parameter != StokesParameter::I;
    let signed = seen.parameters().iter().map(is_signed).collect();
    let (pixels, unit) = if seen.is_flux() { (1, 1.0) } else { (pixels, jy) };
    let width = spacing(&file.screen)? * file.screen.pixels as f64;
    let image = Quiescent {
        pixels,
        signed,
        // The linear problem has one bound for voxels and pixels.
        most: file.linear.as_ref().map_or(1.0, |linear| linear.upper),
        upper: settings.upper * unit,
        jy_per_pixel: unit,
        priors: priors(settings, &seen)?,
        // A coarse view has fewer pixels over the same field.
        spacing: width / pixels.isqrt() as f64,
    };
    image.checked().map(Some)
}

fn priors(settings: &QuiescentSettings, seen: &Observable) -> Result<Vec<Prior>> {
    let QuiescentSettings { smoothness, sparsity, .. } = *settings;
    let all = [
        ("quiescent.smoothness", Regulariser::Smoothness, smoothness),
        ("quiescent.sparsity", Regulariser::Sparsity, sparsity),
    ];
    let mut priors = Vec::new();
    for (key, regulariser, weight) in all {
        match (seen.is_flux(), weight) {
            (true, None) => {}
            (true, Some(_)) => refuse!("{key} is not for a light curve, which has no image"),
            (false, None) => {
                let why = "a number of 0 or above: the penalty on the image, 0 for none";
                return Err(FitError::missing(key, why).into());
            }
            (false, Some(weight)) if weight > 0.0 => priors.push(Prior { regulariser, weight }),
            (false, Some(_)) => {}
        }
    }
    Ok(priors)
}

/// Refuses what an image beside the emission does not go together with.
///
/// # Errors
/// Says what.
pub(super) fn check(file: &FitFile) -> Result<()> {
    if file.quiescent.is_none() {
        return Ok(());
    }
    quiescent(file, file.screen.pixels * file.screen.pixels)?;
    if file.band.is_some() {
        refuse!("quiescent and band exclude each other: a band's light curve has no constant part");
    }
    if file.unknown_geometry()?.is_some() {
        refuse!(
            "quiescent and numbers with a prior exclude each other: geometries are compared without what does not move"
        );
    }
    if file.representation.kind == Kind::LinearGrid {
        return Ok(());
    }
    if matches!(file.training.batch, BatchSize::Pixels(_)) {
        refuse!(
            "training.batch: pixels are drawn where rays meet the region, and a quiescent image has others; use frames = N"
        );
    }
    Ok(())
}
