//! Interstellar medium in front of a source: its scattering, and errors for what varies.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A known scattering screen.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub enum Scattering {
    /// Diffractive scattering towards Sgr A* (Johnson et al. 2018).
    #[serde(rename = "sgra")]
    SgrA,
}

/// The scatter of visibilities of a source that varies about those of its mean image: σ = jy/(1 + (|u|/uv)²)^(power/2).
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Variability {
    /// Amplitude on short baselines, per real and imaginary part, Jy.
    #[schemars(range(min = 0.0, max = 1e9), extend("unit" = "Jy"))]
    pub jy: f64,
    /// Baseline length from which it falls, wavelengths.
    #[schemars(range(min = 1.0), extend("unit" = "wavelengths"))]
    pub uv: f64,
    /// Steepness of its fall.
    #[schemars(range(min = 0.0, max = 20.0), extend("unit" = "an exponent"))]
    pub power: f64,
}

impl Variability {
    /// Standard deviation on a baseline of this length (wavelengths), Jy.
    pub fn sigma(&self, length: f64) -> f64 {
        self.jy / (1.0 + (length / self.uv).powi(2)).powf(0.5 * self.power)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Half of a Gaussian's power on baselines as long as `uv`, for a power of 2.
    #[test]
    fn exact_variability_falls_with_the_length_of_baselines() {
        let law = Variability { jy: 0.2, uv: 2e9, power: 2.0 };
        assert_eq!(law.sigma(0.0), 0.2);
        assert!((law.sigma(2e9) - 0.1).abs() < 1e-15);
    }
}
