//! Files of data, and what of them is compared.

use super::{MeasuredCurve, Scattering, Variability, refuse};
use crate::Error;
use kerrlight_render::polarization::StokesParameter;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::path::PathBuf;

/// Measured data.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub enum DataFiles {
    /// Visibilities: UVFITS, eht-imaging's text, the EHT's tables or CSV.
    Visibilities {
        /// UVFITS, eht-imaging's text, EHT tables or CSV, relative to this file.
        path: PathBuf,
        /// Rows within this time are averaged and form a frame, s, 0 or above; 0: each time is a frame, times
        /// within half a second as long as no baseline is there twice.
        #[schemars(range(min = 0.0), extend("unit" = "seconds"))]
        average_s: f64,
        /// Fraction of each amplitude, added to its error in quadrature; of each product where all four are fitted.
        #[schemars(range(min = 0.0, max = 10.0), extend("unit" = "part of the amplitude"))]
        systematic: f64,
        /// Time of the first frame, M.
        #[serde(default)]
        #[schemars(range(min = -1e9, max = 1e9), extend("unit" = "M"))]
        first_time: f64,
        /// Drops baselines shorter than this, wavelengths.
        #[schemars(range(min = 0.0), extend("unit" = "wavelengths"))]
        uv_min: Option<f64>,
        /// Interstellar scattering that is part of the model.
        scattering: Option<Scattering>,
        /// Adds jy/(1 + (|u|/uv)²)^(power/2) to all errors, for what the source varies and the model does not; not
        /// with polarised products.
        variability: Option<Variability>,
    },
    /// The light curve of an unresolved source: CSV.
    LightCurve(Box<MeasuredCurve>),
    /// A movie in Jy/pixel: .npz, .npy, .csv, .fits or .exr.
    Movie {
        /// NPZ, NPY, CSV, FITS or EXR in Jy/pixel, or a sequence: `frames/*.exr`, `f_%04d.exr`, a
        /// folder of EXR files.
        path: PathBuf,
        /// Time of the first image, M; the others follow at equal steps.
        #[schemars(range(min = -1e9, max = 1e9), extend("unit" = "M"))]
        from: f64,
        /// Time of the last image, M.
        #[schemars(range(min = -1e9, max = 1e9), extend("unit" = "M"))]
        to: f64,
    },
}

/// Data and their share.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Loss {
    /// Kind of data.
    pub data: LossKind,
    /// Weight of the term.
    #[serde(default = "one")]
    #[schemars(range(min = 1e-12, max = 1e12), extend("unit" = "a factor"))]
    pub weight: f64,
    /// Standard deviation of a pixel (image) or of a movie's flux (light-curve), Jy; needed for these two, but not
    /// for light curves of their own.
    #[schemars(range(min = 1e-15, max = 1e15), extend("unit" = "Jy"))]
    pub sigma: Option<f64>,
    /// Stokes parameters of a light curve of its own; `["I"]` without it.
    pub stokes: Option<Vec<StokesParameter>>,
    /// Least signal-to-noise ratio of baselines in closures and ratios; 0 without it.
    #[schemars(range(min = 0.0, max = 1e9), extend("unit" = "a signal-to-noise ratio"))]
    pub least_snr: Option<f64>,
}

fn one() -> f64 {
    1.0
}

/// Kinds of data.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum LossKind {
    /// Every pixel.
    Image,
    /// Complex visibilities.
    Visibilities,
    /// Debiased amplitudes.
    Amplitudes,
    /// Closure phases.
    ClosurePhases,
    /// Log closure amplitudes.
    LogClosureAmplitudes,
    /// RR, LL, RL and LR, or I, Q and U.
    PolarizedVisibilities,
    /// (Q ± iU)/I of baselines.
    PolarimetricRatios,
    /// Total flux.
    LightCurve,
}

/// Refuses numbers that have no part in a term of the loss, and data that count twice.
///
/// # Errors
/// Names the term and the key.
pub fn check_losses(losses: &[Loss]) -> Result<(), Error> {
    use LossKind::{Image, LightCurve, PolarizedVisibilities, Visibilities};
    for (k, Loss { data, sigma, least_snr, .. }) in losses.iter().enumerate() {
        let name = data.name();
        if sigma.is_some() && !matches!(data, Image | LightCurve) {
            refuse!(
                "loss.{k}.sigma is for image and light-curve: errors of {name} are in the data"
            );
        }
        if least_snr.is_some() && !data.has_weak_baselines() {
            refuse!(
                "loss.{k}.least_snr is for closure quantities and ratios: all baselines count in {name}, as their errors say"
            );
        }
        let is_same = |other: &Loss| match (other.data, *data) {
            (a, b) if a == b => true,
            (Visibilities, PolarizedVisibilities) | (PolarizedVisibilities, Visibilities) => true,
            _ => false,
        };
        if let Some(before) = losses[..k].iter().position(is_same) {
            refuse!("loss.{k}.data = {name}: they count in loss.{before} already");
        }
    }
    Ok(())
}

impl LossKind {
    /// Returns whether weak baselines are left out of it: what is made of several is not Gaussian then.
    fn has_weak_baselines(self) -> bool {
        use LossKind::{ClosurePhases, LogClosureAmplitudes, PolarimetricRatios};
        matches!(self, ClosurePhases | LogClosureAmplitudes | PolarimetricRatios)
    }

    /// All kinds in their order, each with its name in `loss.data` and in a sentence.
    pub const NAMES: [(LossKind, &str, &str); 8] = [
        (LossKind::Image, "image", "images"),
        (LossKind::Visibilities, "visibilities", "visibilities"),
        (LossKind::Amplitudes, "amplitudes", "amplitudes"),
        (LossKind::ClosurePhases, "closure-phases", "closure phases"),
        (LossKind::LogClosureAmplitudes, "log-closure-amplitudes", "log closure amplitudes"),
        (LossKind::PolarizedVisibilities, "polarized-visibilities", "polarized visibilities"),
        (LossKind::PolarimetricRatios, "polarimetric-ratios", "polarimetric ratios"),
        (LossKind::LightCurve, "light-curve", "the light curve"),
    ];

    /// Returns its name in `loss.data`.
    pub fn name(self) -> &'static str {
        Self::NAMES[self as usize].1
    }

    /// Returns its name in a sentence.
    pub fn label(self) -> &'static str {
        Self::NAMES[self as usize].2
    }

    /// Returns whether χ² of it is convex in the emission, so that a minimum can be told from other stationary
    /// points.
    pub fn is_convex(self) -> bool {
        self.is_visibilities() || matches!(self, LossKind::Image | LossKind::LightCurve)
    }

    /// Returns whether they compare Q and U of baselines too.
    pub fn is_polarized(self) -> bool {
        matches!(self, LossKind::PolarizedVisibilities | LossKind::PolarimetricRatios)
    }

    /// Returns whether they know the flux of the source.
    pub fn knows_flux(self) -> bool {
        let all =
            [LossKind::ClosurePhases, LossKind::LogClosureAmplitudes, LossKind::PolarimetricRatios];
        !all.contains(&self)
    }

    /// Returns whether they are complex visibilities, of total intensity or of all products.
    pub fn is_visibilities(self) -> bool {
        matches!(self, LossKind::Visibilities | LossKind::PolarizedVisibilities)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Names that messages list are those that settings are read as.
    #[test]
    fn exact_names_are_those_of_the_settings() {
        for (kind, name, _) in LossKind::NAMES {
            assert_eq!(toml::Value::try_from(kind).unwrap().as_str(), Some(name));
            assert_eq!(kind.name(), name);
        }
    }
}
