//! Settings of penalties on the brightness of a static image.

use crate::Error;
use kerrlight_tomo::fit::Regulariser;
use kerrlight_tomo::fit::linear::Prior;
use kerrlight_tomo::fit::settings::{FitError, Within, refuse};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A penalty.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PenaltySettings {
    /// Kind of penalty, each at most once.
    pub kind: PenaltyKind,
    /// Factor on its integral over the field, above 0.
    #[schemars(range(min = 0.0, max = 1e12), extend("unit" = "a factor"))]
    pub weight: f64,
    /// Total variation: slope below which it is smoothed, above 0.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub epsilon: Option<f64>,
}

/// Kinds of penalties.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum PenaltyKind {
    /// ∫ |∇e| dA.
    TotalVariation,
    /// ∫ |∇e|² dA.
    Smoothness,
}

impl PenaltySettings {
    fn prior(&self) -> Result<Prior, FitError> {
        let Self { kind, weight, epsilon } = *self;
        if !(weight > 0.0 && weight.is_finite()) {
            return Err(FitError::range("weight", weight, "above 0"));
        }
        let regulariser = match (kind, epsilon) {
            (PenaltyKind::TotalVariation, Some(epsilon)) => Regulariser::TotalVariation { epsilon },
            (PenaltyKind::Smoothness, None) => Regulariser::Smoothness,
            (PenaltyKind::Smoothness, Some(_)) => refuse!("epsilon is not for smoothness"),
            (PenaltyKind::TotalVariation, None) => {
                let why = "total-variation needs it; give `epsilon = …` beside `kind = \"total-variation\"`: the \
                           slope below which it is smoothed, above 0";
                return Err(FitError::missing("epsilon", why));
            }
        };
        Ok(Prior { regulariser: regulariser.checked()?, weight })
    }
}

/// Penalties with their weights.
///
/// # Errors
/// If a kind occurs twice, or a number is missing or out of range.
pub(super) fn priors_of(settings: &[PenaltySettings]) -> Result<Vec<Prior>, Error> {
    let one = |(k, setting): (usize, &PenaltySettings)| {
        let same = |other: &PenaltySettings| other.kind == setting.kind;
        if let Some(first) = settings[..k].iter().position(same) {
            refuse!(
                "regulariser {k}: the same kind as regulariser {first}; each kind is allowed once"
            );
        }
        setting.prior().within(format!("regulariser {k}"))
    };
    settings.iter().enumerate().map(one).collect()
}
