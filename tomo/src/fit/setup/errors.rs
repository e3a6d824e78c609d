//! Meaning of the errors of data, by where these come from.

use crate::fit::settings::{DataFiles, FitFile, LossKind, Noise};
use crate::fit::verdict::Errors;

/// Returns the meaning of σ of a kind of data.
pub fn errors(file: &FitFile, kind: LossKind) -> Errors {
    let of_pixels = matches!(kind, LossKind::Image | LossKind::LightCurve);
    match (&file.data, file.observation()) {
        (Some(DataFiles::Movie { .. }), _) => Errors::Assumed,
        (Some(DataFiles::Visibilities { .. } | DataFiles::LightCurve(_)), _) => Errors::Stated,
        _ if file.simulated_curve().is_some_and(|curve| curve.noise == Noise::Thermal) => {
            Errors::Known
        }
        (None, Some(seen)) if !of_pixels && seen.noise == Noise::Thermal => match seen.systematic {
            Some(part) if part > 0.0 => Errors::Stated,
            _ => Errors::Known,
        },
        _ => Errors::Weight,
    }
}

/// Returns whether all data of a fit have noise that their errors tell: χ² below its expectation then means that the model
/// follows noise, not that errors are only a scale.
pub(super) fn have_noise(file: &FitFile) -> bool {
    let is_told = |kind| !matches!(errors(file, kind), Errors::Assumed | Errors::Weight);
    file.loss.iter().all(|loss| is_told(loss.data))
}
