//! A setting that is chosen by data that are held out.

use super::{AxisSearch, FitError, FitFile, Kind, Linear, Start, refuse};
use crate::Error;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Setting that is chosen, its values, and how data are divided.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct HeldOutSettings {
    /// The number that is chosen.
    pub setting: Weight,
    /// Values to choose from, two or more; those of a prior above 0.
    #[schemars(inner(range(min = 0.0, max = 1e12)), extend("unit" = "a factor"))]
    pub values: Vec<f64>,
    /// Parts of the frames, at most half of their number.
    #[schemars(range(min = 2, max = 1000), extend("unit" = "parts of the frames"))]
    pub folds: usize,
}

/// A weight of the linear problem.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub enum Weight {
    /// Cost of a change of emission.
    #[serde(rename = "change.weight")]
    Change,
    /// Cost of slopes.
    #[serde(rename = "linear.smoothness")]
    Smoothness,
    /// Cost of light.
    #[serde(rename = "linear.sparsity")]
    Sparsity,
    /// Amplitude of the prior's fields.
    #[serde(rename = "linear.prior.amplitude")]
    Amplitude,
    /// Correlation length of the prior's fields.
    #[serde(rename = "linear.prior.correlation_length")]
    CorrelationLength,
}

impl Weight {
    /// Its key.
    pub fn name(self) -> &'static str {
        match self {
            Weight::Change => "change.weight",
            Weight::Smoothness => "linear.smoothness",
            Weight::Sparsity => "linear.sparsity",
            Weight::Amplitude => "linear.prior.amplitude",
            Weight::CorrelationLength => "linear.prior.correlation_length",
        }
    }

    /// The settings with another value of it.
    #[must_use]
    pub fn put(self, mut file: FitFile, value: f64) -> FitFile {
        match (self, &mut file.change, &mut file.linear) {
            (Weight::Change, Some(change), _) => change.weight = value,
            (Weight::Smoothness, _, Some(linear)) => linear.smoothness = value,
            (Weight::Sparsity, _, Some(linear)) => linear.sparsity = value,
            (Weight::Amplitude, _, Some(Linear { prior: Some(prior), .. })) => {
                prior.amplitude = value;
            }
            (Weight::CorrelationLength, _, Some(Linear { prior: Some(prior), .. })) => {
                prior.correlation_length = value;
            }
            _ => {}
        }
        file
    }
}

/// Returns whether voxels are solved for, about an axis that is known, before anything is learnt.
fn starts_linear(file: &FitFile) -> bool {
    matches!(file.training.start, Start::Linear { .. }) && file.axis == (AxisSearch::Known {})
}

impl HeldOutSettings {
    /// Refuses what cannot be chosen.
    pub(in crate::fit) fn check(&self, file: &FitFile) -> Result<(), Error> {
        if self.values.len() < 2 {
            let allowed = "2 values or more";
            return Err(
                FitError::range("length of held_out.values", self.values.len(), allowed).into()
            );
        }
        let has_prior = file.linear.as_ref().is_some_and(|linear| linear.prior.is_some());
        let is_linear = file.representation.kind == Kind::LinearGrid;
        let why = match (is_linear, self.setting) {
            (false, Weight::Change) if starts_linear(file) && file.change.is_some() => {
                return Ok(());
            }
            (false, _) => {
                "needs representation.kind = \"linear-grid\"; change.weight is also chosen for others that have a linear \
                 start and a known axis"
            }
            (true, Weight::Change) if file.change.is_none() => {
                "chooses change.weight, and there is no [change]"
            }
            (true, Weight::Amplitude | Weight::CorrelationLength) if !has_prior => {
                "chooses a number of the prior, and there is no [linear.prior]"
            }
            (true, Weight::Amplitude | Weight::CorrelationLength) => {
                return self.positive();
            }
            _ => return Ok(()),
        };
        refuse!("held_out {why}")
    }

    /// Refuses values that a prior cannot have.
    fn positive(&self) -> Result<(), Error> {
        match self.values.iter().position(|value| *value <= 0.0) {
            Some(k) => {
                let key = format!("held_out.values.{k}");
                Err(FitError::range(key, self.values[k], "above 0 with this setting").into())
            }
            None => Ok(()),
        }
    }
}
