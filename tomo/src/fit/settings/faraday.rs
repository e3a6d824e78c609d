//! A rotation of all position angles that is not known.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// How the rotation of position angles between source and observer is looked for.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct FaradaySettings {
    /// Rotations that are tried first, at equal distances over 180 degrees.
    #[schemars(range(min = 4, max = 360), extend("unit" = "rotations over 180 degrees"))]
    pub angles: usize,
    /// Iterations of the linear problem for each rotation.
    #[schemars(range(min = 1, max = 100_000), extend("unit" = "iterations"))]
    pub iterations: usize,
}
