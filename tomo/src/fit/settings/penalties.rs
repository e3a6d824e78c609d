//! Settings of penalties on the emission, and what they mean for each representation.

use super::{FitError, FitFile, Kind, Within, refuse};
use crate::Error;
use crate::fit::linear::Prior;
use crate::fit::{Penalties, Probe, Regulariser};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A penalty.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PenaltySettings {
    /// Which penalty, each at most once.
    pub kind: PenaltyKind,
    /// Factor on its integral over the region, above 0.
    #[schemars(range(min = 0.0, max = 1e12), extend("unit" = "a factor"))]
    pub weight: f64,
    /// Total variation: slope below which it is smoothed, emission per M, above 0.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub epsilon: Option<f64>,
    /// Entropy: the emission m at which it vanishes, above 0.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub level: Option<f64>,
    /// Entropy: fraction of m below which it continues as a parabola, above 0.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub floor: Option<f64>,
}

/// Kinds of penalties.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum PenaltyKind {
    /// ∫ |∇e| dV.
    TotalVariation,
    /// ∫ |∇e|² dV.
    Smoothness,
    /// ∫ |e| dV.
    Sparsity,
    /// ∫ (e ln(e/m) − e + m) dV.
    Entropy,
}

/// Where penalties look at a network.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ProbeSettings {
    /// Nodes along each axis.
    #[schemars(range(min = 4, max = 256), extend("unit" = "nodes along each axis"))]
    pub nodes: usize,
}

impl PenaltySettings {
    fn prior(&self) -> Result<Prior, FitError> {
        let Self { kind, weight, epsilon, level, floor } = *self;
        if !(weight > 0.0 && weight.is_finite()) {
            return Err(FitError::range("weight", weight, "above 0"));
        }
        let given = [("epsilon", epsilon), ("level", level), ("floor", floor)];
        let (name, needed): (_, &[&str]) = match kind {
            PenaltyKind::TotalVariation => ("total-variation", &["epsilon"]),
            PenaltyKind::Smoothness => ("smoothness", &[]),
            PenaltyKind::Sparsity => ("sparsity", &[]),
            PenaltyKind::Entropy => ("entropy", &["level", "floor"]),
        };
        if let Some((other, _)) = given.iter().find(|(k, x)| x.is_some() && !needed.contains(k)) {
            refuse!("{other} is not for {name}");
        }
        let get = |key: &str| {
            let found = given.iter().find(|(name, _)| *name == key).and_then(|(_, value)| *value);
            found.ok_or_else(|| {
                let why = format!(
                    "{name} needs it; give `{key} = …` beside `kind = \"{name}\"`: {}",
                    meaning(key)
                );
                FitError::missing(key, why)
            })
        };
        let regulariser = match kind {
            PenaltyKind::TotalVariation => Regulariser::TotalVariation { epsilon: get("epsilon")? },
            PenaltyKind::Smoothness => Regulariser::Smoothness,
            PenaltyKind::Sparsity => Regulariser::Sparsity,
            PenaltyKind::Entropy => {
                Regulariser::Entropy { level: get("level")?, floor: get("floor")? }
            }
        };
        Ok(Prior { regulariser: regulariser.checked()?, weight })
    }
}

/// What a number of a penalty is.
fn meaning(key: &str) -> &'static str {
    match key {
        "epsilon" => "the slope below which it is smoothed, emission per M, above 0",
        "level" => "the emission where the penalty is 0, above 0",
        _ => "the fraction of level below which it continues as a parabola, above 0",
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

impl FitFile {
    /// The penalties with their weights.
    ///
    /// # Errors
    /// If a kind occurs twice, or a number is missing or out of range.
    pub fn priors(&self) -> Result<Vec<Prior>, Error> {
        priors_of(&self.regulariser)
    }

    /// Penalties of a representation that is learnt; `None` where there are none.
    ///
    /// # Errors
    /// As [`FitFile::priors`], or if a network has no `probe`.
    pub fn penalties(&self) -> Result<Option<Penalties>, Error> {
        let priors = self.priors()?;
        if priors.is_empty() {
            return Ok(None);
        }
        let probe = match (&self.representation.kind, self.probe) {
            (Kind::Grid | Kind::LinearGrid, _) => {
                Probe::Fixed { nodes: self.representation.grid_nodes() }
            }
            (_, Some(ProbeSettings { nodes })) => Probe::Moved { nodes },
            (..) => {
                return Err(FitError::missing(
                    "probe.nodes",
                    "regularisers of a network are evaluated on a grid; add a table [probe] with `nodes = 32`, nodes \
                     along each axis, 4 to 256",
                ).into());
            }
        };
        Ok(Some(Penalties { priors, probe, region: self.region.limits() }))
    }
}
