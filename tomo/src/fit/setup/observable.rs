//! Quantities that data depend on: images, images of Stokes parameters, or fluxes.

use super::Result;
use super::polarized::{PARAMETERS, is_polarized};
use crate::fit::Observable;
use crate::fit::settings::{DataFiles, FitError, FitFile, Loss, LossKind, refuse};
use kerrlight_render::polarization::StokesParameter;

/// Returns the quantities that data depend on: fluxes, if they are a light curve of their own.
///
/// # Errors
/// If other losses stand beside it, a Stokes parameter has no model, or settings are missing.
pub(super) fn seen(file: &FitFile) -> Result<Observable> {
    let is_curve =
        file.simulated_curve().is_some() || matches!(file.data, Some(DataFiles::LightCurve(_)));
    let named = file.loss.iter().position(|loss| loss.stokes.is_some());
    if !is_curve {
        return match named {
            Some(k) => refuse!(
                "loss.{k}.stokes needs a light curve of its own: [simulation.light_curve] or [data.light-curve]"
            ),
            None => Ok(polarized(file)?.unwrap_or(Observable::Images)),
        };
    }
    let [Loss { data: LossKind::LightCurve, stokes, .. }] = &file.loss[..] else {
        refuse!("a light curve of an unresolved source has one loss, with data = \"light-curve\"");
    };
    let parameters = stokes.clone().unwrap_or_else(|| vec![StokesParameter::I]);
    check(file, &parameters)?;
    Ok(Observable::Fluxes(parameters))
}

fn check(file: &FitFile, parameters: &[StokesParameter]) -> Result<()> {
    let mut sorted = parameters.to_vec();
    sorted.sort();
    sorted.dedup();
    if sorted.len() < parameters.len() || parameters.is_empty() {
        refuse!("loss.0.stokes: some of \"I\", \"Q\" and \"U\", each once");
    }
    if parameters.contains(&StokesParameter::V) {
        refuse!("loss.0.stokes: V is not modelled; give some of \"I\", \"Q\" and \"U\"");
    }
    if file.polarization.is_none() && parameters != [StokesParameter::I] {
        let why = "Q and U need the field of the gas: add a table [polarization]";
        return Err(FitError::missing("polarization", why).into());
    }
    if file.observation().is_some() {
        refuse!("simulation.light_curve and simulation.observation exclude each other");
    }
    if file.loss[0].sigma.is_some() {
        refuse!("loss.0.sigma is not allowed: the light curve has errors of its own");
    }
    Ok(())
}

/// Returns the quantities that polarised visibilities depend on; nothing where they are not fitted.
///
/// # Errors
/// If there is no field, or other settings contradict them.
fn polarized(file: &FitFile) -> Result<Option<Observable>> {
    if !is_polarized(&file.loss) {
        return Ok(None);
    }
    if file.polarization.is_none() {
        let why = "Q and U need the field of the gas: add a table [polarization]";
        return Err(FitError::missing("polarization", why).into());
    }
    let image = file.loss.iter().any(|loss| loss.data == LossKind::Image);
    if image || !file.has_visibilities() {
        refuse!(
            "a loss of polarized-visibilities or polarimetric-ratios stands with other visibilities alone: images are not allowed"
        );
    }
    Ok(Some(Observable::StokesImages(PARAMETERS.to_vec())))
}
