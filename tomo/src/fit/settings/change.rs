//! Emission that changes while matter carries it.

use crate::representation::Allowed;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Change of emission while matter carries it.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ChangeSettings {
    /// Changes that are allowed.
    pub allowed: Allowed,
    /// Factor on ∫∫ |∂e/∂t| dV dt along the flow, M³ of emission.
    #[schemars(range(min = 0.0, max = 1e12), extend("unit" = "a factor"))]
    pub weight: f64,
    /// Longest time between the knots at which the emission is free, M.
    #[schemars(range(min = 1e-6, max = 1e9), extend("unit" = "M"))]
    pub spacing: f64,
    /// An emission s: births found in a round cost s/(s + e) of `weight` in the next. Needs births and
    /// `linear.rounds` of 2 or more.
    #[schemars(range(min = 1e-12, max = 1e12), extend("unit" = "an emission"))]
    pub sharpen: Option<f64>,
}
