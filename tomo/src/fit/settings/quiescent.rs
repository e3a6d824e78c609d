//! Emission that does not move, beside the moving one.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// An image on the screen that is the same in every frame, recovered beside the emission; constant fluxes of a light
/// curve.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct QuiescentSettings {
    /// Largest brightness, M of emission 1 along a line of sight; of a light curve, the largest |flux|, Jy.
    #[schemars(range(min = 1e-15, max = 1e15), extend("unit" = "M of emission; Jy, of a light curve"))]
    pub upper: f64,
    /// Factor on ∫ |∇b|² dA over the screen, b in M and A in M²; needed, but not for light curves.
    #[schemars(range(min = 0.0, max = 1e12), extend("unit" = "a factor"))]
    pub smoothness: Option<f64>,
    /// Factor on ∫ b dA; needed, but not for light curves.
    #[schemars(range(min = 0.0, max = 1e12), extend("unit" = "a factor"))]
    pub sparsity: Option<f64>,
}
