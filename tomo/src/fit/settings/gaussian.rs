//! Settings of Gaussian fields: the prior of voxels, and truths that are drawn from it.

use crate::fit::linear::{Matern, Roughness};
use crate::representation::Degree;
use serde::{Deserialize, Serialize};

/// The prior of the voxels of a linear problem.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct GaussianSettings {
    /// Mean, emission.
    pub mean: f64,
    /// Standard deviation at a point, emission.
    pub amplitude: f64,
    /// Of Matérn's covariance, M.
    pub correlation_length: f64,
    /// Its ν.
    pub matern: Roughness,
}

/// A truth that is drawn from such a prior, with the fit's seed.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FieldSettings {
    /// Mean, emission.
    pub mean: f64,
    /// Standard deviation at a point, emission.
    pub amplitude: f64,
    /// Of Matérn's covariance, M.
    pub correlation_length: f64,
    /// Its ν.
    pub matern: Roughness,
    /// What becomes of what is negative.
    pub negative: Negative,
    /// Nodes along each axis of the cube about the region.
    pub nodes: usize,
    /// What is between them.
    #[serde(default = "cubic")]
    pub degree: Degree,
}

/// What becomes of the negative parts of a field.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Negative {
    /// The field is moved to the nearest one that is nowhere negative, in the metric of its covariance.
    Lifted,
    /// They are dark.
    Dark,
}

fn cubic() -> Degree {
    Degree::Cubic
}

impl GaussianSettings {
    /// The covariance.
    pub fn law(&self) -> Matern {
        let Self { mean, amplitude, correlation_length, matern: roughness } = *self;
        Matern { mean, amplitude, correlation_length, roughness }
    }
}

impl FieldSettings {
    /// The covariance.
    pub fn law(&self) -> Matern {
        let Self { mean, amplitude, correlation_length, matern: roughness, .. } = *self;
        Matern { mean, amplitude, correlation_length, roughness }
    }
}
