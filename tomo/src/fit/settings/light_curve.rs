//! Light curves in Stokes parameters: simulated, or read from a file.

use super::Noise;
use crate::fit::band::Background;
use kerrlight_render::polarization::StokesParameter;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::path::PathBuf;

/// A number for some of the Stokes parameters.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[allow(non_snake_case)]
pub struct PerStokes {
    /// Stokes I, Jy.
    pub I: Option<f64>,
    /// Stokes Q, Jy.
    pub Q: Option<f64>,
    /// Stokes U, Jy.
    pub U: Option<f64>,
    /// Stokes V, Jy.
    pub V: Option<f64>,
}

impl PerStokes {
    /// Returns the value of a parameter.
    pub fn of(&self, parameter: StokesParameter) -> Option<f64> {
        self.all()[parameter.index()]
    }

    /// All four.
    pub fn all(&self) -> [Option<f64>; 4] {
        [self.I, self.Q, self.U, self.V]
    }
}

/// A light curve that is simulated.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SimulatedCurve {
    /// Hours of UTC of the samples, hours; this or `times`.
    #[schemars(inner(range(min = -1e4, max = 1e4)), extend("unit" = "hours of UTC"))]
    pub times_h: Option<Vec<f64>>,
    /// A CSV with such a column, relative to this file.
    pub times: Option<PathBuf>,
    /// Time of the first sample, M.
    #[serde(default)]
    #[schemars(range(min = -1e9, max = 1e9), extend("unit" = "M"))]
    pub first_time: f64,
    /// Standard deviations, above 0 Jy, of the parameters of the loss.
    pub sigma: PerStokes,
    /// Noise that is added.
    pub noise: Noise,
    /// A background that is drawn and added to Q and U, independent of each other.
    pub background: Option<Background>,
    /// Scales the truth to this mean of I; as bright as its amplitudes without it.
    pub mean_flux: Option<MeanFlux>,
    /// Samples later than this after the first are not fitted, minutes; their χ² judges the fit.
    #[schemars(range(min = 0.0, max = 1e9), extend("unit" = "minutes"))]
    pub validate_after_min: Option<f64>,
}

/// A mean of I.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct MeanFlux {
    /// The mean, Jy.
    #[schemars(range(min = 1e-15, max = 1e15), extend("unit" = "Jy"))]
    pub jy: f64,
    /// It is over this time from the first sample on, minutes.
    #[schemars(range(min = 0.0, max = 1e9), extend("unit" = "minutes"))]
    pub minutes: f64,
}

/// A light curve of a file, and what is done with it, in this order.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct MeasuredCurve {
    /// CSV of an unresolved source, or UVFITS, of which the baselines within a site are read (ALMA–APEX, JCMT–SMA),
    /// relative to this file.
    pub path: PathBuf,
    /// Time of the first sample that is left, M.
    #[serde(default)]
    #[schemars(range(min = -1e9, max = 1e9), extend("unit" = "M"))]
    pub first_time: f64,
    /// First and last hour of UTC, hours; all without it.
    #[schemars(inner(range(min = -1e4, max = 1e4)), extend("unit" = "hours of UTC"))]
    pub utc_h: Option<[f64; 2]>,
    /// Samples that are averaged; the last average has the rest.
    #[schemars(range(min = 1, max = 1_000_000_000), extend("unit" = "samples"))]
    pub average: Option<usize>,
    /// Time over which samples are averaged, s.
    pub average_s: Option<f64>,
    /// Averages later than this after the one before are dropped, s: they bridge gaps.
    #[schemars(range(min = 0.0, max = 1e9), extend("unit" = "seconds"))]
    pub most_gap_s: Option<f64>,
    /// Standard deviations, Jy, in place of the file's.
    pub sigma: Option<PerStokes>,
    /// Constant flux that is subtracted, Jy.
    pub steady: Option<PerStokes>,
    /// Added to position angles, degrees east of north: takes Faraday rotation back.
    #[schemars(range(min = -360.0, max = 360.0), extend("unit" = "degrees east of north"))]
    pub derotation_deg: Option<f64>,
    /// I of all samples in place of the file's, Jy.
    #[schemars(range(min = -1e15, max = 1e15), extend("unit" = "Jy"))]
    pub intensity: Option<f64>,
    /// Samples later than this after the first are not fitted, minutes; their χ² judges the fit.
    #[schemars(range(min = 0.0, max = 1e9), extend("unit" = "minutes"))]
    pub validate_after_min: Option<f64>,
}
