//! Emission that changes while matter carries it.

use crate::representation::Allowed;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// How emission may change while matter carries it.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ChangeSettings {
    /// Which changes are allowed.
    pub allowed: Allowed,
    /// Factor on ∫∫ |∂e/∂t| dV dt along the flow.
    #[schemars(range(min = 0.0, max = 1e12), extend("unit" = "a factor"))]
    pub weight: f64,
    /// Times between which emission is linear in time are not farther apart than this, M.
    #[schemars(range(min = 1e-6, max = 1e9), extend("unit" = "M"))]
    pub spacing: f64,
    /// Births that were found cost less in the rounds that follow, by s/(s + e) where e is emitted.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 1e-12, max = 1e12), extend("unit" = "an emission"))]
    pub sharpen: Option<f64>,
}
