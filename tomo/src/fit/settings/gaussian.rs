//! Settings of random fields: the prior of voxels, and truths that are drawn from it.

use super::{FitError, refuse};
use crate::fit::linear::{Matern, Roughness};
use crate::representation::Degree;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Quantity of a field that is Gaussian.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum FieldKind {
    /// The emission.
    Gaussian,
    /// Its natural logarithm.
    LogNormal,
}

/// The prior of the voxels of a linear problem.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PriorOfVoxels {
    /// Quantity that is Gaussian.
    pub kind: FieldKind,
    /// Its mean; of a logarithm, −50 to 50: the median of the emission is exp(mean).
    #[schemars(range(min = -1e12, max = 1e12), extend("unit" = "emission, or its logarithm"))]
    pub mean: f64,
    /// Its standard deviation at a point; of a logarithm, at a node, at most 20.
    #[schemars(range(min = 1e-12, max = 1e12), extend("unit" = "a standard deviation"))]
    pub amplitude: f64,
    /// ℓ of the Matérn covariance, M.
    #[schemars(range(min = 1e-3, max = 1e6), extend("unit" = "M"))]
    pub correlation_length: f64,
    /// ν of the Matérn covariance.
    pub matern: Roughness,
}

/// A truth that is drawn from such a prior, with the fit's seed.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct FieldSettings {
    /// Quantity that is Gaussian.
    pub kind: FieldKind,
    /// Its mean; of a logarithm, −50 to 50.
    #[schemars(range(min = -1e12, max = 1e12), extend("unit" = "emission, or its logarithm"))]
    pub mean: f64,
    /// Its standard deviation at a point; of a logarithm, at most 20.
    #[schemars(range(min = 1e-12, max = 1e12), extend("unit" = "a standard deviation"))]
    pub amplitude: f64,
    /// ℓ of the Matérn covariance, M.
    #[schemars(range(min = 1e-3, max = 1e6), extend("unit" = "M"))]
    pub correlation_length: f64,
    /// ν of the Matérn covariance.
    pub matern: Roughness,
    /// Treatment of negative parts of a Gaussian field, for which it is needed.
    pub negative: Option<Negative>,
    /// Nodes along each axis of the cube about the region.
    #[schemars(range(min = 4, max = 256), extend("unit" = "nodes along each axis"))]
    pub nodes: usize,
    /// B-splines between the nodes.
    #[serde(default = "cubic")]
    pub degree: Degree,
}

/// Treatment of the negative parts of a field.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Negative {
    /// The field is moved to the nearest one that is nowhere negative, in the metric of its covariance.
    Lifted,
    /// They are dark.
    Dark,
}

pub(super) fn cubic() -> Degree {
    Degree::Cubic
}

/// Refuses a mean and a standard deviation whose exponentials are no emission.
fn logarithms(table: &str, mean: f64, amplitude: f64) -> Result<(), FitError> {
    let allowed = |range: &str| format!("{range} with kind = \"log-normal\": of a logarithm");
    if !(-50.0..=50.0).contains(&mean) {
        return Err(FitError::range(format!("{table}.mean"), mean, &allowed("-50 to 50")));
    }
    if amplitude > 20.0 {
        return Err(FitError::range(
            format!("{table}.amplitude"),
            amplitude,
            &allowed("at most 20"),
        ));
    }
    Ok(())
}

impl PriorOfVoxels {
    /// Refuses numbers that are no logarithms of emission, where they are to be.
    ///
    /// # Errors
    /// Names the key.
    pub(in crate::fit) fn check(&self) -> Result<(), FitError> {
        match self.kind {
            FieldKind::Gaussian => Ok(()),
            FieldKind::LogNormal => logarithms("linear.prior", self.mean, self.amplitude),
        }
    }

    /// The covariance.
    pub fn law(&self) -> Matern {
        let Self { mean, amplitude, correlation_length, matern: roughness, .. } = *self;
        Matern { mean, amplitude, correlation_length, roughness }
    }
}

impl FieldSettings {
    /// Refuses settings that do not say what becomes of negative emission, or say so where there is none.
    ///
    /// # Errors
    /// Names the key.
    pub(in crate::fit) fn check(&self) -> Result<(), FitError> {
        match (self.kind, self.negative) {
            (FieldKind::Gaussian, None) => {
                let why = "a Gaussian field has negative parts; give `negative = \"lifted\"` or `\"dark\"`";
                Err(FitError::missing("simulation.truth.field.negative", why))
            }
            (FieldKind::LogNormal, Some(_)) => refuse!(
                "simulation.truth.field.negative is not allowed with kind = \"log-normal\": such a field is positive"
            ),
            (FieldKind::Gaussian, Some(_)) => Ok(()),
            (FieldKind::LogNormal, None) => {
                logarithms("simulation.truth.field", self.mean, self.amplitude)
            }
        }
    }

    /// The covariance.
    pub fn law(&self) -> Matern {
        let Self { mean, amplitude, correlation_length, matern: roughness, .. } = *self;
        Matern { mean, amplitude, correlation_length, roughness }
    }
}
