//! Settings of the linear polarisation of a static image.

use super::{StaticImageFile, StrengthSettings};
use crate::Error;
use kerrlight_tomo::fit::settings::{FitError, Loss, LossKind, Variability, refuse};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Linear polarisation, found beside the total intensity of a static image.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct StaticPolarization {
    /// `polarimetric-ratios`, or `polarized-visibilities`, which need `instrument.gains` or a loss of visibilities.
    pub data: LossKind,
    /// Ratios: least signal-to-noise ratio in Stokes I of baselines; 0 without it.
    #[schemars(range(min = 0.0, max = 1e12), extend("unit" = "a signal-to-noise ratio"))]
    pub least_snr: Option<f64>,
    /// Part of Stokes I of each station that is added to errors of RL and LR, for leakage that calibration has
    /// left.
    #[schemars(range(min = 0.0, max = 1.0), extend("unit" = "a part of the light"))]
    pub leakage_left: f64,
    /// Adds jy/(1 + (|u|/uv)²)^(power/2) to errors of RL and LR.
    pub variability: Option<Variability>,
    /// Factor on ∫ e |∇m|², e the brightness over its mean and m the fraction of polarisation.
    #[schemars(range(min = 1e-12, max = 1e12), extend("unit" = "a factor"))]
    pub smoothness: f64,
    /// Iterations, at most.
    #[schemars(range(min = 1, max = 1_000_000), extend("unit" = "iterations"))]
    pub iterations: usize,
    /// Full width at half maximum of the beam with which fractions are measured, µas.
    #[schemars(range(min = 1e-6, max = 1e12), extend("unit" = "microarcseconds"))]
    pub beam_uas: f64,
    /// A factor on `smoothness`, chosen by cross-validation with frames held out in blocks; 1 without it.
    pub strength: Option<StrengthSettings>,
}

impl StaticPolarization {
    /// Returns the loss of a fit that compares the same data.
    pub fn loss(&self) -> Loss {
        let Self { data, least_snr, .. } = *self;
        Loss { least_snr, ..Loss::new(data) }
    }

    pub(super) fn check(&self, file: &StaticImageFile) -> Result<(), Error> {
        let is_ratio = self.data == LossKind::PolarimetricRatios;
        if !is_ratio && self.data != LossKind::PolarizedVisibilities {
            refuse!(
                "polarization.data = {:?} is not for a static image: polarimetric-ratios or polarized-visibilities",
                self.data.name()
            );
        }
        if !is_ratio && self.least_snr.is_some() {
            refuse!("polarization.least_snr is for data = \"polarimetric-ratios\"");
        }
        let knows_phases = file.loss.iter().any(|loss| loss.data == LossKind::Visibilities);
        let has_gains =
            file.instrument.as_ref().is_some_and(|instrument| instrument.gains.is_some());
        if !is_ratio && !knows_phases && !has_gains {
            refuse!(
                "polarization.data = \"polarized-visibilities\" needs [instrument.gains], or a loss of visibilities: nothing else tells the phases; \"polarimetric-ratios\" need none"
            );
        }
        let leaks = file.instrument.as_ref().is_some_and(|instrument| instrument.leakage.is_some());
        if leaks && is_ratio {
            refuse!(
                "instrument.leakage needs polarization.data = \"polarized-visibilities\": leakage does not cancel in ratios"
            );
        }
        self.strength.as_ref().map_or(Ok(()), |strength| check_strength("polarization.", strength))
    }
}

/// Refuses a choice of one.
pub(super) fn check_strength(table: &str, strength: &StrengthSettings) -> Result<(), Error> {
    if strength.values.len() < 2 {
        let (key, count) = (format!("length of {table}strength.values"), strength.values.len());
        return Err(FitError::range(key, count, "2 values or more").into());
    }
    Ok(())
}
